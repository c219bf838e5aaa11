// SensorKeys: the names and units of the keys of gyros, accelerometers, magnetometers and inclinometers, and the
// reading of a term in the unit in which it is given.
#pragma once

#include <fmt/format.h>

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/units.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/plan/keys.hpp"

namespace imud {

namespace sensor_units {
inline constexpr double huge = keys::largest, ppm = 1e-6, hour = 3600, deg = units::degree,
                        g = units::standard_gravity;
}  // namespace sensor_units

// A unit as a key ends, and its value in SI.
struct ErrorUnit {
  std::string_view suffix;
  double si;
};

// The keys of one kind of sensor. A term has the units of IEEE Std 952 and 1293, and of data sheets.
struct SensorKeys {
  std::initializer_list<ErrorUnit> value;        // of max, lsb and the bias terms
  std::string_view white;                        // name of the integral of its white noise; empty: no key
  std::initializer_list<ErrorUnit> white_units;  // units of the key `white`
  std::initializer_list<ErrorUnit> density;      // of noise_density
  std::string_view walk, ramp;                   // the names of its random walk and its ramp
  std::initializer_list<ErrorUnit> walk_units, ramp_units;
  std::string_view increment_lsb;                 // empty: it has no increments
  std::initializer_list<ErrorUnit> quantization;  // of quantization_noise; empty: it has no increments
};

extern const SensorKeys gyro_keys, accelerometer_keys, magnetometer_keys, inclinometer_keys;

inline std::string key_of(std::string_view stem, std::string_view suffix) {
  return fmt::format("{}_{}", stem, suffix);
}

// Returns the first unit in which the term is given; nullptr if there is none.
const ErrorUnit* given_unit(TableReader& table, std::string_view stem, std::span<const ErrorUnit> units);

// Reads a term in the unit in which it is given, with read(key, fallback, unit). Adds a fault if it is given twice.
// The first unit is the unit of `fallback`.
template <class Value, class Read>
Value in_given_unit(TableReader& table, std::string_view stem, std::span<const ErrorUnit> units,
                    const Value& fallback, Read read) {
  const ErrorUnit* given = given_unit(table, stem, units);
  if (given == nullptr) return read(key_of(stem, units.begin()->suffix), fallback);
  Value value = fallback;
  for (const ErrorUnit& unit : units) {
    const std::string key = key_of(stem, unit.suffix);
    if (!table.has(key)) continue;
    const Value si = unit.si * read(key, Value(fallback / unit.si));
    if (&unit == given)
      value = si;
    else
      table.fault(key, fmt::format("give either this or {}, not both", key_of(stem, given->suffix)));
  }
  return value;
}

// Reads three numbers, or one, each at least `min` in the unit that is given.
Vector3 in_units(TableReader& table, std::string_view stem, std::span<const ErrorUnit> units, const Vector3& fallback,
                 double min = 0);
double number_in_units(TableReader& table, std::string_view stem, std::span<const ErrorUnit> units, double fallback,
                       double min);

// Read the terms of the deviation from the straight line, and the polynomials over the temperature. `is_sigma`:
// the values are standard deviations of the terms, which are at least 0. `Terms` is TriadErrors or ConstantErrors.
template <class Terms>
void read_nonlinearity(TableReader& table, const AxisLimits& range, bool is_sigma, Terms& terms) {
  using sensor_units::ppm;
  const double least = is_sigma ? 0 : -1e6;
  const auto in_ppm = [&](std::string_view key, const Vector3& unit, Vector3& term) {
    term = unit.cwiseProduct(table.per_axis(key, term.cwiseQuotient(unit), least, 1e6));
  };
  // A deviation of p ppm of the range at the end of the range.
  const auto upper = range.upper.array();
  in_ppm("scale_factor_asymmetry_ppm", Vector3::Constant(ppm), terms.scale_factor_asymmetry);
  in_ppm("quadratic_ppm_of_range", ppm / upper, terms.quadratic);
  in_ppm("cubic_ppm_of_range", ppm / (upper * upper), terms.cubic);
}
void read_temperature_terms(TableReader& table, const SensorKeys& keys, bool is_sigma, Matrix3& scale, Matrix3& bias);

// Read the terms of core/effects/rare beside the sensitivities to acceleration, and the averaging time of the
// vibration.
void read_rare_terms(TableReader& table, const SensorKeys& keys, double rate_hz, TriadErrors& errors);
void read_vibration_average(TableReader& table, TriadErrors& errors);

// Reads the tables of standard deviations, `unit_sigma` and `turn_on_sigma`, into the members of these names.
void read_spreads(TableReader& table, const SensorKeys& keys, TriadErrors& errors);

}  // namespace imud
