// The parts of the elements of layouts and texts. Private to the parsers of elements. All functions throw
// std::invalid_argument with the fault and the remedy.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "protocols/frames/layout/frame_element.hpp"

namespace imud {

std::string in_quotes(std::string_view text);

// Calls `take` with each part of the text between separators.
template <class Take>
void each_part(std::string_view text, char separator, Take take) {
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    take(text.substr(begin, end - begin));
    begin = end + 1;
  }
}

// Reads NAME or NAME%MODULUS.
FrameSource source_in(std::string_view text);
// Returns true for a counter or a status. Frames carry the low bits of such a source; its modulus is an integer,
// and it has no LSB.
bool is_counting(const FrameSource& source);
void check_modulus(const FrameSource& source);

// Reads [*LSB][+OFFSET] at the beginning of `text`, and removes these characters. Returns the LSB, 1 if absent,
// and the offset.
std::pair<double, double> take_scale(std::string_view& text);

// Removes the condition of an optional element from `text`, and returns the condition without its "?"; empty if
// there is no condition.
std::string_view take_condition(std::string_view& text) noexcept;

// Reads a range that begins at label FROM. "@FROM..@TO" ends at label TO, "@FROM..@" at the end of the frame, and
// "@FROM.." at the check itself. Refuses any other text (refuse_element()).
FrameElement::Range range_in(std::string_view text);
// Returns the label in "@LABEL".
std::string label_in(std::string_view text);

// Returns the check named `name`.
FrameCheck check_named(std::string_view name, std::span<const FrameDescription::Check> own);

}  // namespace imud
