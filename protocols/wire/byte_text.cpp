#include "protocols/wire/byte_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace imud {

std::string hex_text(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes)
    fmt::format_to(std::back_inserter(text), "{}{:02X}", text.empty() ? "" : " ", std::to_integer<unsigned>(byte));
  return text;
}

std::string short_hex_text(std::span<const std::byte> bytes) {
  constexpr std::size_t most = 16;
  return hex_text(bytes.first(std::min(bytes.size(), most))) + (bytes.size() > most ? " ..." : "");
}

std::optional<std::vector<std::byte>> hex_bytes_in(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                  : -1;
  };
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i < text.size();) {
    if (text[i] == ' ' || text[i] == '\t' || text[i] == '\n' || text[i] == '\r') {
      ++i;
      continue;
    }
    if (i + 1 == text.size() || digit(text[i]) < 0 || digit(text[i + 1]) < 0) return std::nullopt;
    bytes.push_back(static_cast<std::byte>(16 * digit(text[i]) + digit(text[i + 1])));
    i += 2;
  }
  return bytes;
}

std::string visible_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\r')
      out += "\\r";
    else if (c == '\n')
      out += "\\n";
    else if (c == '\t')
      out += "\\t";
    else
      out += c;
  }
  return out;
}

}  // namespace imud
