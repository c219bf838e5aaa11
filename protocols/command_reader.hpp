// CommandReader: assembles the lines of text that a host sends.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "core/time.hpp"
#include "protocols/line_assembler.hpp"

namespace imud {

// A line ends with CR or LF and is at most `Max` characters long; a longer one is left out. A line that has not grown
// for `patience` was cut off: it is dropped when more bytes arrive.
template <std::size_t Max>
class CommandReader {
 public:
  static constexpr Nanoseconds patience = std::chrono::seconds(1);

  // `now`: any clock that the device has. `act(std::string_view)` is given each line, without its end; no empty ones.
  // `leave_out()` is called at the end of one that is too long.
  template <class Act, class LeaveOut>
  void feed(std::span<const std::byte> bytes, DeviceTime now, Act&& act, LeaveOut&& leave_out) {
    if (now - last_ > patience) lines_.drop_line();
    last_ = now;
    lines_.feed({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    while (const auto line = lines_.next()) {
      if (line->is_too_long())
        leave_out();
      else if (line->size > 0)
        act(line->text);
    }
  }
  template <class Act>
  void feed(std::span<const std::byte> bytes, DeviceTime now, Act&& act) {
    feed(bytes, now, act, [] {});
  }
  // Device::step_clock().
  void step_clock(Nanoseconds by) noexcept { last_ = last_ + by; }

 private:
  LineAssembler<Max> lines_{"\r\n"};
  DeviceTime last_;
};

}  // namespace imud
