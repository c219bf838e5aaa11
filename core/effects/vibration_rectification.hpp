#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"
#include "core/numbers/elementary.hpp"

namespace imud {

// The shift of the bias by vibration (IEEE Std 1293-2018, vibration rectification error):
//   error += k <v^2>
// <v^2> is the mean square of the specific force of Vibration. With an averaging time, <v^2> is instead estimated
// from the specific force at the sensor, which contains the truth's own vibration, too. The estimators are two
// filters of first order with that time constant, with samples of period T and a = 1 - exp(-T/time):
//   f_bar <- f_bar + a (f - f_bar),  <v^2> <- <v^2> + a ((f - f_bar)^2 - <v^2>)
// A sine of amplitude A has A^2/2, if its period is short beside the averaging time.
class VibrationRectification {
 public:
  static constexpr std::string_view name = "vibration rectification";
  static constexpr EffectTraits traits = {};
  VibrationRectification(const TriadErrors& errors, Quantity, double period_s)
      : response_(errors.vibration_average > 0 ? 1 - elementary::exp(-period_s / errors.vibration_average) : 0) {
    set_constants(errors);
  }
  // Replaces the sensitivity; the estimate goes on.
  void set_constants(const TriadErrors& errors) noexcept {
    sensitivity_ = errors.vibration_rectification;
    shift_ = sensitivity_ * errors.vibration_mean_square;
    on_ = response_ > 0 ? !sensitivity_.isZero(0.0) : !shift_.isZero(0.0);
  }
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept {
    if (response_ > 0)
      step.constant_error += lanes(estimated(step.specific_force));
    else
      step.constant_error += step.surroundings.vibration_power * lanes(shift_);
  }
  void seek(const Normals&, std::uint64_t) noexcept {}  // the mean square is not known without the sequence
  void power_on(std::uint64_t) noexcept {}
  void continue_from(const VibrationRectification& before, const Normals&, std::uint64_t) noexcept {
    mean_ = before.mean_;
    mean_square_ = before.mean_square_;
    has_mean_ = before.has_mean_;
  }

 private:
  [[gnu::noinline]] Vector3 estimated(const Vector3& f) noexcept {
    if (!has_mean_) mean_ = f;
    has_mean_ = true;
    mean_ += response_ * (f - mean_);
    mean_square_ += response_ * ((f - mean_).cwiseAbs2() - mean_square_);
    return sensitivity_ * mean_square_;
  }

  Matrix3 sensitivity_;
  Vector3 shift_;
  double response_;
  bool on_ = false;
  bool has_mean_ = false;
  Vector3 mean_ = Vector3::Zero(), mean_square_ = Vector3::Zero();
};

}  // namespace imud
