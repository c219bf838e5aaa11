#include "emulator/plan/host_bytes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>

namespace imud {

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
  // Falls back to the longest beginning of `wanted` that the bytes so far, with this one, end with.
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
