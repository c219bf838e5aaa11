// NpyWriter: writes measurements as a structured array that numpy.load(FILE, mmap_mode="r") maps (numpy.lib.format,
// version 1).
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "protocols/measurements/npy_file.hpp"
#include "tools/arrays/row_output.hpp"
#include "transports/file/output_path.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {
namespace {

constexpr std::size_t hold_at_most = 64 * 1024;

// Keeps at most 64 KiB of rows. The header has room for any number of rows. The rows are written before their number,
// so that the file is a whole array at any time, also if the program is killed.
class NpyWriter final : public RowOutput {
 public:
  NpyWriter(std::string path, bool with_truth) : path_(std::move(path)), with_truth_(with_truth) {
    if (const std::string fault = foreign_link_fault(path_); !fault.empty()) throw std::runtime_error(fault);
    file_.reset(::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666));
    struct stat status {};
    if (!file_ || ::fstat(file_.get(), &status) != 0)
      throw std::runtime_error(fmt::format("{}: cannot write it: {}", path_, std::strerror(errno)));
    if (!S_ISREG(status.st_mode))
      throw std::runtime_error(path_ +
                               ": the number of rows, known at the end, stands at the begin of an array; give "
                               "a regular file");
    if (::ftruncate(file_.get(), 0) != 0)
      throw std::runtime_error(fmt::format("{}: cannot write it: {}", path_, std::strerror(errno)));
    held_.reserve(hold_at_most + row_size(with_truth));
    flush();
  }

  void write(const MeasurementRow& row) override {
    const std::size_t begin = held_.size(), size = row_size(with_truth_);
    held_.resize(begin + size);
    std::memcpy(held_.data() + begin, &row, size);
    if (held_.size() >= hold_at_most) flush();
  }
  void flush() override {
    const std::size_t size = row_size(with_truth_);
    if (error_ == 0)
      error_ = write_whole_at(file_.get(), std::as_bytes(std::span(held_)), header().size() + rows_ * size);
    if (error_ == 0) rows_ += held_.size() / size;
    held_.clear();
    const std::string text = header();
    if (error_ == 0) error_ = write_whole_at(file_.get(), std::as_bytes(std::span(text)), 0);
  }
  void finish() override {
    flush();
    if (error_ != 0) throw std::runtime_error(fmt::format("{}: {}", path_, std::strerror(error_)));
  }

 private:
  std::string header() const { return npy_header(measurement_columns(with_truth_), {&rows_, 1}); }

  const std::string path_;
  const bool with_truth_;
  FileDescriptor file_;
  std::vector<char> held_;
  std::uint64_t rows_ = 0;  // in the file
  int error_ = 0;
};

}  // namespace

extern constexpr RowFormat npy_row_format = {
    .name = "npy",
    .help = "also writes a structured array, for numpy.load(FILE, mmap_mode=\"r\")",
    .keeps_attributes = false,
    .needs_time = false,
    .make = make_writer<NpyWriter>};

}  // namespace imud
