// Random numbers: counter-based, so that each number of each stream can be computed alone, in any order, with the
// same bits on every machine. All functions are pure and thread-safe, and do not allocate or throw.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/vector.hpp"

namespace imud {

// The quantity and the error process that a stream of numbers serves. The values below never change and are never
// reused, so that a new process does not change the random numbers of the others.
enum class Quantity : std::uint32_t { rate = 0, specific_force = 1, magnetic_field = 2, pressure = 3 };
enum class Process : std::uint32_t { gauss_markov = 0 };

// Returns the standard normal deviate whose distribution function is p, in (0, 1), with a relative error below 1e-15.
// (PPND16 of M. J. Wichura, Algorithm AS 241, Applied Statistics 37(3), 1988.)
double inverse_normal_cdf(double p) noexcept;

// Returns a 32-bit hash of an imu's name, which makes its streams different from those of other names.
std::uint32_t stream_id(std::string_view imu_name) noexcept;

// Returns the uniform deviate (k + 1/2)/2^52, where k is the upper 52 of 64 random bits: exact, in (0, 1), symmetric
// about 1/2.
constexpr double uniform(std::uint64_t bits) noexcept {
  return (static_cast<double>(static_cast<std::int64_t>(bits >> 12U)) + 0.5) * 0x1p-52;
}

// The normal deviates of one imu, one stream per quantity, axis and process, of Philox4x32-10 with the seed as key
// and {k/2, k/2, process/quantity/axis, imu} as counter. The first two of its four output words give the deviate of
// an even k, the last two that of the odd k after it; all deviates are independent. (Salmon et al., "Parallel random
// numbers: as easy as 1, 2, 3", SC 2011.)
class Normals {
 public:
  Normals(std::uint64_t seed, std::uint32_t stream) noexcept : seed_(seed), stream_(stream) {}

  // The random bits of the samples 2 * number and 2 * number + 1, on three axes each.
  struct Block {
    std::uint64_t number = ~std::uint64_t{0};
    std::array<std::array<std::uint64_t, 3>, 2> bits = {};
    bool holds(std::uint64_t k) const noexcept { return number == k / 2; }
    // Returns N(0, 1) on each axis for sample k. holds(k) must be true.
    Vector3 normals(std::uint64_t k) const noexcept;
  };
  // Returns the block that holds sample `k`.
  Block block(Quantity quantity, Process process, std::uint64_t k) const noexcept;

  // Returns N(0, 1) on each of the three axes for sample `k`.
  Vector3 operator()(Quantity quantity, Process process, std::uint64_t k) const noexcept {
    return block(quantity, process, k).normals(k);
  }

 private:
  std::uint64_t seed_;
  std::uint32_t stream_;
};

}  // namespace imud
