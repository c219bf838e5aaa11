// Hdf5Writer: writes measurements as an HDF5 file with a dataset for each quantity.
#include <fmt/format.h>
#include <hdf5.h>

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tools/arrays/row_output.hpp"
#include "transports/file/output_path.hpp"

namespace imud {
namespace {

constexpr std::size_t chunk_rows = 4096;

// Owns an identifier of HDF5.
class Handle {
 public:
  Handle(hid_t id, herr_t (*closer)(hid_t)) : id_(id), close_(closer) {
    if (id < 0) throw std::runtime_error("HDF5 has failed");
  }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&&) = delete;
  ~Handle() { close(); }
  operator hid_t() const noexcept { return id_; }
  // Returns false if it fails.
  bool close() noexcept { return id_ < 0 || close_(std::exchange(id_, -1)) >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

hid_t type_of(std::string_view type) {
  return type == "i8"   ? H5T_NATIVE_INT64
         : type == "u8" ? H5T_NATIVE_UINT64
         : type == "u4" ? H5T_NATIVE_UINT32
                        : H5T_NATIVE_DOUBLE;
}

void require(bool good) {
  if (!good) throw std::runtime_error("HDF5 has failed");
}

void add_text(hid_t object, const std::string& name, std::string_view text) {
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  require(H5Tset_size(type, H5T_VARIABLE) >= 0 && H5Tset_cset(type, H5T_CSET_UTF8) >= 0);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  const std::string copy(text);
  const char* begin = copy.c_str();
  require(H5Awrite(attribute, type, static_cast<const void*>(&begin)) >= 0);
}

void add_number(hid_t object, const std::string& name, std::uint64_t value) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(H5Acreate2(object, name.c_str(), H5T_NATIVE_UINT64, space, H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
  require(H5Awrite(attribute, H5T_NATIVE_UINT64, &value) >= 0);
}

Handle create_file(const std::string& path) {
  H5dont_atexit();  // at exit it would write again to a file that could not be closed, and crash (1.10.8)
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  if (const std::string fault = foreign_link_fault(path); !fault.empty()) throw std::runtime_error(fault);
  // Attributes above 64 KiB need the format of version 1.8, which is from 2008.
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  require(H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_V18) >= 0);
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  if (file < 0) throw std::runtime_error(path + ": cannot write it");
  return {file, H5Fclose};
}

// Makes a dataset of the column, without rows.
Handle create_dataset(hid_t file, const MeasurementColumn& column) {
  const int rank = column.values > 1 ? 2 : 1;
  const std::array<hsize_t, 2> none{0, column.values}, most{H5S_UNLIMITED, column.values},
      chunk{chunk_rows, column.values};
  const Handle space(H5Screate_simple(rank, none.data(), most.data()), H5Sclose);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  require(H5Pset_chunk(properties, rank, chunk.data()) >= 0);
  Handle dataset(H5Dcreate2(file, std::string(column.name).c_str(), type_of(column.type), space, H5P_DEFAULT,
                            properties, H5P_DEFAULT),
                 H5Dclose);
  add_text(dataset, "unit", column.unit);
  if (!column.frame.empty()) add_text(dataset, "frame", column.frame);
  add_text(dataset, "meaning", column.meaning);
  return dataset;
}

// The datasets are as in measurement_columns(), n or n x 3, chunked and extensible, with the attributes
// `unit`, `frame` and `meaning`. Keeps at most 4096 rows. After flush() the file is whole. Between flushes, a killed
// program may leave a broken file.
class Hdf5Writer final : public RowOutput {
 public:
  Hdf5Writer(std::string path, bool with_truth, const RowAttributes& attributes)
      : path_(std::move(path)), with_truth_(with_truth), file_(create_file(path_)) {
    try {
      for (const MeasurementColumn& column : measurement_columns(with_truth)) {
        datasets_.push_back(create_dataset(file_, column));
        held_.emplace_back().reserve(chunk_rows * column.size());
      }
      for (const auto& [name, text] : attributes.texts) add_text(file_, name, text);
      if (attributes.seed) add_number(file_, "seed", *attributes.seed);
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("{}: {}", path_, error.what()));
    }
  }

  void write(const MeasurementRow& row) override {
    const char* from = reinterpret_cast<const char*>(&row);
    for (std::size_t i = 0; i < held_.size(); ++i) {
      const std::size_t size = measurement_columns(with_truth_)[i].size();
      held_[i].insert(held_[i].end(), from, from + size);
      from += size;
    }
    if (++rows_held_ == chunk_rows) write_rows();
  }
  void flush() override {
    write_rows();
    if (!has_failed_ && H5Fflush(file_, H5F_SCOPE_LOCAL) < 0) has_failed_ = true;
  }
  void finish() override {
    flush();
    bool is_good = !has_failed_;
    for (Handle& dataset : datasets_) is_good = dataset.close() && is_good;
    is_good = file_.close() && is_good;
    if (!is_good) throw std::runtime_error(path_ + ": cannot write all of it");
  }

 private:
  void write_rows() {
    if (rows_held_ > 0 && !has_failed_) {
      try {
        for (std::size_t i = 0; i < held_.size(); ++i) {
          const MeasurementColumn& column = measurement_columns(with_truth_)[i];
          const Handle& dataset = datasets_[i];
          const int rank = column.values > 1 ? 2 : 1;
          const std::array<hsize_t, 2> whole{rows_ + rows_held_, column.values}, begin{rows_, 0},
              size{rows_held_, column.values};
          require(H5Dset_extent(dataset, whole.data()) >= 0);
          const Handle in_file(H5Dget_space(dataset), H5Sclose);
          require(H5Sselect_hyperslab(in_file, H5S_SELECT_SET, begin.data(), nullptr, size.data(), nullptr) >= 0);
          const Handle in_memory(H5Screate_simple(rank, size.data(), nullptr), H5Sclose);
          require(H5Dwrite(dataset, type_of(column.type), in_memory, in_file, H5P_DEFAULT, held_[i].data()) >= 0);
        }
        rows_ += rows_held_;
      } catch (const std::exception&) {
        has_failed_ = true;
      }
    }
    for (auto& column : held_) column.clear();
    rows_held_ = 0;
  }

  const std::string path_;
  const bool with_truth_;
  Handle file_;
  std::vector<Handle> datasets_;
  std::vector<std::vector<char>> held_;  // by column
  std::size_t rows_held_ = 0;
  std::uint64_t rows_ = 0;  // in the file
  bool has_failed_ = false;
};

}  // namespace

extern constexpr RowFormat hdf5_row_format = {.name = "hdf5",
                                              .help = "also writes HDF5: a dataset for each quantity",
                                              .keeps_attributes = true,
                                              .needs_time = false,
                                              .make = make_writer<Hdf5Writer>};

}  // namespace imud
