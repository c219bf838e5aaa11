// Conversions between bytes and readable text.
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
// Returns hex_text() of the first 16 bytes, followed by " ..." if there are more bytes.
std::string short_hex_text(std::span<const std::byte> bytes);
// Parses pairs of hexadecimal digits; blanks between pairs are allowed. Returns nullopt for any other text.
std::optional<std::vector<std::byte>> hex_bytes_in(std::string_view text);
// Returns `text` with line ends and tabs as TOML escape sequences.
std::string visible_text(std::string_view text);

}  // namespace imud
