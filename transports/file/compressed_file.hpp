// CompressedFile: reads a file that gzip or zstd has compressed.
#pragma once

#include <sys/types.h>
#include <unistd.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "transports/file_descriptor.hpp"

namespace imud {

// Used by one thread. After open() no function throws, and memory is allocated only for a zstd frame whose window
// is larger than the first frame's. The checksums of the file are verified: read() reports damage that a checksum
// shows only after it has returned the damaged bytes.
class CompressedFile {
 public:
  // Returns the reader of the file behind `fd` if it is regular and begins as gzip (RFC 1952) or zstd (RFC 8878)
  // files do; otherwise nullptr, and the descriptor's offset is unchanged. `fd` may be closed afterwards.
  static std::unique_ptr<CompressedFile> open(int fd);
  // Returns the path without ".gz" or ".zst".
  static std::string_view without_suffix(std::string_view path) noexcept;

  virtual ~CompressedFile() = default;
  CompressedFile(const CompressedFile&) = delete;
  CompressedFile& operator=(const CompressedFile&) = delete;

  // Decompresses the next bytes into `room`, which must not be empty. Returns their number; 0 at the end of an
  // undamaged file; -1 if the file is damaged or cannot be read.
  ssize_t read(std::span<std::byte> room) noexcept;
  // Returns the number of compressed bytes that were read from the file; -1 if this number is not known.
  off_t offset() const noexcept { return ::lseek(file_.get(), 0, SEEK_CUR); }
  // Describes why read() has returned -1: "cut short", "incorrect data check"; otherwise empty.
  std::string_view error() const noexcept { return error_; }

 protected:
  explicit CompressedFile(FileDescriptor file) : file_(std::move(file)) {}

  // The bytes of the file that were read, but not decompressed yet.
  std::span<std::byte> input() noexcept { return std::span(buffer_).subspan(begin_, end_ - begin_); }
  void consume(std::size_t size) noexcept { begin_ += size; }
  void fail(std::string_view error) noexcept { error_ = error; }

  // A compressed file is a sequence of members. False from the beginning of a member to its end.
  bool is_between_members_ = true;

 private:
  // Decompresses input(), which may be empty, into `room`; returns how many bytes it made.
  virtual std::size_t decompress(std::span<std::byte> room) noexcept = 0;
  ssize_t decompress_next(std::span<std::byte> room) noexcept;

  FileDescriptor file_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(64 * 1024);
  std::size_t begin_ = 0, end_ = 0;
  std::string_view error_;
  // open() decompresses these bytes, so that the library allocates its memory then. `ahead_` is the part of them
  // that read() has not returned yet.
  std::vector<std::byte> first_;
  std::span<const std::byte> ahead_;
};

}  // namespace imud
