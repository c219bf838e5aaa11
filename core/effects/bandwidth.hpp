#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The low-pass filter of the sensor (SensorFilter): Butterworth or boxcars. It filters the value and not the
// increments, which are sums of unfiltered values, as tactical sensors have them.
//
// Each section of a Butterworth filter is solved as a state-variable filter by the trapezoidal rule, which is the
// bilinear transform: with x the input, y the output, g = tan(pi f_c/rate) and the damping k,
//   v = (u + g (x - w))/(1 + g (g + k)),  y = w + g v,  u <- 2 v - u,  w <- 2 y - w
// and of order 1:  v = g/(1 + g) (x - w),  y = w + v,  w <- y + v.
// It settles on the first value of a run, and on the next value after seek() and set(), as if the input had been
// constant before; a constant input passes unchanged.
class Bandwidth {
 public:
  static constexpr std::string_view name = "bandwidth";
  static constexpr EffectTraits traits = {};
  Bandwidth(const TriadErrors& errors, Quantity, double period_s);
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept {
    if (step.begins_run || !is_settled_) [[unlikely]]
      settle(vector_of(step.value));
    step.value = length_ > 1 ? lanes(boxcars(vector_of(step.value))) : butterworth(step.value);
    const Lanes zero = step.value * 0.0;             // not a number where the value is not finite
    is_settled_ = zero[0] + zero[1] + zero[2] == 0;  // otherwise it would never be finite again
  }
  void seek(const Normals&, std::uint64_t) noexcept { is_settled_ = false; }
  void power_on(std::uint64_t) noexcept { is_settled_ = false; }
  // Continues the state of `before` if both filters have the same parameters. Otherwise the filter settles on its
  // next value.
  void continue_from(const Bandwidth& before, const Normals&, std::uint64_t) noexcept;

  // Allocates memory for set(): boxcars of one stage and at most this length.
  void reserve(int length);
  // Replaces the filter. Boxcars that are longer than the memory of reserve() are shortened.
  void set(const SensorFilter& filter) noexcept;

 private:
  struct Section {
    std::array<double, 4> from_u, from_x, y_from_x;  // 1, g and g^2 over 1 + g (g + k), for each axis
    std::array<double, 4> u, w;                      // the state
  };
  void settle(const Vector3& value) noexcept;
  [[gnu::always_inline]] Lanes butterworth(Lanes value) noexcept {
    Lanes x = value;
    const std::size_t count = order_ == 4 ? 2 : 1;
    for (std::size_t i = 0; i < count; ++i) {
      Section& section = sections_[i];
      const Lanes w = std::bit_cast<Lanes>(section.w), from_x = std::bit_cast<Lanes>(section.y_from_x);
      Lanes y;
      if (order_ == 1) {
        const Lanes v = from_x * (x - w);
        y = w + v;
        section.w = std::bit_cast<std::array<double, 4>>(y + v);
      } else {
        const Lanes u = std::bit_cast<Lanes>(section.u), g = std::bit_cast<Lanes>(section.from_x);
        const Lanes v = std::bit_cast<Lanes>(section.from_u) * u + g * (x - w);
        y = w + (g * u + from_x * (x - w));
        section.u = std::bit_cast<std::array<double, 4>>(2.0 * v - u);
        section.w = std::bit_cast<std::array<double, 4>>(2.0 * y - w);
      }
      x = y;
    }
    return select(std::bit_cast<LaneMask>(passes_), value, x);
  }
  Vector3 boxcars(const Vector3& value) noexcept;

  double rate_hz_;
  bool on_ = false;
  bool is_settled_ = false;
  int order_ = 2;
  std::array<Section, 2> sections_ = {};
  std::array<std::int64_t, 4> passes_ = {};  // a LaneMask: axes without a filter
  std::size_t length_ = 1, stages_ = 1;
  std::size_t oldest_ = 0;       // index of the oldest input in each stage
  std::vector<Vector3> inputs_;  // the newest `length_` inputs of each stage, stage after stage
  std::array<Vector3, SensorFilter::max_stages> sums_;  // of the inputs of each stage
};

}  // namespace imud
