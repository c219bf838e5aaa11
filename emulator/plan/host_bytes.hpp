// Bytes that a host sends, for faults and expectations.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace imud {

// Bytes that a host sends; empty: any.
using HostBytes = std::vector<std::byte>;

// Returns a description of the bytes for people; "bytes" if the argument is empty.
std::string text_of(const HostBytes& bytes);

// Finds wanted bytes in the bytes of a host, which come in pieces of any length.
class HostBytesSearch {
 public:
  // Takes the next byte that the host has sent. Returns true if this byte completes `wanted`.
  bool take(const HostBytes& wanted, std::byte byte) noexcept;
  bool take(const HostBytes& wanted, std::span<const std::byte> bytes) noexcept {
    bool is_found = false;
    for (const std::byte byte : bytes) is_found = take(wanted, byte) || is_found;
    return is_found;
  }

 private:
  std::size_t matched_ = 0;  // bytes of `wanted` that the last bytes of the host were
};

}  // namespace imud
