// Bytes as people read them.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace imud {

// Returns pairs of hexadecimal digits with blanks between them: "AA 55 01".
std::string hex_text(std::span<const std::byte> bytes);
// Returns the same of the first 16 bytes, and " ..." if there are more.
std::string short_hex_text(std::span<const std::byte> bytes);
// Parses pairs of hexadecimal digits, between which blanks may be; nullopt if the text is something else.
std::optional<std::vector<std::byte>> hex_bytes_in(std::string_view text);
// Returns the characters; line ends and tabs are written as in TOML.
std::string visible_text(std::string_view text);

}  // namespace imud
