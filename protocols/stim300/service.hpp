// Service Mode of the STIM300, a menu for people (section 9). Answers are as in the datasheet's figures, with hyphens
// instead of dashes. The datasheet specifies ASCII, which has no degree sign and no plus-minus sign: both are sent in
// ISO 8859-1.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "core/frame.hpp"
#include "protocols/stim300/stim300.hpp"
#include "protocols/wire/line_assembler.hpp"

namespace imud::stim300 {

class Service {
 public:
  enum class Exit { none, to_normal, to_init };

  // Enters Service Mode. Appends the list of the configuration, and the prompt, to `replies`.
  void enter(const Memory& memory, FrameBuffer& replies) noexcept;
  // Processes the host's input at `now`, up to a command that exits Service Mode. Returns how many characters were
  // processed. Appends their echo and the answers to `replies`; an answer that does not fit is lost. A line longer
  // than the input buffer is discarded, and so is an unfinished line after a minute without input.
  std::size_t receive(std::span<const std::byte> typed, DeviceTime now, Memory& memory,
                      const std::array<Axes, 3>& measured, const Reading& reading, FrameBuffer& replies) noexcept;
  // Returns the mode that follows Service Mode at leaves_at(); Exit::none if no exit was requested.
  Exit exit() const noexcept { return exit_; }
  DeviceTime leaves_at() const noexcept { return leaves_at_; }
  // See Device::step_clock().
  void step_clock(Nanoseconds by) noexcept {
    typed_at_ = typed_at_ + by;
    leaves_at_ = leaves_at_ + by;
  }

 private:
  static constexpr Nanoseconds hold_time = std::chrono::seconds(3);       // Table 9-54
  static constexpr Nanoseconds typing_timeout = std::chrono::minutes(1);  // the datasheet gives none

  // The action that waits for the confirmation "Y".
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
  DeviceTime typed_at_, leaves_at_;  // typed_at_: time of the last character
};

// Returns the help text of a command, in lines that end with CR; for '?' the list of all commands. Empty if there is
// no such command.
std::string_view help(char command) noexcept;

}  // namespace imud::stim300
