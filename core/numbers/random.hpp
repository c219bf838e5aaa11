// Random numbers: counter-based, so that each number of each stream can be computed alone, in any order, with the
// same bits on every machine. All functions are pure and thread-safe, and do not allocate or throw.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/vector.hpp"

namespace imud {

// The quantity and the error process that a stream of numbers serves. The values below never change and are never
// reused, so that a new process does not change the random numbers of the others.
enum class Quantity : std::uint32_t {
  rate = 0,
  specific_force = 1,
  magnetic_field = 2,
  pressure = 3,
  position = 4,
  velocity = 5,
  attitude = 6,
  gnss_time = 7,
  inclination = 8,
};
enum class Process : std::uint32_t {
  gauss_markov = 0,
  turn_on_bias = 1,
  white_noise = 2,
  exponentially_correlated = 3,
  random_walk = 4,
  random_walk_within_step = 5,
  vibration = 6,  // sample k: coordinate k % 2 of the phase of line k/2
  sampling_jitter = 7,
  fault = 8,          // of a wire: coordinate of a byte or a frame
  fault_draw = 9,     // the numbers of an occurrence of a fault
  fault_noise = 10,   // the noise that a fault adds to a sample
  unit_draw = 11,     // constant errors of a unit (drawn_errors.cpp)
  turn_on_draw = 12,  // constant errors of one power on
  correlated_within_step = 13,
  flicker_within_step = 14,
  quantization_noise = 15,
  popcorn_noise = 16,  // a uniform deviate for each change of an axis
  clock_wander = 17,   // x: end of the frequency's random walk in a period, y: within it, z: white noise
  stamp_jitter = 18,
  unit_cause = 19,      // of the cause whose name has that hash (constant_errors.hpp)
  turn_on_cause = 20,   // the same, with the number of the power on in the upper 32 bits
  multipath = 21,       // x: of a satellite's range; sample 64 i + PRN: in the i-th interval (gnss/sky.cpp)
  campaign_draw = 22,   // of the key whose name has that hash; sample k: draw k
  campaign_order = 23,  // of the draws of a Latin hypercube, by the same
  flicker = 32,         // of its first octave; the other octaves have the next 31 numbers
};

// Returns the number of the octave-th process of a cascade, 0 to 31, that begins with `first`.
constexpr Process octave_of(Process first, std::uint32_t octave) noexcept {
  return static_cast<Process>(static_cast<std::uint32_t>(first) + octave);
}

// Returns the standard normal deviate whose distribution function is p, in (0, 1), with a relative error below 1e-15.
// (PPND16 of M. J. Wichura, Algorithm AS 241, Applied Statistics 37(3), 1988.)
double inverse_normal_cdf(double p) noexcept;

// Returns a 32-bit hash of an imu's name, which makes its streams differ from other imus' streams.
std::uint32_t stream_id(std::string_view imu_name) noexcept;

// Returns the uniform deviate (k + 1/2)/2^52, where k is the upper 52 of 64 random bits: exact, in (0, 1), symmetric
// about 1/2.
constexpr double uniform(std::uint64_t bits) noexcept {
  return (static_cast<double>(static_cast<std::int64_t>(bits >> 12U)) + 0.5) * 0x1p-52;
}

// 16 samples of one stream on three axes, from sample 16 `number` on.
struct NormalBatch {
  static constexpr std::size_t samples = 16;
  using Deviates = std::array<double, 3 * samples>;  // all of x, then of y, then of z
  std::uint64_t seed;
  std::uint32_t stream;
  std::uint32_t purpose;  // of the quantity and the process
  std::uint64_t number;

  bool operator==(const NormalBatch&) const noexcept = default;
  // Computes N(0, 1) of each sample and axis, with the same bits as Normals.
  void compute(Deviates& deviates) const noexcept;
};

class NormalStock;

// The normal deviates of one imu, one stream per quantity, axis and process, of Philox4x32-10 with the seed as key
// and {k/2, k/2, process/quantity/axis, imu} as counter. The first two of its four output words give the deviate of
// an even k, the last two the deviate of k + 1. All deviates are independent. (Salmon et al., "Parallel random
// numbers: as easy as 1, 2, 3", SC 2011.)
class Normals {
 public:
  Normals(std::uint64_t seed, std::uint32_t stream) noexcept : seed_(seed), stream_(stream) {}

  // Replaces the seed.
  void set_seed(std::uint64_t seed) noexcept { seed_ = seed; }
  // Returns N(0, 1) on each of the three axes for sample `k`.
  Vector3 operator()(Quantity quantity, Process process, std::uint64_t k) const noexcept;
  // Returns a deviate that is uniform in (0, 1), from the random bits of the x axis' normal deviate.
  double uniform(Quantity quantity, Process process, std::uint64_t k) const noexcept;

 private:
  double uniform_of_axis(std::uint32_t purpose_and_axis, std::uint64_t k) const noexcept;

  friend class NormalSequence;
  std::uint64_t seed_;
  std::uint32_t stream_;
};

// The normal deviates of one quantity and process, for a caller that takes them in ascending order: a batch is
// computed at once, in vector registers where the compiler has any, or is taken from a stock.
class NormalSequence {
 public:
  static constexpr std::size_t batch = NormalBatch::samples;
  NormalSequence(Quantity quantity, Process process) noexcept : quantity_(quantity), process_(process) {}
  // Discards numbers computed ahead: the next call may have other `normals`.
  void forget() noexcept { number_ = ~std::uint64_t{0}; }
  // From now on takes the numbers from `stock`, unless they are not there yet. The stock must outlive the last call
  // of at().
  void take_from(NormalStock& stock) noexcept { stock_ = &stock; }
  Quantity quantity() const noexcept { return quantity_; }
  // Returns N(0, 1) on each axis for sample k. `normals` must be the same in all calls since forget().
  Vector3 at(const Normals& normals, std::uint64_t k) noexcept {
    if (k / batch != number_) compute(normals, k / batch);
    const std::size_t i = k % batch;
    return {deviates_[i], deviates_[batch + i], deviates_[2 * batch + i]};
  }

 private:
  void compute(const Normals& normals, std::uint64_t number) noexcept;

  Quantity quantity_;
  Process process_;
  NormalStock* stock_ = nullptr;
  std::uint64_t number_ = ~std::uint64_t{0};
  NormalBatch::Deviates deviates_ = {};
};

}  // namespace imud
