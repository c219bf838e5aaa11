#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// Noise of two levels, popcorn or burst noise: the random telegraph signal with equal mean times,
//   error += p s,  s = +-1
// The times between two changes of s are independent and exponentially distributed, with the mean `popcorn_time`: a
// process in continuous time, whose mean over a step is exact at any rate. Its autocovariance is p^2 exp(-2 t/time),
// and its Allan variance the one of ExponentiallyCorrelated with the standard deviation p and half the time.
class PopcornNoise {
 public:
  static constexpr std::string_view name = "popcorn noise";
  static constexpr EffectTraits traits = {.is_rare = true};
  PopcornNoise(const TriadErrors& errors, Quantity quantity, double period_s);
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept {
    const Value value = next(step.normals, step.k);
    step.error += lanes(value.now);
    step.mean_error += lanes(value.mean);
  }
  // The run time is proportional to k.
  void seek(const Normals& normals, std::uint64_t k) noexcept;
  void power_on(std::uint64_t) noexcept {}
  // Continues the levels of `before`. Their next changes come when they would have come without the replacement.
  void continue_from(const PopcornNoise& before, const Normals& normals, std::uint64_t k) noexcept;

 private:
  struct Value {
    Vector3 now, mean;  // at the end of the step, and over it
  };
  struct Level {
    double sign = 1;
    double until_s = 0;        // the time of its next change
    std::uint64_t number = 0;  // of the random number that has set until_s
  };
  Value next(const Normals& normals, std::uint64_t k) noexcept;
  void begin(const Normals& normals) noexcept;
  double drawn(const Normals& normals, int axis, std::uint64_t number) const noexcept;
  double mean(const Normals& normals, int axis, double from_s, double to_s) noexcept;

  Vector3 level_, time_s_;
  double period_s_;
  Quantity quantity_;
  bool on_, has_begun_ = false;
  std::array<Level, 3> levels_ = {};
};

}  // namespace imud
