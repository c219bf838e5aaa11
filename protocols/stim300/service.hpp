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
  // Takes what the host typed, at most up to an exit; how many characters that was. Appends their echo and the
  // answers; what many lines at once are answered beyond the room of `replies` is lost. A line longer than the input
  // buffer is forgotten, as is one that nobody goes on typing.
  std::size_t take(std::span<const std::byte> typed, Memory& memory, const std::array<Axes, 3>& measured,
                   const Reading& reading, FrameBuffer& replies) noexcept;
  // Whether Service Mode is to be left, and for what; after its hold time, which goes by in internal samples.
  Exit exit() const noexcept { return hold_ == 0 ? exit_ : Exit::none; }
  void pass_sample() noexcept {
    if (hold_ > 0) --hold_;
    if (line_.size() > 0 && ++idle_ == patience_samples) line_.drop_line();
  }

 private:
  static constexpr unsigned hold_samples = 6000;        // 3 s (Table 9-54)
  static constexpr unsigned patience_samples = 120000;  // 60 s: people type (the datasheet says nothing)

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
  unsigned idle_ = 0;  // internal samples since the last character
  Question question_ = Question::none;
  Exit exit_ = Exit::none;
  unsigned hold_ = 0;  // internal samples
};

// What command ? says of a command, in lines that end with CR; of all for '?'. Empty if there is no such command.
std::string_view help(char command) noexcept;

}  // namespace imud::stim300
