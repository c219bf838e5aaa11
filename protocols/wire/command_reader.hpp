// CommandReader: assembles the lines of text that a host sends.
#pragma once

#include <cstddef>
#include <span>

#include "core/time.hpp"
#include "protocols/wire/line_assembler.hpp"

namespace imud {

// A line ends with CR or LF and has at most `Max` characters; a longer one is discarded whole. An unfinished line
// that receives no byte for `timeout` is discarded when the next byte arrives; a reader therefore needs no deadline.
// Allocates nothing. One thread.
template <std::size_t Max>
class CommandReader {
 public:
  static constexpr Nanoseconds timeout = std::chrono::seconds(1);

  // Calls `act(std::string_view)` with each line that is not empty, without the line end, and `overflow()` at the
  // end of each line that is too long. Requires a `now` that never decreases, except by step_clock().
  template <class Act, class Overflow>
  void feed(std::span<const std::byte> bytes, DeviceTime now, Act&& act, Overflow&& overflow) {
    if (now - last_ > timeout) lines_.drop_line();
    last_ = now;
    lines_.feed({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    while (const auto line = lines_.next()) {
      if (line->is_too_long())
        overflow();
      else if (line->size > 0)
        act(line->text);
    }
  }
  template <class Act>
  void feed(std::span<const std::byte> bytes, DeviceTime now, Act&& act) {
    feed(bytes, now, act, [] {});
  }

  // Discards an unfinished line.
  void clear() noexcept { lines_.drop_line(); }
  void step_clock(Nanoseconds by) noexcept { last_ = last_ + by; }

 private:
  LineAssembler<Max> lines_{"\r\n"};
  DeviceTime last_;  // of the newest byte
};

}  // namespace imud
