#include "emulator/plan/host_bytes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <optional>

namespace imud {

namespace {

constexpr std::size_t longest = 256;

// Returns nothing if the text is not hexadecimal.
std::optional<HostBytes> bytes_of_hex(std::string text) {
  std::erase(text, ' ');
  if (text.empty() || text.size() % 2 != 0) return std::nullopt;
  HostBytes bytes;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const auto digit = [&](char c) -> int {
      return std::isdigit(static_cast<unsigned char>(c)) != 0 ? c - '0'
             : c >= 'a' && c <= 'f'                           ? c - 'a' + 10
             : c >= 'A' && c <= 'F'                           ? c - 'A' + 10
                                                              : -1;
    };
    const int high = digit(text[i]), low = digit(text[i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    bytes.push_back(static_cast<std::byte>(16 * high + low));
  }
  return bytes;
}

}  // namespace

HostBytes read_host_bytes(TableReader& table) {
  HostBytes bytes;
  if (table.has("text") && table.has("hex")) table.fault("hex", "give either text or hex");
  if (table.has("text"))
    for (const char c : table.text("text", "")) bytes.push_back(static_cast<std::byte>(c));
  if (table.has("hex")) {
    const auto read = bytes_of_hex(table.text("hex", "00"));
    if (!read) table.fault("hex", "give bytes as hexadecimal digits, such as \"fa 05\"");
    bytes = read.value_or(HostBytes{});
  }
  if (bytes.size() > longest) table.fault("text", fmt::format("give at most {} bytes", longest));
  return bytes;
}

std::string text_of(const HostBytes& bytes) {
  if (bytes.empty()) return "bytes";
  const bool is_text = std::all_of(bytes.begin(), bytes.end(),
                                   [](std::byte b) { return std::isprint(std::to_integer<unsigned char>(b)) != 0; });
  std::string text;
  for (const std::byte b : bytes)
    text += is_text ? std::string(1, std::to_integer<char>(b)) : fmt::format("{:02x} ", std::to_integer<int>(b));
  if (!is_text) text.pop_back();
  return is_text ? fmt::format("\"{}\"", text) : text;
}

bool HostBytesSearch::take(const HostBytes& wanted, std::byte byte) noexcept {
  if (wanted.empty()) return true;
  // Falls back to the longest begin of the bytes that ends with this one.
  while (matched_ > 0 && wanted[matched_] != byte) {
    std::size_t shorter = matched_ - 1;
    while (shorter > 0 && std::memcmp(wanted.data(), wanted.data() + matched_ - shorter, shorter) != 0) --shorter;
    matched_ = shorter;
  }
  if (wanted[matched_] == byte) ++matched_;
  if (matched_ < wanted.size()) return false;
  matched_ = 0;
  return true;
}

}  // namespace imud
