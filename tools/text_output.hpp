// TextOutput: buffered text to a file or to standard output, that ends well when its reader leaves.
#pragma once

#include <string>
#include <string_view>

#include "transports/file_descriptor.hpp"

namespace imud {

class TextOutput {
 public:
  // "-" is standard output. Throws std::runtime_error that says what failed on what.
  explicit TextOutput(const std::string& path);

  void write(std::string_view text);
  // Pushes out what is held back. Waits for the reader, but no longer than a second once stop_wished().
  void flush();

  // False once the reader is gone or the disk is full: nothing is written any more.
  bool is_open() const noexcept { return error_ == 0; }
  // The errno that closed it; 0 while it is open, and EPIPE for a reader that left.
  int error() const noexcept { return error_; }

 private:
  bool is_writable() const noexcept;

  FileDescriptor file_;
  std::string held_;
  int error_ = 0;
};

}  // namespace imud
