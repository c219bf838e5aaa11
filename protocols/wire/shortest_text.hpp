// The shortest text of a number.
#pragma once

#include <string>

namespace imud {

// The most characters that write_shortest() writes: "-2.2250738585072014e-308".
inline constexpr int longest_shortest_text = 24;

// Writes the shortest decimal text that is read as exactly `number` again, fixed or scientific, whichever is shorter:
// the characters that std::to_chars() writes, in less than half of its time (fmt's Dragonbox finds the digits). There
// is room for longest_shortest_text characters. Returns their end.
char* write_shortest(char* at, double number) noexcept;
// Returns that text.
std::string shortest_text(double number);

// No double needs more significant digits to be read as itself again.
inline constexpr int all_digits = 17;

// As write_shortest(), but a number that needs more than `digits` significant digits, 1 to all_digits, is rounded to
// so many: the nearest of its exact value, as by printf, without zeros at its end.
char* write_rounded(char* at, double number, int digits) noexcept;

}  // namespace imud
