// ArrayFile: an array of NumPy that replaces the old array when the new one is complete.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "protocols/measurements/npy_file.hpp"
#include "transports/file/file_replacement.hpp"

namespace imud {

// The array is written to FILE.incomplete, which numpy.load reads, too, and commit() renames it to FILE: an old FILE
// stays as it is until then. While it is incomplete, a trailer behind the rows has a text, which states the array's
// origin, and a mark for each finished part of the array, so that another process can write the other parts. Rows are
// written in any order, also by processes that have inherited the file.
class ArrayFile {
 public:
  // Throws OpenError, which names the file and the cause.
  ArrayFile(std::string path, std::span<const MeasurementColumn> columns);

  // Sets the shape: the file has that many rows then, of zeros where none is written. `parts` equal parts can be
  // marked. If FILE.incomplete was left behind with this `text` and with marks, marks and rows stay.
  // Returns the text of another array that was left behind, which stays as it is; otherwise an empty one.
  std::string begin(std::span<const std::uint64_t> shape, std::size_t row_size, std::string_view text,
                    std::uint64_t parts);
  // Writes bytes at an offset from the first row. After an error, such as a full disk, nothing is written any more.
  void write(std::span<const std::byte> bytes, std::uint64_t offset) noexcept;
  // Throws std::runtime_error, which names the file and the cause, if this process could not write all of it.
  void check() const;

  bool is_done(std::uint64_t part) const noexcept { return marks_[part] != 0; }
  void mark(std::uint64_t part) noexcept;

  // Makes each row of the parts without a mark a copy of `row`, and leaves FILE.incomplete behind.
  void keep(std::span<const std::byte> row) noexcept;
  // Ends the array, which takes the place of FILE. Throws std::runtime_error.
  void commit();
  // FILE.incomplete.
  std::string incomplete_path() const;

 private:
  void write_at(std::span<const std::byte> bytes, std::uint64_t offset) noexcept;
  std::string read_trailer();
  std::uint64_t first_row() const { return npy_header(columns_, {}).size(); }
  std::uint64_t marks_at() const noexcept { return end_ + trailer_size_ - marks_.size() - locator_size; }

  static constexpr std::size_t locator_size = 16;  // at the end of the file: a magic number, and where the trailer is

  const std::string path_;
  const std::span<const MeasurementColumn> columns_;
  std::unique_ptr<FileReplacement> file_;
  std::uint64_t end_ = 0;  // of the rows
  std::uint64_t trailer_size_ = 0;
  std::vector<char> marks_;  // of the parts
  int error_ = 0;
};

}  // namespace imud
