// MatWriter: writes measurements as a MATLAB level 5 MAT-file, by libmatio.
#include <fmt/format.h>
#include <matio.h>

#include <algorithm>
#include <array>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tools/arrays/row_output.hpp"
#include "tools/text_output.hpp"

namespace imud {
namespace {

constexpr std::size_t largest_variable = (std::size_t{1} << 31U) - 1;

struct CloseMat {
  void operator()(mat_t* file) const noexcept { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const noexcept { Mat_VarFree(variable); }
};
using MatFile = std::unique_ptr<mat_t, CloseMat>;
using MatVariable = std::unique_ptr<matvar_t, FreeVariable>;

void require_mat(bool good) {
  if (!good) throw std::runtime_error("cannot write all of it");
}

MatVariable make_array(const std::string& name, std::string_view type, std::size_t rows, std::size_t columns,
                       std::vector<char>& values) {
  const auto [kind, storage] = type == "i8"   ? std::pair(MAT_C_INT64, MAT_T_INT64)
                               : type == "u8" ? std::pair(MAT_C_UINT64, MAT_T_UINT64)
                               : type == "u4" ? std::pair(MAT_C_UINT32, MAT_T_UINT32)
                                              : std::pair(MAT_C_DOUBLE, MAT_T_DOUBLE);
  std::array<std::size_t, 2> size{rows, columns};
  MatVariable variable(
      Mat_VarCreate(name.c_str(), kind, storage, 2, size.data(), values.data(), MAT_F_DONT_COPY_DATA));
  require_mat(variable != nullptr);
  return variable;
}

MatVariable make_text(std::string text) {
  const auto begins_character = [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80; };
  std::array<std::size_t, 2> size{1, static_cast<std::size_t>(std::ranges::count_if(text, begins_character))};
  MatVariable variable(Mat_VarCreate(nullptr, MAT_C_CHAR, MAT_T_UTF8, 2, size.data(), text.data(), 0));
  require_mat(variable != nullptr);
  return variable;
}

using Fields = std::vector<std::pair<std::string, MatVariable>>;

MatVariable make_struct(const char* name, Fields fields) {
  std::vector<const char*> names;
  for (const auto& field : fields) names.push_back(field.first.c_str());
  std::array<std::size_t, 2> size{1, 1};
  MatVariable variable(Mat_VarCreateStruct(name, 2, size.data(), names.data(), static_cast<unsigned>(names.size())));
  require_mat(variable != nullptr);
  for (auto& [key, value] : fields) Mat_VarSetStructFieldByName(variable.get(), key.c_str(), 0, value.release());
  return variable;
}

MatVariable describe(const RowAttributes& attributes, std::span<const MeasurementColumn> columns) {
  Fields all;
  for (const auto& [name, text] : attributes.texts) all.emplace_back(name, make_text(text));
  if (attributes.seed) {
    std::array<std::size_t, 2> size{1, 1};
    std::uint64_t seed = *attributes.seed;
    all.emplace_back("seed",
                     MatVariable(Mat_VarCreate(nullptr, MAT_C_UINT64, MAT_T_UINT64, 2, size.data(), &seed, 0)));
  }
  Fields units, frames, meanings;
  for (const MeasurementColumn& column : columns) {
    units.emplace_back(column.name, make_text(std::string(column.unit)));
    if (!column.frame.empty()) frames.emplace_back(column.name, make_text(std::string(column.frame)));
    meanings.emplace_back(column.name, make_text(std::string(column.meaning)));
  }
  all.emplace_back("unit", make_struct(nullptr, std::move(units)));
  all.emplace_back("frame", make_struct(nullptr, std::move(frames)));
  all.emplace_back("meaning", make_struct(nullptr, std::move(meanings)));
  return make_struct("imud", std::move(all));
}

void write_variable(mat_t* file, MatVariable variable) {
  require_mat(Mat_VarWrite(file, variable.get(), MAT_COMPRESSION_NONE) == 0);
}

// The variables are as in measurement_columns(), n x 1 or n x 3, in the types of these columns, and a struct `imud`
// with the attributes and, by column, `unit`, `frame` and `meaning`. A variable of level 5 states its size at its
// begin, so that all rows are kept in memory (row_size() bytes each) until finish() writes the file; at most 2 GiB a
// variable, which are 89 million rows.
class MatWriter final : public RowOutput {
 public:
  MatWriter(std::string path, bool with_truth, RowAttributes attributes)
      : path_(std::move(path)), with_truth_(with_truth), attributes_(std::move(attributes)) {
    TextOutput file(path_);  // throws if the path is no good
    for (const MeasurementColumn& column : measurement_columns(with_truth)) held_.emplace_back(column.values);
  }

  void write(const MeasurementRow& row) override {
    constexpr std::size_t widest = sizeof(MeasurementRow::gyro);
    is_full_ = is_full_ || rows_ == largest_variable / widest;
    if (is_full_) return;
    const char* from = reinterpret_cast<const char*>(&row);
    for (std::size_t i = 0; i < held_.size(); ++i) {
      const MeasurementColumn& column = measurement_columns(with_truth_)[i];
      const std::size_t size = column.size() / column.values;
      for (std::vector<char>& axis : held_[i]) {
        axis.insert(axis.end(), from, from + size);
        from += size;
      }
    }
    ++rows_;
  }
  void flush() override {}
  void finish() override {
    try {
      const auto columns = measurement_columns(with_truth_);
      const std::string header = "MATLAB 5.0 MAT-file, written by imud " IMUD_VERSION;
      MatFile file(Mat_CreateVer(path_.c_str(), header.c_str(), MAT_FT_MAT5));
      require_mat(file != nullptr);
      for (std::size_t i = 0; i < held_.size(); ++i) {
        std::vector<char> values = std::move(held_[i].front());
        for (std::size_t axis = 1; axis < held_[i].size(); ++axis) {
          values.insert(values.end(), held_[i][axis].begin(), held_[i][axis].end());
          held_[i][axis] = {};
        }
        write_variable(file.get(),
                       make_array(std::string(columns[i].name), columns[i].type, rows_, columns[i].values, values));
      }
      write_variable(file.get(), describe(attributes_, columns));
      require_mat(Mat_Close(file.release()) == 0);
      // libmatio does not check its writes: the file is whole if its last variable can be read.
      file.reset(Mat_Open(path_.c_str(), MAT_ACC_RDONLY));
      require_mat(file != nullptr && MatVariable(Mat_VarRead(file.get(), "imud")) != nullptr);
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("{}: {}", path_, error.what()));
    }
    if (is_full_)
      throw std::runtime_error(fmt::format(
          "{}: holds the first {} rows, the most that a MAT-file of level 5 takes; give --hdf5", path_, rows_));
  }

 private:
  const std::string path_;
  const bool with_truth_;
  const RowAttributes attributes_;
  // The values are ordered by column and axis, because MATLAB keeps the values of an axis together.
  std::vector<std::vector<std::vector<char>>> held_;
  std::size_t rows_ = 0;
  bool is_full_ = false;
};

}  // namespace

extern constexpr RowFormat mat_row_format = {
    .name = "mat",
    .help = "also writes a MAT-file of level 5: a variable for each quantity",
    .keeps_attributes = true,
    .needs_time = false,
    .make = make_writer<MatWriter>};

}  // namespace imud
