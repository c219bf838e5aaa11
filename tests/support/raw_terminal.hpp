// A client of a pty: opens it without a line discipline's changes, and reads what has arrived.
#pragma once

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <string>

#include "transports/file_descriptor.hpp"

namespace imud {

// Returns an invalid descriptor if the terminal cannot be opened.
inline FileDescriptor open_raw_terminal(const std::string& path) {
  FileDescriptor terminal(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios settings{};
  ::tcgetattr(terminal.get(), &settings);
  ::cfmakeraw(&settings);
  ::tcsetattr(terminal.get(), TCSANOW, &settings);
  return terminal;
}

// Appends what has arrived to `bytes`.
inline void read_all(const FileDescriptor& terminal, std::string& bytes) {
  std::array<char, 4096> buffer;
  for (ssize_t size = 1; size > 0;) {
    size = ::read(terminal.get(), buffer.data(), buffer.size());
    if (size > 0) bytes.append(buffer.data(), static_cast<std::size_t>(size));
  }
}

}  // namespace imud
