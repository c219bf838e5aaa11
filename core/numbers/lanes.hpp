// Lanes: the values of three axes side by side in vector registers. The fourth lane of a vector may have any value; a
// quaternion uses all four. Lanes are for what acts on every sample; elsewhere Vector3 is simpler.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "core/vector.hpp"

namespace imud {

// An extension of GCC and clang; operators act on each lane and round as for double. A processor without registers of
// this size takes two of 128 bits. Functions that pass or return Lanes are always inline, because the calling
// convention depends on the processor's features.
using Lanes = double __attribute__((vector_size(32)));
using LaneMask = std::int64_t __attribute__((vector_size(32)));  // all bits of a lane are equal

[[gnu::always_inline]] inline Lanes lanes(const Vector3& v) noexcept { return Lanes{v[0], v[1], v[2], v[2]}; }
[[gnu::always_inline]] inline Lanes all_lanes(double x) noexcept { return Lanes{x, x, x, x}; }
[[gnu::always_inline]] inline Vector3 vector_of(Lanes x) noexcept { return {x[0], x[1], x[2]}; }
// Returns a where the mask is set, else b.
[[gnu::always_inline]] inline Lanes select(LaneMask mask, Lanes a, Lanes b) noexcept { return mask ? a : b; }
// Returns x, negated where the sign bit of `signs` is set. The other bits of `signs` must be clear.
[[gnu::always_inline]] inline Lanes change_sign(LaneMask signs, Lanes x) noexcept {
  return std::bit_cast<Lanes>(std::bit_cast<LaneMask>(x) ^ signs);
}
// Return the magnitude of each lane of x, and magnitudes with the signs of x.
[[gnu::always_inline]] inline Lanes magnitude(Lanes x) noexcept {
  return std::bit_cast<Lanes>(std::bit_cast<LaneMask>(x) & INT64_MAX);
}
[[gnu::always_inline]] inline Lanes with_sign_of(Lanes x, Lanes magnitude) noexcept {
  return std::bit_cast<Lanes>(std::bit_cast<LaneMask>(magnitude) | (std::bit_cast<LaneMask>(x) & INT64_MIN));
}

// The type Lanes is aligned to 16 bytes, unless the whole file is compiled for AVX; but code for AVX takes 32 for
// granted. Lanes in memory are therefore of a type without this promise, and aligned all the same: an access that
// crosses a page of memory took up to a tenth of a sample's time.
inline constexpr std::size_t lane_alignment = 32;

// A vector in memory, 0 at first.
class LaneVector {
 public:
  [[gnu::always_inline]] Lanes lanes() const noexcept { return values_; }
  Vector3 vector() const noexcept { return {values_[0], values_[1], values_[2]}; }
  [[gnu::always_inline]] void add(Lanes x) noexcept { values_ = lanes() + x; }
  [[gnu::always_inline]] void subtract(Lanes x) noexcept { values_ = lanes() - x; }

 private:
  using InMemory = double __attribute__((vector_size(32), aligned(8)));
  alignas(lane_alignment) InMemory values_ = {};
};

// A matrix as three columns.
class LaneMatrix {
 public:
  explicit LaneMatrix(const Matrix3& m) noexcept {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) columns_[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)] = m(i, j);
  }
  // Returns the product, with the bits that Eigen gives.
  [[gnu::always_inline]] Lanes operator*(const Vector3& v) const noexcept {
    return column(0) * v[0] + (column(1) * v[1] + column(2) * v[2]);
  }
  [[gnu::always_inline]] Lanes operator*(Lanes v) const noexcept {
    const Lanes x = __builtin_shufflevector(v, v, 0, 0, 0, 0), y = __builtin_shufflevector(v, v, 1, 1, 1, 1),
                z = __builtin_shufflevector(v, v, 2, 2, 2, 2);
    return column(0) * x + (column(1) * y + column(2) * z);
  }

 private:
  [[gnu::always_inline]] Lanes column(std::size_t j) const noexcept { return std::bit_cast<Lanes>(columns_[j]); }
  alignas(lane_alignment) std::array<std::array<double, 4>, 3> columns_ = {};
};

}  // namespace imud
