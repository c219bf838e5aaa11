// TextOutput: buffered text to a file or to standard output. A reader that leaves is no error.
#pragma once

#include <string>
#include <string_view>

#include "transports/file_descriptor.hpp"

namespace imud {

class TextOutput {
 public:
  // "-" is standard output. Throws std::runtime_error, which names the file and the cause.
  explicit TextOutput(const std::string& path);

  void write(std::string_view text);
  // Writes the buffer out. Waits for the reader, but for a second at most after stop_wished().
  void flush();

  // Returns false after the reader has left or the disk is full: nothing more is written.
  bool is_open() const noexcept { return error_ == 0; }
  // Returns the errno that ended the output: EPIPE if the reader has left, 0 while the output is open.
  int error() const noexcept { return error_; }

 private:
  bool is_writable() const noexcept;

  FileDescriptor file_;
  std::string held_;
  int error_ = 0;
};

}  // namespace imud
