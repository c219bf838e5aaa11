// FileInput: the bytes of a file, a pipe or standard input.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "transports/file/compressed_file.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/port_spec.hpp"

namespace imud {

// read() does not wait for input. A regular file that gzip or zstd has compressed is decompressed. Used by one
// thread.
class FileInput {
 public:
  // Opens the file at the spec's address; - is standard input. Throws PortError.
  explicit FileInput(const PortSpec& spec);

  // Reads the next bytes into `room`, which must not be empty. Returns their number; 0 if there are none now, or
  // if the file has ended.
  std::size_t read(std::span<std::byte> room) noexcept;
  // Returns true once read() will return no more bytes.
  bool at_end() const noexcept { return at_end_; }
  // Describes how the file ended if it is damaged; otherwise empty.
  std::string_view end_warning() const noexcept { return warning_; }

  bool is_regular() const noexcept { return is_regular_; }
  int descriptor() const noexcept { return file_.get(); }
  // Returns how much of a regular file has been read, from 0 to 1; nullopt for others.
  std::optional<double> progress() const noexcept;

 private:
  static constexpr std::size_t most_decompressed = 16 * 1024;  // by one read(), which then takes some 50 us

  FileDescriptor file_;
  bool is_regular_ = false;
  double size_ = 0;                             // bytes; of a regular file only
  std::unique_ptr<CompressedFile> compressed_;  // nullptr: the file is not compressed
  bool at_end_ = false;
  std::string_view warning_;
};

}  // namespace imud
