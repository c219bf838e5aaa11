// Bytes from hexadecimal text.
#pragma once

#include <charconv>
#include <cstddef>
#include <string_view>
#include <vector>

namespace imud {

// Two digits a byte; blanks and line feeds between bytes are ignored.
inline std::vector<std::byte> hex_bytes(std::string_view text) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < text.size();) {
    if (text[i] == ' ' || text[i] == '\n') {
      ++i;
      continue;
    }
    unsigned byte = 0;
    std::from_chars(text.data() + i, text.data() + i + 2, byte, 16);
    bytes.push_back(static_cast<std::byte>(byte));
    i += 2;
  }
  return bytes;
}

}  // namespace imud
