// CAN frames as text, as candump -L writes them: "18EAFF00#00EE00", "123#R", "123##1AABB". Blanks separate several
// frames.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

#include "core/frame.hpp"

namespace imud {

// Calls `call` with each frame of any text. A character that is no hexadecimal digit counts as some digit, and
// surplus digits are cut off. Allocates nothing.
template <class Call>
void each_frame(std::string_view text, Call&& call) {
  const auto digit = [](char c) {
    const auto code = static_cast<unsigned char>(c);
    return (std::isalpha(code) != 0 ? code + 9U : code) & 15U;
  };
  for (std::size_t begin = 0; begin < text.size();) {
    const std::string_view one = text.substr(begin, text.find(' ', begin) - begin);
    begin += one.size() + 1;
    const std::size_t hash = one.find('#');
    if (hash == std::string_view::npos) continue;
    CanHeader can;
    for (const char c : one.substr(0, hash)) can.id = can.id << 4 | digit(c);
    can.extended = hash > 3;
    can.id &= can.extended ? 0x1FFF'FFFFU : 0x7FFU;
    std::string_view digits = one.substr(hash + 1);
    can.remote = digits.starts_with('R');
    can.fd = digits.starts_with('#');
    if (can.fd) {
      can.bit_rate_switch = digits.size() > 1 && (digit(digits[1]) & 1U) != 0;
      digits.remove_prefix(std::min<std::size_t>(2, digits.size()));
    }
    std::array<std::byte, 64> data;
    const std::size_t size = can.remote ? 0 : std::min<std::size_t>(digits.size() / 2, can.fd ? 64 : 8);
    for (std::size_t i = 0; i < size; ++i)
      data[i] = static_cast<std::byte>(digit(digits[2 * i]) << 4 | digit(digits[2 * i + 1]));
    call(Frame{std::span(data).first(size), can});
  }
}

inline std::string can_text(const Frame& frame) {
  char text[16];
  std::snprintf(text, sizeof text, frame.can.extended ? "%08X#" : "%03X#", frame.can.id);
  std::string line = text;
  if (frame.can.remote) line += 'R';
  if (frame.can.fd) line += frame.can.bit_rate_switch ? "#1" : "#0";
  for (const std::byte byte : frame.bytes) {
    std::snprintf(text, sizeof text, "%02X", std::to_integer<unsigned>(byte));
    line += text;
  }
  return line;
}

}  // namespace imud
