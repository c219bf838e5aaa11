// Service Mode of the STIM300, its menu for people (section 9). Answers are those of the datasheet's figures, with
// hyphens for its dashes, and ISO 8859-1 for the signs of degree and plus-minus, which the ASCII it speaks of does
// not have.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "core/frame.hpp"
#include "core/vector.hpp"
#include "protocols/line_assembler.hpp"
#include "protocols/stim300/stim300.hpp"

namespace imud::stim300 {

class Service {
 public:
  enum class Exit { none, to_normal, to_init };

  void enter(const Memory& memory, FrameBuffer& replies) noexcept;
  // Executes what the host typed at `now`, at most up to an exit; how many characters that was. Appends their echo
  // and the answers; what many lines at once are answered beyond the room of `replies` is lost. A line longer than
  // the input buffer is forgotten, as is one that was left half typed for a minute.
  std::size_t take(std::span<const std::byte> typed, DeviceTime now, Memory& memory,
                   const std::array<Axes, 3>& measured, const Reading& reading, FrameBuffer& replies) noexcept;
  // The mode that follows Service Mode, from leaves_at() on; none as long as nobody asked for one.
  Exit exit() const noexcept { return exit_; }
  DeviceTime leaves_at() const noexcept { return leaves_at_; }
  // Device::step_clock().
  void step_clock(Nanoseconds by) noexcept {
    typed_at_ = typed_at_ + by;
    leaves_at_ = leaves_at_ + by;
  }

 private:
  static constexpr Nanoseconds hold_time = std::chrono::seconds(3);       // Table 9-54
  static constexpr Nanoseconds typing_timeout = std::chrono::minutes(1);  // the datasheet gives none

  // What a "Y" is waited for to confirm.
  enum class Question {
    none,
    save,
    exit_to_normal,
    exit_to_init,
    factory,
    factory_line,
    factory_and_save,
    factory_line_and_save
  };

  class Menu;

  LineAssembler<80> line_{"\r"};
  Question question_ = Question::none;
  Exit exit_ = Exit::none;
  DeviceTime typed_at_, leaves_at_;  // typed_at_: the last character
};

// What command ? says of a command, in lines that end with CR; of all for '?'. Empty if there is no such command.
std::string_view help(char command) noexcept;

}  // namespace imud::stim300
