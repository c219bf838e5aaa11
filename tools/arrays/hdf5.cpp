// Hdf5Writer: writes measurements as an HDF5 file with a dataset for each quantity.
#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tools/arrays/hdf5_file.hpp"
#include "tools/arrays/row_output.hpp"

namespace imud {
namespace {

constexpr std::size_t chunk_rows = 4096;

// Makes a dataset of the column, without rows.
Hdf5Handle create_dataset(hid_t file, const MeasurementColumn& column) {
  const int rank = column.values > 1 ? 2 : 1;
  const std::array<hsize_t, 2> none{0, column.values}, most{H5S_UNLIMITED, column.values},
      chunk{chunk_rows, column.values};
  const Hdf5Handle space(H5Screate_simple(rank, none.data(), most.data()), H5Sclose);
  const Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  require_hdf5(H5Pset_chunk(properties, rank, chunk.data()) >= 0);
  Hdf5Handle dataset(H5Dcreate2(file, std::string(column.name).c_str(), hdf5_type(column.type), space, H5P_DEFAULT,
                                properties, H5P_DEFAULT),
                     H5Dclose);
  add_column(dataset, "", column);
  return dataset;
}

// The datasets are as in measurement_columns(), n or n x 3, chunked and extensible, with the attributes
// `unit`, `frame` and `meaning`. Keeps at most 4096 rows. After flush() the file is whole. Between flushes, a killed
// program may leave a broken file.
class Hdf5Writer final : public RowOutput {
 public:
  Hdf5Writer(std::string path, bool with_truth, const RowAttributes& attributes)
      : path_(std::move(path)), with_truth_(with_truth), file_(create_hdf5_file(path_, H5F_LIBVER_V18)) {
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
    for (Hdf5Handle& dataset : datasets_) is_good = dataset.close() && is_good;
    is_good = file_.close() && is_good;
    if (!is_good) throw std::runtime_error(path_ + ": cannot write all of it");
  }

 private:
  void write_rows() {
    if (rows_held_ > 0 && !has_failed_) {
      try {
        for (std::size_t i = 0; i < held_.size(); ++i) {
          const MeasurementColumn& column = measurement_columns(with_truth_)[i];
          const Hdf5Handle& dataset = datasets_[i];
          const int rank = column.values > 1 ? 2 : 1;
          const std::array<hsize_t, 2> whole{rows_ + rows_held_, column.values}, begin{rows_, 0},
              size{rows_held_, column.values};
          require_hdf5(H5Dset_extent(dataset, whole.data()) >= 0);
          const Hdf5Handle in_file(H5Dget_space(dataset), H5Sclose);
          require_hdf5(H5Sselect_hyperslab(in_file, H5S_SELECT_SET, begin.data(), nullptr, size.data(), nullptr) >=
                       0);
          const Hdf5Handle in_memory(H5Screate_simple(rank, size.data(), nullptr), H5Sclose);
          require_hdf5(H5Dwrite(dataset, hdf5_type(column.type), in_memory, in_file, H5P_DEFAULT, held_[i].data()) >=
                       0);
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
  Hdf5Handle file_;
  std::vector<Hdf5Handle> datasets_;
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
