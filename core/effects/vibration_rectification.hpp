#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The shift of the bias by vibration (IEEE Std 1293-2018, vibration rectification error). <v^2> is the mean square of
// the specific force of Vibration:
//   error += k <v^2>
class VibrationRectification : public StatelessEffect {
 public:
  static constexpr std::string_view name = "vibration rectification";
  VibrationRectification(const TriadErrors& errors, Quantity, double)
      : shift_(errors.vibration_rectification.cwiseProduct(errors.vibration_mean_square)), on_(!shift_.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) const noexcept { step.constant_error += shift_; }

 private:
  Vector3 shift_;
  bool on_;
};

}  // namespace imud
