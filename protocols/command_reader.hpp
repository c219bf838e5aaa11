// CommandReader: puts together the lines of text that a host sends.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "core/time.hpp"

namespace imud {

// A line ends with CR or LF and is at most `Max` characters long; a longer one is left out. What has not grown for
// `patience` was cut off and is forgotten when more comes.
template <std::size_t Max>
class CommandReader {
 public:
  static constexpr Nanoseconds patience = std::chrono::seconds(1);

  // `now`: any clock that the device has. `act(std::string_view)` is given each line, without its end; no empty ones.
  // `leave_out()` is called at the end of one that is too long.
  template <class Act, class LeaveOut>
  void feed(std::span<const std::byte> bytes, DeviceTime now, Act&& act, LeaveOut&& leave_out) {
    if (now - last_ > patience) size_ = 0;
    last_ = now;
    for (const std::byte byte : bytes) {
      const char c = static_cast<char>(byte);
      if (c != '\r' && c != '\n') {
        if (size_ < Max) line_[size_] = c;
        if (size_ <= Max) ++size_;
        continue;
      }
      const std::size_t size = size_;
      size_ = 0;
      if (size > Max)
        leave_out();
      else if (size > 0)
        act(std::string_view(line_.data(), size));
    }
  }
  template <class Act>
  void feed(std::span<const std::byte> bytes, DeviceTime now, Act&& act) {
    feed(bytes, now, act, [] {});
  }

 private:
  std::array<char, Max> line_;
  std::size_t size_ = 0;  // Max + 1: too long
  DeviceTime last_;
};

}  // namespace imud
