// What tests ask of printed text.
#pragma once

#include <string_view>

namespace imud {

inline bool contains(std::string_view text, std::string_view part) { return text.find(part) != text.npos; }

}  // namespace imud
