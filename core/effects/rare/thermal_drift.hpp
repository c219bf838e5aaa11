#pragma once

#include <algorithm>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The change of the bias with the course of the temperature T of the sensor, by its rate and by its history:
//   error += r dT/dt + h y,  y <- clamp(y + (change of T)/w, -1, 1),  y = 0 before sample 0
// y moves as a gear with play of the width 2 w does: 1 while the sensor warms up, -1 while it cools down, once T has
// changed by 2 w in that direction. The gap between the two curves is 2 h. The history survives a loss of the power.
class ThermalDrift {
 public:
  static constexpr std::string_view name = "bias by the course of the temperature";
  static constexpr EffectTraits traits = {.is_rare = true};
  ThermalDrift(const TriadErrors& errors, Quantity, double) : width_c_(errors.temperature_hysteresis_c) {
    set_constants(errors);
  }
  // Replaces the coefficients; the history goes on.
  void set_constants(const TriadErrors& errors) noexcept {
    per_rate_ = errors.temperature_rate_bias;
    half_gap_ = errors.temperature_hysteresis;
    on_ = !per_rate_.isZero(0.0) || !half_gap_.isZero(0.0);
  }
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept {
    const double now_c = step.surroundings.temperature_c;
    if (!has_last_) last_c_ = now_c;
    has_last_ = true;
    play_ = std::clamp(play_ + (now_c - last_c_) / width_c_, -1.0, 1.0);
    last_c_ = now_c;
    step.constant_error += step.surroundings.temperature_rate * lanes(per_rate_) + play_ * lanes(half_gap_);
  }
  void seek(const Normals&, std::uint64_t) noexcept {}  // the history is not known without the sequence
  void power_on(std::uint64_t) noexcept {}
  void continue_from(const ThermalDrift& before, const Normals&, std::uint64_t) noexcept {
    play_ = before.play_;
    last_c_ = before.last_c_;
    has_last_ = before.has_last_;
  }

 private:
  Vector3 per_rate_, half_gap_;
  double width_c_;
  bool on_ = false;
  double play_ = 0, last_c_ = 0;
  bool has_last_ = false;
};

}  // namespace imud
