// Bits of integers.
#pragma once

#include <cmath>
#include <cstdint>

namespace imud {

// Returns a number whose lowest `bits` bits are 1. `bits`: 0 to 64.
constexpr std::uint64_t low_bits(unsigned bits) noexcept { return bits == 0 ? 0 : ~std::uint64_t{0} >> (64 - bits); }

// Returns the lowest `bits` bits in reverse order.
constexpr std::uint64_t reflected(std::uint64_t value, unsigned bits) noexcept {
  std::uint64_t result = 0;
  for (unsigned i = 0; i < bits; ++i) result |= (value >> i & 1U) << (bits - 1 - i);
  return result;
}

// Returns the largest double that is no more than 2^bits - 1.
inline double below_power(unsigned bits) noexcept {
  const double power = std::ldexp(1.0, static_cast<int>(bits));
  return bits <= 53 ? power - 1 : std::nextafter(power, 0.0);
}

}  // namespace imud
