// is_plus_zero: finds vectors that a unit quaternion and the identity matrix leave as they are, to the bit. A row of
// three negative numbers of another matrix makes -0 of them.
#pragma once

#include <bit>
#include <cstdint>

#include "core/vector.hpp"

namespace imud {

// Returns whether all components of `v` are 0 without a sign.
inline bool is_plus_zero(const Vector3& v) noexcept {
  const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x); };
  return (bits(v.x()) | bits(v.y()) | bits(v.z())) == 0;
}

}  // namespace imud
