// Functions for printed text.
#pragma once

#include <cstddef>
#include <string_view>

namespace imud {

inline bool contains(std::string_view text, std::string_view part) { return text.find(part) != text.npos; }

// Returns how often the part is in the text.
inline std::size_t count(std::string_view text, std::string_view part) {
  std::size_t n = 0;
  for (std::size_t at = text.find(part); at != text.npos; at = text.find(part, at + 1)) ++n;
  return n;
}

}  // namespace imud
