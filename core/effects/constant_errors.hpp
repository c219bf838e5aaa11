// ConstantErrors: errors that are constant while the power is on, or the standard deviations of such errors. Each
// error is added to the member of TriadErrors that has the same name. Cause: why some of these errors are correlated.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/numbers/random.hpp"
#include "core/vector.hpp"

namespace imud {

// u is the unit of TriadErrors. Each element has a draw of its own, of which a Cause may determine a part.
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

  bool is_on() const noexcept;
};

// The names of the members, in the order of their declaration.
inline constexpr std::array<std::string_view, 13> constant_error_names = {"bias",
                                                                          "scale_factor",
                                                                          "scale_factor_asymmetry",
                                                                          "quadratic",
                                                                          "cubic",
                                                                          "misalignment",
                                                                          "g_sensitivity",
                                                                          "temperature_scale",
                                                                          "temperature_bias",
                                                                          "temperature_rate_bias",
                                                                          "temperature_hysteresis",
                                                                          "cross_sensitivity",
                                                                          "vibration_rectification"};

// Calls f with the members of the same name, in that order. `Errors` are ConstantErrors or TriadErrors.
template <class F, class... Errors>
void for_each_constant(F&& f, Errors&... errors) {
  f(errors.bias...);
  f(errors.scale_factor...);
  f(errors.scale_factor_asymmetry...);
  f(errors.quadratic...);
  f(errors.cubic...);
  f(errors.misalignment...);
  f(errors.g_sensitivity...);
  f(errors.temperature_scale...);
  f(errors.temperature_bias...);
  f(errors.temperature_rate_bias...);
  f(errors.temperature_hysteresis...);
  f(errors.cross_sensitivity...);
  f(errors.vibration_rectification...);
}

inline bool ConstantErrors::is_on() const noexcept {
  bool is_zero = true;
  for_each_constant([&](const auto& term) { is_zero = is_zero && term.isZero(0.0); }, *this);
  return !is_zero;
}

// When errors are drawn: once for a unit, or at each power on.
enum class DrawnLayer : std::uint8_t { unit, turn_on };

// A cause that drawn errors of one layer share, such as the stress of a package. An element of standard deviation
// sigma and loads r_j by the causes c_j is
//   sigma (sqrt(1 - sum of r_j^2) n + sum of r_j c_j),   n, c_j ~ N(0, 1), independent
// so that its mean and its standard deviation are as without causes, and the correlation of two elements is the sum
// of the products of their loads. (The orthogonal factor model: Johnson and Wichern, Applied Multivariate Statistical
// Analysis, 6th ed., section 9.2.)
struct Cause {
  std::string name;
  DrawnLayer layer = DrawnLayer::unit;
  // True: each axis has its own deviate, which is used for its row of matrices, too. False: the axes share one
  // deviate.
  bool is_per_axis = false;
  // The loads, -1 to 1; the squares of an element's loads by all causes add up to at most 1. In the layer `turn_on`,
  // the loads of `bias` are for TriadErrors::turn_on_bias.
  ConstantErrors gyro, accelerometer, magnetometer, inclinometer;

  // Returns the loads of the triad that measures this quantity.
  const ConstantErrors& loads(Quantity quantity) const noexcept {
    return quantity == Quantity::rate             ? gyro
           : quantity == Quantity::specific_force ? accelerometer
           : quantity == Quantity::inclination    ? inclinometer
                                                  : magnetometer;
  }
  // Returns the deviates of the axes. `number` counts the power ons from 0; the layer `unit` ignores it.
  Vector3 drawn(const Normals& normals, std::uint64_t number) const noexcept {
    const bool is_of_unit = layer == DrawnLayer::unit;
    const Process process = is_of_unit ? Process::unit_cause : Process::turn_on_cause;
    const std::uint64_t power_on = is_of_unit ? 0 : number;
    const Vector3 deviates = normals(Quantity::rate, process, (power_on << 32U) + stream_id(name));
    return is_per_axis ? deviates : Vector3::Constant(deviates.x());
  }
};

}  // namespace imud
