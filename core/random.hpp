// Random numbers: counter-based, so that any number of any stream can be had alone, in any order, on any machine.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/vector.hpp"

namespace imud {

// What a stream is for; a number once given is never given again, so that a new process shifts nobody's numbers.
enum class Quantity : std::uint32_t { rate = 0, specific_force = 1, magnetic_field = 2, pressure = 3 };
enum class Process : std::uint32_t { gauss_markov = 0 };

// The standard normal deviate whose distribution function is p in (0, 1): Wichura's AS241 (PPND16), relative error
// below 1e-15. (M. J. Wichura, Algorithm AS 241, Applied Statistics 37(3), 1988.)
double inverse_normal_cdf(double p) noexcept;

// 32 bits that tell one imu's streams from another's.
std::uint32_t stream_id(std::string_view imu_name) noexcept;

// The uniform deviate that 64 random bits give: (k + 1/2)/2^52 of their upper 52. Exact, never 0 or 1, symmetric.
constexpr double uniform(std::uint64_t bits) noexcept {
  return (static_cast<double>(static_cast<std::int64_t>(bits >> 12U)) + 0.5) * 0x1p-52;
}

// All the normal deviates of one imu, one stream per quantity, axis and process: Philox4x32-10 with the seed as key
// and {k/2, k/2, process/quantity/axis, imu} as counter. Of its four words the first two give the normal of an even
// k, the last two that of the odd one after it; each is independent of every other. (Salmon et al., "Parallel random
// numbers: as easy as 1, 2, 3", SC 2011.)
class Normals {
 public:
  Normals(std::uint64_t seed, std::uint32_t stream) noexcept : seed_(seed), stream_(stream) {}

  // The words of the two samples 2 * number and 2 * number + 1, three axes each.
  struct Block {
    std::uint64_t number = ~std::uint64_t{0};
    std::array<std::array<std::uint64_t, 3>, 2> bits = {};
    bool holds(std::uint64_t k) const noexcept { return number == k / 2; }
    // N(0, 1) on each axis for sample k, which it holds.
    Vector3 normals(std::uint64_t k) const noexcept;
  };
  Block block(Quantity quantity, Process process, std::uint64_t k) const noexcept;

  // N(0, 1) on each of the three axes, for sample `k`.
  Vector3 operator()(Quantity quantity, Process process, std::uint64_t k) const noexcept {
    return block(quantity, process, k).normals(k);
  }

 private:
  std::uint64_t seed_;
  std::uint32_t stream_;
};

}  // namespace imud
