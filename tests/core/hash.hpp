// A fingerprint of doubles, bit by bit: the same from two builds if and only if their numbers are the same.
#pragma once

#include <bit>
#include <cstdint>

#include "core/vector.hpp"

namespace imud {

class Hash {  // FNV-1a, 64 bits, over words
 public:
  void add(std::uint64_t word) {
    for (int i = 0; i < 8; ++i) value_ = (value_ ^ (word >> (8 * i) & 0xFFU)) * 1099511628211U;
  }
  void add(double x) { add(std::bit_cast<std::uint64_t>(x)); }
  void add(const Vector3& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 14695981039346656037U;
};

}  // namespace imud
