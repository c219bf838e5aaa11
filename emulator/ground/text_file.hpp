// TextFile: a file or standard stream for text, whose failures are reported; and the reading of a whole file.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

#include "transports/file_descriptor.hpp"

namespace imud {

// A file that cannot be opened; the text names the file and the cause.
struct OpenError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class TextFile {
 public:
  TextFile() = default;  // writes nothing
  // Opens `path`, whose content stays until replace(), and locks a regular file until it is closed. "-" is standard
  // output; "": no output. Throws OpenError, also if another process has locked the file.
  explicit TextFile(const std::string& path);
  static TextFile standard_error();

  bool is_open() const noexcept { return static_cast<bool>(file_); }
  // Writes all of it, and waits for a slow reader. A reader that has closed its end is no error. Throws
  // std::runtime_error, which names the file and the cause.
  void write(std::string_view text);
  // Writes text at the end of a regular file: all of it, or, after an error, nothing, so that what follows does not
  // continue a line that was cut. Writes to anything else as write() does. Throws as write() does.
  void append(std::string_view text);
  // Returns false if write() would wait for the reader of a pipe. If true, a text of up to 4096 bytes (PIPE_BUF) does
  // not wait.
  bool has_room() const noexcept;
  // Returns false for a stream and a device, whose received text cannot be replaced.
  bool is_regular() const noexcept;
  // Replaces the content of a regular file, which is never empty meanwhile; writes to anything else as write() does.
  void replace(std::string_view text);
  // Opens the file again; creates it if it was renamed or removed. Its content stays. Throws OpenError. Standard
  // streams stay as they are.
  void reopen();

 private:
  std::string path_;
  FileDescriptor file_;
};

inline constexpr std::size_t most_read = 64'000'000;  // bytes; ephemerides of a day from all stations have some 10 MB

// Returns the content of a file. Throws std::system_error with the cause if it cannot be read, as a folder and a file
// of more than `most_read` bytes, so that a device without an end does not fill the memory.
std::string read_whole(const std::string& path);

}  // namespace imud
