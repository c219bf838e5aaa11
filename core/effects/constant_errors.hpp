// ConstantErrors: errors that are constant while the power is on, as they are added to the members of TriadErrors
// that have the same names; or their standard deviations.
#pragma once

#include "core/vector.hpp"

namespace imud {

// u is the unit of TriadErrors. Each element has a draw of its own.
struct ConstantErrors {
  Vector3 bias = Vector3::Zero();                    // u
  Vector3 scale_factor = Vector3::Zero();            // 1
  Vector3 scale_factor_asymmetry = Vector3::Zero();  // 1
  Vector3 quadratic = Vector3::Zero();               // 1/u
  Vector3 cubic = Vector3::Zero();                   // 1/u^2
  Matrix3 misalignment = Matrix3::Zero();            // rad; 0 on the diagonal
  Matrix3 g_sensitivity = Matrix3::Zero();           // u/(m/s^2)
  // Column j - 1 has the coefficients of degree j.
  Matrix3 temperature_scale = Matrix3::Zero();        // 1/K^j
  Matrix3 temperature_bias = Matrix3::Zero();         // u/K^j
  Vector3 temperature_rate_bias = Vector3::Zero();    // u/(K/s)
  Vector3 temperature_hysteresis = Vector3::Zero();   // u
  Matrix3 cross_sensitivity = Matrix3::Zero();        // u/(m/s^2)^2
  Matrix3 vibration_rectification = Matrix3::Zero();  // u/(m/s^2)^2

  bool is_on() const noexcept {
    return !(bias.isZero(0.0) && scale_factor.isZero(0.0) && scale_factor_asymmetry.isZero(0.0) &&
             quadratic.isZero(0.0) && cubic.isZero(0.0) && misalignment.isZero(0.0) && g_sensitivity.isZero(0.0) &&
             temperature_scale.isZero(0.0) && temperature_bias.isZero(0.0) && temperature_rate_bias.isZero(0.0) &&
             temperature_hysteresis.isZero(0.0) && cross_sensitivity.isZero(0.0) &&
             vibration_rectification.isZero(0.0));
  }
};

}  // namespace imud
