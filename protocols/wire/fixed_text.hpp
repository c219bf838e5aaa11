// The text of a number with a given number of decimals.
#pragma once

#include <charconv>

namespace imud {

// Same output and result as std::to_chars(at, end, number, std::chars_format::fixed, decimals), with a third of
// the instructions for a number below 1e9 with at most 9 decimals.
std::to_chars_result write_fixed(char* at, char* end, double number, int decimals) noexcept;

}  // namespace imud
