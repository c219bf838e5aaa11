// Reads the errors of gyros, accelerometers, magnetometers and inclinometers in SI or in the units of data sheets.
// The keys name the units.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "core/allan_terms.hpp"
#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/sensor_keys.hpp"

namespace imud {
namespace {

using namespace sensor_units;

// A walk x <- A x + P n grows without limit, exponentially, if an eigenvalue of A is larger than 1.
void check_growth(TableReader& table, const TriadErrors& e) {
  constexpr double rounding = 1e-9;
  const double radius = e.walk_transition.eigenvalues().cwiseAbs().maxCoeff();
  if (radius <= 1.0 + rounding) return;
  if ((e.walk_bound.array() > 0.0).all())
    table.warn("walk_transition",
               fmt::format("its spectral radius is {:.6g}, so the walk grows to its bound", radius));
  else
    table.fault("walk_transition", fmt::format("its spectral radius is {:.6g}, so the walk grows exponentially; give "
                                               "a matrix of at most 1, or a walk_bound for each axis",
                                               radius));
}

// The density of white noise is two-sided here. The density of a data sheet may be one-sided: then its square is
// twice as large. `base` tells how the present value of `e` was stated.
void read_white_noise(TableReader& table, const SensorKeys& keys, Sidedness base, TriadErrors& e) {
  const bool was_one_sided = base == Sidedness::one_sided;
  const bool one_sided =
      table.choice<bool>("noise_density_sidedness", {{false, "two_sided"}, {true, "one_sided"}}, was_one_sided);
  if (base != Sidedness::none && one_sided != was_one_sided) e.white_density *= std::sqrt(one_sided ? 0.5 : 2.0);
  const ErrorUnit* density = given_unit(table, "noise_density", keys.density);
  if (!keys.white.empty()) {
    const ErrorUnit* integral = given_unit(table, keys.white, keys.white_units);
    if (integral != nullptr && density != nullptr)
      table.fault(key_of("noise_density", density->suffix),
                  fmt::format("give either this or {}, not both", key_of(keys.white, integral->suffix)));
    if (density == nullptr) {
      e.white_density = in_units(table, keys.white, keys.white_units, e.white_density);
      return;
    }
  }
  e.white_density = in_units(table, "noise_density", keys.density, e.white_density);
  if (one_sided && density != nullptr) e.white_density *= std::sqrt(0.5);
}

// Reads the minimum of the Allan deviation. Returns the bias instability B that gives this minimum together with N
// and K.
Vector3 read_bias_minimum(TableReader& table, const SensorKeys& keys, const ErrorUnit& unit, const TriadErrors& e,
                          double rate_hz) {
  const Vector3 minimum = in_units(table, "bias_minimum", keys.value, Vector3::Zero());
  const std::array<AllanTerms, 3> terms = allan_terms(e, rate_hz);
  Vector3 coefficient = Vector3::Zero();
  double least = 0;
  for (int i = 0; i < 3; ++i) {
    const auto& [N, B, K, Q, R] = terms[static_cast<std::size_t>(i)];
    if (const auto found = bias_instability_of(minimum[i], N, K))
      coefficient[i] = *found;
    else if (minimum[i] != 0)
      least = std::max(least, AllanTerms{.N = N, .K = K}.minimum());
  }
  if (least > 0)
    table.fault(
        key_of("bias_minimum", unit.suffix),
        fmt::format("white noise and random walk alone make a minimum of {:.4g}; give at least that, or 0 for "
                    "no bias instability",
                    least / unit.si));
  return coefficient;
}

// Read after the terms on which the minimum depends.
void read_bias_instability(TableReader& table, const SensorKeys& keys, TriadErrors& e, double rate_hz) {
  const ErrorUnit* coefficient = given_unit(table, "bias_instability", keys.value);
  const ErrorUnit* minimum = given_unit(table, "bias_minimum", keys.value);
  if (minimum != nullptr && coefficient != nullptr)
    table.fault(key_of("bias_minimum", minimum->suffix),
                fmt::format("give either this or {}, not both", key_of("bias_instability", coefficient->suffix)));
  e.bias_instability = minimum != nullptr ? read_bias_minimum(table, keys, *minimum, e, rate_hz)
                                          : in_units(table, "bias_instability", keys.value, e.bias_instability);
  // The first process of the cascade cannot be shorter than two samples.
  const double shortest_s = 2 / rate_hz * e.flicker_from_s / Flicker::first_correlation_time(e.flicker_from_s);
  constexpr double margin = 1 + 1e-9;
  e.flicker_from_s =
      table.real("bias_instability_from_s", std::max(e.flicker_from_s, margin * shortest_s), 1e-3, huge);
  e.flicker_to_s = table.real("bias_instability_to_s", std::max(e.flicker_to_s, 2 * e.flicker_from_s), 1e-3, huge);
  if (e.bias_instability.isZero(0.0)) return;
  if (e.flicker_to_s < 2 * e.flicker_from_s || e.flicker_to_s > 1e6 * e.flicker_from_s)
    table.fault("bias_instability_to_s",
                fmt::format("give an averaging time from {} to {}: 2 to 1000000 times bias_instability_from_s",
                            2 * e.flicker_from_s, 1e6 * e.flicker_from_s));
  else if (Flicker::first_correlation_time(e.flicker_from_s) < 2 / rate_hz)
    table.fault("bias_instability_from_s",
                fmt::format("too short for a sensor of {} Hz; give at least {:.3g}", rate_hz, shortest_s));
}

// Reads the range. An absent lower limit is the product's lower limit if the product has its own, else
// -max.
void read_range(TableReader& table, const SensorKeys& keys, TriadErrors& e) {
  auto [lower, upper] = e.range();
  const bool is_symmetric = lower == -upper;
  const auto read = [&](std::string_view stem, const Vector3& fallback, double min, double max) {
    return in_given_unit(table, stem, keys.value, fallback, [&](const std::string& key, const Vector3& absent) {
      const Vector3 limit = table.per_axis(key, absent, min, max);
      if (limit == Vector3::Constant(limit[0])) table.resolve(key, limit[0]);
      return limit;
    });
  };
  upper = read("max", upper, 1e-12, huge);
  lower = read("min", is_symmetric ? Vector3(-upper) : lower, -huge, 0);
  e.max = upper.maxCoeff();
  e.limits = {lower, upper};
  if (lower == Vector3::Constant(-e.max) && upper == Vector3::Constant(e.max)) e.limits.reset();
}

// Reads the matrix and the curve between input and output.
void read_response(TableReader& table, TriadErrors& e) {
  e.misalignment = table.matrix3("misalignment", e.misalignment, false);
  constexpr double largest = 0.2;  // rad: a larger angle is a wrong axis, not a misalignment
  const double distance = (e.misalignment - Matrix3::Identity()).cwiseAbs().maxCoeff();
  if (!(distance <= largest))
    table.fault("misalignment", fmt::format("an element differs from the identity's by {:.3g}, at most {} is a "
                                            "misalignment; use [imu.mounting] to turn the sensor",
                                            distance, largest));
  e.scale_factor = table.vector3("scale_factor", e.scale_factor);
  read_nonlinearity(table, e.range(), false, e);
}

// Reads the filter, of at most one kind, at whose output a sample is taken.
void read_filter(TableReader& table, SensorFilter& filter, double rate_hz) {
  constexpr double below = 0.45;  // share of the rate: above, the filter has no room to fall
  filter.cut_off_hz = table.per_axis("low_pass_hz", filter.cut_off_hz, 0.0, huge);
  if (!(filter.cut_off_hz.maxCoeff() < below * rate_hz))
    table.fault("low_pass_hz", fmt::format("give less than {:.6g}, {} of the sensor's internal rate of {:.6g} Hz, or "
                                           "raise internal_rate_hz; 0: no filter",
                                           below * rate_hz, below, rate_hz));
  const auto integer = [&table](std::string_view key, int fallback, int most) {
    return static_cast<int>(
        table.unsigned_integer(key, static_cast<std::uint64_t>(fallback), static_cast<std::uint64_t>(most)));
  };
  filter.order = integer("low_pass_order", filter.order, 4);
  if (filter.order != 1 && filter.order != 2 && filter.order != 4) table.fault("low_pass_order", "give 1, 2 or 4");
  constexpr double least_damping = 0.05, most_damping = 10;
  filter.damping = table.real("low_pass_damping", filter.damping, 0, most_damping);
  if (filter.damping > 0 && (filter.damping < least_damping || filter.order != 2))
    table.fault("low_pass_damping", fmt::format("needs low_pass_order = 2; give {} to {}, or 0 for Butterworth",
                                                least_damping, most_damping));
  const bool is_cic = filter.stages > 1;
  const int samples = integer("boxcar_samples", is_cic ? 1 : filter.length, SensorFilter::max_length);
  const int order = integer("cic_order", is_cic ? filter.stages : 0, SensorFilter::max_stages);
  const int length = integer("cic_length", is_cic ? filter.length : 1, SensorFilter::max_length);
  if (order > 0 && length <= 1) table.fault("cic_length", "a CIC needs a length of at least 2 samples");
  if (order == 0 && length > 1) table.fault("cic_order", "cic_length is that of a CIC; give its order, 1 to 8");
  const bool has_low_pass = !filter.cut_off_hz.isZero(0.0);
  if (order > 0 && (has_low_pass || samples > 1))
    table.fault("cic_order",
                "there is another filter; give cic_order = 0, or low_pass_hz = 0 and boxcar_samples = 1");
  else if (has_low_pass && samples > 1)
    table.fault("boxcar_samples", "there is another filter; give boxcar_samples = 1, or low_pass_hz = 0");
  filter.stages = order > 0 ? order : 1;
  filter.length = std::max(order > 0 ? length : samples, 1);
}

TriadErrors read_triad(TableReader& table, const SensorKeys& keys, const TriadErrors* product, double rate_hz,
                       Sidedness density) {
  TriadErrors e;
  if (product != nullptr)
    e = *product;
  else if (given_unit(table, "max", keys.value) == nullptr)
    require(table, key_of("max", keys.value.begin()->suffix), "the largest value that the sensor can measure");
  read_range(table, keys, e);
  e.reference_temperature_c = table.real("reference_temperature_c", e.reference_temperature_c, -273.15, 1e4);
  read_temperature_terms(table, keys, false, e.temperature_scale, e.temperature_bias);
  read_response(table, e);
  e.bias = in_units(table, "bias", keys.value, e.bias, -huge);
  e.turn_on_bias = in_units(table, "turn_on_bias", keys.value, e.turn_on_bias);
  e.ramp = in_units(table, keys.ramp, keys.ramp_units, e.ramp, -huge);
  read_white_noise(table, keys, density, e);
  e.correlated_sigma = in_units(table, "correlated_noise", keys.value, e.correlated_sigma);
  e.correlation_time = table.per_axis("correlation_time_s", e.correlation_time, 1e-6, huge);
  e.random_walk_density = in_units(table, keys.walk, keys.walk_units, e.random_walk_density);
  read_rare_terms(table, keys, rate_hz, e);
  read_filter(table, e.filter, rate_hz);
  e.lsb = number_in_units(table, "lsb", keys.value, e.lsb, 0);
  e.rounding = table.choice<Rounding>("rounding",
                                      {{Rounding::toward_zero, "toward_zero"},
                                       {Rounding::nearest, "nearest"},
                                       {Rounding::away_from_zero, "away_from_zero"}},
                                      e.rounding);
  e.carry = table.flag("carry", e.carry);
  if (!keys.increment_lsb.empty()) e.increment_lsb = table.real(keys.increment_lsb, e.increment_lsb, 0.0, huge);
  e.walk_transition = table.matrix3("walk_transition", e.walk_transition, true);
  e.walk_sqrt_cov = table.matrix3("walk_sqrt_cov", e.walk_sqrt_cov, true);
  e.walk_bound = table.vector3("walk_bound", e.walk_bound);
  if ((e.walk_bound.array() < 0.0).any()) table.fault("walk_bound", "give numbers of at least 0 (0: no bound)");
  check_growth(table, e);
  read_spreads(table, keys, e);
  read_bias_instability(table, keys, e, rate_hz);
  return e;
}

// The vehicle's iron stands between the field and the sensor: m = k M S B + M h, with the misalignment M and the
// scale factor k, which does not act on h.
void read_iron(TableReader& table, TriadErrors& e) {
  const Matrix3 soft = table.matrix3("soft_iron", Matrix3::Identity(), false);
  constexpr double largest = 0.9;
  const double distance = (soft - Matrix3::Identity()).cwiseAbs().maxCoeff();
  if (!(distance <= largest) || !(soft.determinant() > 0))
    table.fault("soft_iron", fmt::format("give three rows of three numbers, each within {} of the identity's, with a "
                                         "determinant above 0",
                                         largest));
  e.bias += e.misalignment * in_units(table, "hard_iron", magnetometer_keys.value, Vector3::Zero(), -huge);
  e.misalignment *= soft;
}

// Reads the errors of sensors of specific force.
TriadErrors read_force_sensors(TableReader& table, const SensorKeys& keys, const TriadErrors* product, double rate_hz,
                               Sidedness density) {
  TriadErrors e = read_triad(table, keys, product, rate_hz, density);
  const double ug_per_g2 = 1e-6 / g;
  const Vector3 rectification =
      ug_per_g2 * table.per_axis("vibration_rectification_ug_per_g2",
                                 Vector3(e.vibration_rectification.diagonal()) / ug_per_g2, -huge, huge);
  e.vibration_rectification = rectification.asDiagonal();
  read_vibration_average(table, e);
  e.g_squared_sensitivity =
      ug_per_g2 * table.matrix3("g_squared_sensitivity_ug_per_g2", e.g_squared_sensitivity / ug_per_g2, true);
  e.cross_sensitivity =
      ug_per_g2 * table.matrix3("cross_sensitivity_ug_per_g2", e.cross_sensitivity / ug_per_g2, true);
  table.finish();
  return e;
}

}  // namespace

TriadErrors read_gyro(TableReader table, const TriadErrors* product, double rate_hz, Sidedness density) {
  TriadErrors e = read_triad(table, gyro_keys, product, rate_hz, density);
  const double per_g = deg / hour / g, per_g2 = per_g / g;
  e.g_sensitivity = per_g * table.matrix3("g_sensitivity_deg_per_hr_per_g", e.g_sensitivity / per_g, true);
  e.g_squared_sensitivity =
      per_g2 * table.matrix3("g_squared_sensitivity_deg_per_hr_per_g2", e.g_squared_sensitivity / per_g2, true);
  e.cross_sensitivity =
      per_g2 * table.matrix3("cross_sensitivity_deg_per_hr_per_g2", e.cross_sensitivity / per_g2, true);
  e.vibration_rectification =
      per_g2 * table.matrix3("vibration_rectification_deg_per_hr_per_g2", e.vibration_rectification / per_g2, true);
  read_vibration_average(table, e);
  table.finish();
  return e;
}

TriadErrors read_accelerometer(TableReader table, const TriadErrors* product, double rate_hz, Sidedness density) {
  return read_force_sensors(table, accelerometer_keys, product, rate_hz, density);
}

TriadErrors read_inclinometer(TableReader table, const TriadErrors* product, double rate_hz, Sidedness density) {
  return read_force_sensors(table, inclinometer_keys, product, rate_hz, density);
}

TriadErrors read_magnetometer(TableReader table, const TriadErrors* product, double rate_hz, CurrentField& current) {
  const std::optional<PresetErrors> named = read_field_model(
      table, [](const PresetErrors& errors) { return errors.magnetometer.has_value(); }, rate_hz);
  TriadErrors e = read_triad(table, magnetometer_keys, named ? &*named->magnetometer : product, rate_hz,
                             named ? named->magnetometer_density : Sidedness::none);
  read_iron(table, e);
  std::vector<std::string> suffixes;
  std::vector<ErrorUnit> units;
  for (const ErrorUnit& unit : magnetometer_keys.value) suffixes.push_back(key_of(unit.suffix, "per_a"));
  for (std::size_t i = 0; i < suffixes.size(); ++i)
    units.push_back({suffixes[i], magnetometer_keys.value.begin()[i].si});
  current.field = in_units(table, "current_field", units, Vector3::Zero(), -huge);
  current.sigma = in_units(table, "current_field_sigma", units, Vector3::Zero());
  table.finish();
  return e;
}

}  // namespace imud
