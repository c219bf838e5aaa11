// TriadErrors: the parameters of all errors of three sensors of a kind. triad.hpp has the effects that they describe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/effects/constant_errors.hpp"
#include "core/effects/sensor_filter.hpp"
#include "core/vector.hpp"

namespace imud {

// How a value becomes a multiple of its LSB; `nearest` rounds halves away from zero.
enum class Rounding : std::uint8_t { toward_zero, nearest, away_from_zero };

// The limits of the values of each axis: `lower` is at most 0, `upper` is above 0.
struct AxisLimits {
  Vector3 lower, upper;
};

// The taps of a filter, shared so that a copy does not allocate; nullptr: none.
using FirTaps = std::shared_ptr<const std::vector<double>>;

// The errors of three gyros (u is rad/s), accelerometers or inclinometers (m/s^2), or magnetometers (T), one of a
// kind on each platform axis. The default of every member switches its effect off. Densities are continuous: their
// spectra do not depend on the sample rate. Each group has the parameters of the effect named above the group; the
// effect's header has the equation.
struct TriadErrors {
  // Misalignment
  Matrix3 misalignment = Matrix3::Identity();  // row i: the input axis of sensor i, in platform axes

  // DeadZone
  Vector3 dead_zone = Vector3::Zero();  // z, u, half of its width, not negative

  // ScaleFactor
  Vector3 scale_factor = Vector3::Ones();

  // Nonlinearity
  Vector3 scale_factor_asymmetry = Vector3::Zero();  // factor for positive less factor for negative
  Vector3 quadratic = Vector3::Zero();               // 1/u
  Vector3 cubic = Vector3::Zero();                   // 1/u^2

  // TemperatureScale and TemperatureBias. Column j - 1 of a matrix has the coefficients of degree j.
  double reference_temperature_c = 25;          // T0, degrees Celsius
  Matrix3 temperature_scale = Matrix3::Zero();  // 1/K^j
  Matrix3 temperature_bias = Matrix3::Zero();   // u/K^j

  // ThermalDrift
  Vector3 temperature_rate_bias = Vector3::Zero();  // r, u/(K/s)
  Vector3 temperature_hysteresis =
      Vector3::Zero();                   // h, u: half of the gap between the curves of warming and cooling
  double temperature_hysteresis_c = 10;  // w, K, above 0

  // Bias
  Vector3 bias = Vector3::Zero();  // u

  // GaussMarkov: the memo's process, whose parameters are per sample, not densities
  Matrix3 walk_transition = Matrix3::Identity();  // A: 0 gives white noise, identity a random walk
  Matrix3 walk_sqrt_cov = Matrix3::Zero();        // P, u: P P^T is the covariance of one step
  Vector3 walk_bound = Vector3::Zero();           // u, limit of |x|, not negative; 0: none

  // TurnOnBias
  Vector3 turn_on_bias = Vector3::Zero();  // u, standard deviation, not negative

  // Ramp
  Vector3 ramp = Vector3::Zero();  // R, u/s

  // AccelerationSensitivity
  Matrix3 g_sensitivity = Matrix3::Zero();          // u/(m/s^2)
  Matrix3 g_squared_sensitivity = Matrix3::Zero();  // u/(m/s^2)^2
  Matrix3 cross_sensitivity = Matrix3::Zero();      // u/(m/s^2)^2; columns: f_y f_z, f_z f_x, f_x f_y

  // VibrationRectification
  Matrix3 vibration_rectification = Matrix3::Zero();  // k, u/(m/s^2)^2; column j: of the vibration along axis j
  double vibration_average = 0;                       // s, not negative; 0: only Imu's vibration counts
  Vector3 vibration_mean_square = Vector3::Zero();    // <v^2>, (m/s^2)^2; Imu sets it from its vibration

  // WhiteNoise
  Vector3 white_density = Vector3::Zero();  // N, u/sqrt(Hz), not negative

  // Flicker
  Vector3 bias_instability = Vector3::Zero();  // B, u, not negative
  double flicker_from_s = 1;                   // the averaging times between which the Allan deviation is flat
  double flicker_to_s = 1000;

  // ExponentiallyCorrelated
  Vector3 correlated_sigma = Vector3::Zero();  // u, standard deviation, not negative
  Vector3 correlation_time = Vector3::Ones();  // s, above 0

  // PopcornNoise
  Vector3 popcorn_noise = Vector3::Zero();  // p, u, not negative
  Vector3 popcorn_time = Vector3::Ones();   // s, the mean time between two changes, at least a sample period

  // RandomWalk
  Vector3 random_walk_density = Vector3::Zero();  // K, u/s/sqrt(Hz), not negative

  // QuantizationNoise
  Vector3 quantization_noise = Vector3::Zero();  // Q, u s, not negative

  // FirFilter
  FirTaps fir_taps;  // the tap of the newest value is first

  // Bandwidth
  SensorFilter filter;

  // ValueRounding
  double lsb = 0.0;  // u, not negative; 0: no rounding
  Rounding rounding = Rounding::toward_zero;
  bool carry = false;  // the remainder of the rounding is added to the next sample

  // Saturation
  double max = 1e6;                  // u, above 0: the limits are +-max,
  std::optional<AxisLimits> limits;  // unless these are given, which differ between axes or directions

  // IncrementRounding
  double increment_lsb = 0.0;  // u s, not negative; 0: no rounding. Above 0, ValueRounding leaves the increments

  // The standard deviations of the constant errors above, from unit to unit and from one power on to another. For the
  // bias of a power on, see turn_on_bias. drawn_errors() draws these errors; the effects do not read these members.
  ConstantErrors unit_sigma, turn_on_sigma;

  // Returns the limits of the axes.
  AxisLimits range() const { return limits.value_or(AxisLimits{Vector3::Constant(-max), Vector3::Constant(max)}); }

  // Returns errors that are only white noise of this density, u/sqrt(Hz), at the sample rate `rate_hz`.
  static TriadErrors white(double density, double rate_hz, double max);
};

}  // namespace imud
