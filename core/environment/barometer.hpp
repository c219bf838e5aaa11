// Barometer: the static pressure that a sensor measures.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "core/numbers/correlated_noise.hpp"
#include "core/numbers/elementary.hpp"
#include "core/numbers/random.hpp"
#include "core/numbers/round_to.hpp"

namespace imud {

// The errors of a barometer. The default of every member switches its effect off.
struct BarometerErrors {
  double lag_s = 0;                   // time constant of the pressure port, not negative
  double bias = 0;                    // Pa
  double drift = 0;                   // Pa, standard deviation, not negative
  double drift_correlation_s = 3600;  // above 0
  double noise = 0;                   // Pa, standard deviation of one sample, not negative
  double bias_sigma = 0;              // Pa, standard deviation from unit to unit, not negative
  double temperature_bias = 0;        // Pa/K, from the reference temperature
  double reference_temperature_c = 25;
  double lsb = 0;                             // Pa, not negative; 0: no rounding
  double least = 0, largest = huge_pressure;  // Pa: the range
  // The port's error in units of the dynamic pressure q, at the angles of attack alpha and of sideslip beta, rad.
  // Both angles are 0 if the air flows along the body's x axis; z points down. Without wind both follow from the
  // velocity.
  //   p <- p + q (c + c_alpha alpha + c_beta beta^2)
  double port = 0, port_per_attack = 0, port_per_sideslip2 = 0;
  double port_sigma = 0;  // standard deviation of c from unit to unit, not negative

  static constexpr double huge_pressure = 1e12;
  bool has_port_error() const noexcept { return port != 0 || port_per_attack != 0 || port_per_sideslip2 != 0; }
};

// The flow at the port.
struct AirFlow {
  Vector3 velocity_B = Vector3::Zero();    // m/s, of the vehicle relative to the air, for the angles
  std::optional<double> airspeed;          // m/s; nullopt: the magnitude of that velocity
  std::optional<double> dynamic_pressure;  // Pa; nullopt: by airspeed and density
};

// Returns the error of a port in that flow, Pa, at the static pressure, Pa. The density is the one that the standard
// atmosphere has at that pressure, below 11 km (ISO 2533:1975).
inline double port_error(const BarometerErrors& errors, const AirFlow& flow, double pressure) noexcept {
  const double speed = flow.velocity_B.norm(), airspeed = flow.airspeed.value_or(speed);
  constexpr double gas_constant = 287.05287, sea_level = 101325, sea_level_k = 288.15, exponent = 0.190263;
  const double ratio = std::max(pressure, 1.0) / sea_level;
  const double temperature_k = sea_level_k * elementary::exp(exponent * elementary::log(ratio));
  const double q =
      flow.dynamic_pressure.value_or(0.5 * pressure / (gas_constant * temperature_k) * airspeed * airspeed);
  if (!(speed > 0.1)) return q * errors.port;  // m/s: no direction
  const double attack = elementary::atan2(flow.velocity_B.z(), flow.velocity_B.x());
  const double along =
      std::sqrt(flow.velocity_B.x() * flow.velocity_B.x() + flow.velocity_B.z() * flow.velocity_B.z());
  const double sideslip = elementary::atan2(flow.velocity_B.y(), along);
  return q * (errors.port + errors.port_per_attack * attack + errors.port_per_sideslip2 * sideslip * sideslip);
}

// With samples of period T, the true pressure p becomes
//   y <- y + (1 - exp(-T/lag)) (p - y), the response of a port to a pressure that is constant between samples; y = p
//        in the first sample of a run
//   m = y + bias + s u + c (T - T0) + b + noise n, with a deviate u of the unit, the temperature T, exponentially
//       correlated noise b as drift and n ~ N(0, 1); then rounded to the LSB, and limited to the range
// Does not allocate, lock or throw; not thread-safe.
class Barometer {
 public:
  Barometer(const BarometerErrors& errors, double period_s) noexcept
      : errors_(errors),
        response_(errors.lag_s > 0 ? 1 - elementary::exp(-period_s / errors.lag_s) : 1),
        drift_(Vector3(errors.drift, 0, 0), Vector3::Constant(errors.drift_correlation_s), period_s,
               Quantity::pressure) {}

  // The errors that differ from unit to unit: of the pressure, Pa, and of the coefficient `port`.
  struct Drawn {
    double bias = 0, port = 0;
  };
  static Drawn drawn(const BarometerErrors& errors, const Normals& of_unit) noexcept {
    const auto draw = [&](double sigma, std::uint64_t number) {
      return sigma > 0 ? sigma * of_unit(Quantity::pressure, Process::unit_draw, number).x() : 0;
    };
    return {draw(errors.bias_sigma, 0), draw(errors.port_sigma, 1)};
  }
  // Adds the errors that are drawn for the unit. Must be called only once.
  void draw(const Normals& of_unit) noexcept {
    const Drawn drawn_for_unit = drawn(errors_, of_unit);
    drawn_ = drawn_for_unit.bias;
    errors_.port += drawn_for_unit.port;
  }
  const BarometerErrors& errors() const noexcept { return errors_; }
  // Returns the measured pressure of sample k, Pa. `pressure`: Pa, at the port; `temperature_c`: degrees Celsius, of
  // the sensor. The last call must have been for sample k - 1, or seek(k).
  double measure(double pressure, const Normals& normals, std::uint64_t k, double temperature_c = 25) noexcept {
    if (!is_settled_) lagged_ = pressure;
    is_settled_ = true;
    lagged_ = response_ == 1 ? pressure : lagged_ + response_ * (pressure - lagged_);
    pass(normals, k);
    double measured = lagged_ + errors_.bias + drift_.value().x() + drawn_ +
                      errors_.temperature_bias * (temperature_c - errors_.reference_temperature_c);
    if (errors_.noise > 0) measured += errors_.noise * normals(Quantity::pressure, Process::gauss_markov, k).x();
    if (errors_.lsb > 0) measured = round_to(measured, errors_.lsb);
    return std::clamp(measured, errors_.least, errors_.largest);
  }
  // Passes sample k, in which no pressure is known: the drift continues.
  void pass(const Normals& normals, std::uint64_t k) noexcept {
    if (drift_.is_on()) drift_.next(normals, k);
  }
  // Makes sample k the next, with the drift that sample k has in the sequence from sample 0. The lag settles on the
  // pressure of sample k. The run time is proportional to k if there is a drift.
  void seek(const Normals& normals, std::uint64_t k) noexcept {
    is_settled_ = false;
    drift_.seek(normals, k);
  }
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    if (drift_.is_on()) drift_.each_sequence(visit);
  }
  // Makes sample k the next, with the memory of `before`.
  void continue_from(const Barometer& before, const Normals& normals, std::uint64_t k) noexcept {
    drift_.continue_from(before.drift_, normals, k);
    lagged_ = before.lagged_;
    is_settled_ = before.is_settled_;
  }
  // Makes the next sample the first of a run.
  void begin_run() noexcept { is_settled_ = false; }

 private:
  BarometerErrors errors_;
  double response_;
  CorrelatedNoise drift_;  // on x
  double lagged_ = 0;
  double drawn_ = 0;  // Pa, the bias of the unit
  bool is_settled_ = false;
};

}  // namespace imud
