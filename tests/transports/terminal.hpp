// The client's end of a pty, or a serial device that a test plugs in and unplugs.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/transports/numbered_frames.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// Opens a client's end as a serial driver does.
inline FileDescriptor open_terminal(const std::string& path) {
  FileDescriptor fd(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!fd) throw std::runtime_error("cannot open " + path);
  return fd;
}

// Returns the next bytes, at most `most`; empty if none arrive within `timeout_ms`. A pty delivers bytes with a short
// delay.
inline std::vector<std::byte> read_some(int fd, std::size_t most = 65536, int timeout_ms = 100) {
  pollfd ready{fd, POLLIN, 0};
  if (::poll(&ready, 1, timeout_ms) <= 0) return {};
  std::vector<std::byte> bytes(most);
  const ssize_t size = ::read(fd, bytes.data(), bytes.size());
  bytes.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return bytes;
}

// Reads until nothing more arrives.
inline void drain(int fd, NumberedReader& reader) {
  for (auto bytes = read_some(fd); !bytes.empty(); bytes = read_some(fd)) reader.feed(bytes);
}

// A serial device behind a link: a pty whose master the test holds.
class SerialDevice {
 public:
  explicit SerialDevice(std::string link) : link_(std::move(link)) { plug_in(); }

  void plug_in() {
    master_.reset(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!master_ || ::grantpt(master_.get()) != 0 || ::unlockpt(master_.get()) != 0)
      throw std::runtime_error("no pty to be had");
    char slave[64];
    ::ptsname_r(master_.get(), slave, sizeof slave);
    std::filesystem::create_symlink(slave, link_);
  }
  void unplug() {
    std::filesystem::remove(link_);
    master_.reset();
  }
  int fd() const { return master_.get(); }
  // Returns the settings of the line as the port has made them.
  termios line() const {
    termios settings{};
    ::tcgetattr(master_.get(), &settings);
    return settings;
  }

 private:
  std::string link_;
  FileDescriptor master_;
};

}  // namespace imud
