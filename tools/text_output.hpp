// TextOutput: writes buffered text to a file or to standard output. A closed pipe is no error.
#pragma once

#include <string>
#include <string_view>

#include "transports/file_descriptor.hpp"

namespace imud {

class TextOutput {
 public:
  // Opens `path`; "-" is standard output. Throws std::runtime_error, which names the file and the cause.
  explicit TextOutput(const std::string& path);

  // Appends to the buffer, and flushes a full buffer.
  void write(std::string_view text);
  // Writes the buffer out. Waits for a slow reader; after stop_requested() for a second at most.
  void flush();

  // Returns true if people read the output while it is written.
  bool is_terminal() const noexcept;
  // Returns false after the reader has closed its end, or a write has failed. Nothing more is written then.
  bool is_open() const noexcept { return error_ == 0; }
  // Returns the errno that ended the output: EPIPE if the reader has closed its end, 0 while the output is open.
  int error() const noexcept { return error_; }

 private:
  bool is_writable() const noexcept;

  FileDescriptor file_;
  std::string held_;
  int error_ = 0;
};

// Writes the whole text to a file, or to standard output ("-"). Throws std::runtime_error, which names the file and
// the cause.
void write_file(const std::string& path, std::string_view text);

// Returns the text with a blank in the place of each control character, for a comment's line.
std::string on_one_line(std::string text);

}  // namespace imud
