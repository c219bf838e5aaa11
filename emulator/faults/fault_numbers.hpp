// FaultNumbers: the random numbers of one occurrence of a fault, one after another.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "core/numbers/elementary.hpp"
#include "core/numbers/random.hpp"

namespace imud {

// The numbers of each occurrence are independent of all others, and the same on every machine.
class FaultNumbers {
 public:
  FaultNumbers() noexcept : FaultNumbers(0, 0, 0, 0) {}
  // `stream` is the stream of the place at which the fault acts (stream_id()). `number` is the fault's number in the
  // configuration. `first` is the index of the first returned number among the occurrence's numbers.
  FaultNumbers(std::uint64_t seed, std::uint32_t stream, std::uint32_t number, std::uint64_t occurrence,
               std::uint64_t first = 0) noexcept
      : normals_(seed, stream_of(stream, number)), next_((occurrence << 40U) + first) {}

  // Returns the next number, uniform in (0, 1).
  double uniform() noexcept { return normals_.uniform(Quantity::rate, Process::fault, next_++); }
  // Returns an integer from 0 to n - 1, each with the same probability; n is below 2^32.
  std::uint64_t below(std::uint64_t n) noexcept {
    return static_cast<std::uint64_t>(uniform() * static_cast<double>(n));
  }
  // Returns true with probability p.
  bool happens(double p) noexcept { return uniform() < p; }
  // Returns the number of trials up to and with the first success, if each trial succeeds with probability p; `never`
  // if p is 0.
  static constexpr std::uint64_t never = std::uint64_t{1} << 62U;
  std::uint64_t trials(double p) noexcept {
    const double u = uniform();
    if (p >= 1) return 1;
    if (!(p > 0)) return never;
    const double log_of_failure = p < 1e-7 ? -p - 0.5 * p * p : elementary::log(1 - p);
    const double trials = 1 + std::floor(elementary::log(u) / log_of_failure);
    return trials < 0x1p62 ? static_cast<std::uint64_t>(trials) : never;
  }

 private:
  static std::uint32_t stream_of(std::uint32_t stream, std::uint32_t number) noexcept {
    std::array<char, 8> name;
    const std::uint64_t both = std::uint64_t{number} << 32U | stream;
    for (unsigned i = 0; i < name.size(); ++i) name[i] = static_cast<char>(both >> (8 * i) & 0xFFU);
    return stream_id({name.data(), name.size()});
  }

  Normals normals_;
  std::uint64_t next_;
};

}  // namespace imud
