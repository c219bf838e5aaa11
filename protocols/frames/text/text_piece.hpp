// TextPiece: a piece of a message's text (README.md): literal text, a number, a check, or a label.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocols/frames/layout/frame_check.hpp"
#include "protocols/frames/layout/frame_element.hpp"
#include "protocols/frames/text/text_format.hpp"

namespace imud {

struct TextPiece {
  static constexpr std::size_t most_ranges = 8;

  enum class Kind : std::uint8_t { literal, label, field, check };
  Kind kind = Kind::literal;
  std::string text;  // of a literal: its characters; of other kinds: the text in the braces

  FrameSource source{};        // of a field
  TextFormat format{};         // of a field
  double lsb = 1, offset = 0;  // of a field, in its unit
  std::string label{};         // without the @
  std::optional<FrameCheck> check{};
  bool is_lower = false;                      // digits of a check
  std::vector<FrameElement::Range> ranges{};  // of a check; empty: after the first character, up to the '*' before it
  // The ranges by pieces. A range begins `plus` characters behind the begin of piece `from`, and ends `less`
  // characters before the begin of piece `to`.
  struct Extent {
    std::size_t from = 0, to = 0, plus = 0, less = 0;
  };
  std::vector<Extent> extents{};

  std::size_t longest() const noexcept;  // characters
  // Returns the number of characters of a field that is not left out; 0 if the number is not constant.
  std::size_t fixed_size() const noexcept;
  std::uint64_t period() const noexcept;  // number of values of a clock or counter; 0: 2^64
};

// Returns the pieces of a text. {{ and }} stand for braces. Throws std::invalid_argument with the fault and the
// remedy.
std::vector<TextPiece> parse_text_pieces(std::string_view text, std::span<const FrameDescription::Check> own);

}  // namespace imud
