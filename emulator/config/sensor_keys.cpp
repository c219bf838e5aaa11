#include "emulator/config/sensor_keys.hpp"

#include <vector>

#include "core/units.hpp"
#include "protocols/quantities/key_units.hpp"

namespace imud {
namespace {

using namespace sensor_units;
constexpr double root_hour = 60;  // sqrt(s)

// Returns the unit of that name from the table of all keys' units.
consteval ErrorUnit unit(std::span<const KeyUnit> units, std::string_view suffix) {
  const KeyUnit* found = find_unit(units, suffix);
  if (found == nullptr || found->offset != 0) throw "no such unit";
  return {found->suffix.substr(1), found->factor};
}

// Reads standard deviations of one layer. The bias of a power on is a term of its own, turn_on_bias.
void read_spread(TableReader table, const SensorKeys& keys, const AxisLimits& range, bool has_bias,
                 ConstantErrors& sigma) {
  constexpr bool is_sigma = true;
  if (has_bias) sigma.bias = in_units(table, "bias", keys.value, sigma.bias);
  sigma.scale_factor = ppm * table.per_axis("scale_factor_ppm", sigma.scale_factor / ppm, 0, 1e6);
  read_nonlinearity(table, range, is_sigma, sigma);
  // A row of a matrix has one standard deviation: of its elements beside the diagonal, or of all.
  constexpr double mrad = 1e-3, most = 100;
  const Vector3 misalignment =
      mrad * table.per_axis("misalignment_mrad", sigma.misalignment.rowwise().maxCoeff() / mrad, 0, most);
  sigma.misalignment = misalignment.rowwise().replicate<3>();
  sigma.misalignment.diagonal().setZero();
  if (&keys == &gyro_keys) {
    constexpr double per_g = deg / hour / g;
    const Vector3 sensitivity =
        per_g * table.per_axis("g_sensitivity_deg_per_hr_per_g", sigma.g_sensitivity.col(0) / per_g, 0, huge);
    sigma.g_sensitivity = sensitivity.rowwise().replicate<3>();
  }
  read_temperature_terms(table, keys, is_sigma, sigma.temperature_scale, sigma.temperature_bias);
  table.finish();
}

}  // namespace

const SensorKeys gyro_keys = {
    .value = {unit(key_units::rate, "_rad_per_s"), unit(key_units::rate, "_deg_per_s"),
              unit(key_units::rate, "_deg_per_hr")},
    .white = "angle_random_walk",
    .white_units = {{"rad_per_rt_s", 1}, {"deg_per_rt_s", deg}, {"deg_per_rt_hr", deg / root_hour}},
    .density = {{"rad_per_s_per_rt_hz", 1},
                {"deg_per_s_per_rt_hz", deg},
                {"mdeg_per_s_per_rt_hz", 1e-3 * deg},
                {"deg_per_hr_per_rt_hz", deg / hour}},
    .walk = "rate_random_walk",
    .ramp = "rate_ramp",
    .walk_units = {{"rad_per_s_per_rt_s", 1},
                   {"deg_per_s_per_rt_s", deg},
                   {"deg_per_hr_per_rt_hr", deg / hour / root_hour}},
    .ramp_units = {{"rad_per_s2", 1}, {"deg_per_s2", deg}, {"deg_per_hr_per_hr", deg / hour / hour}},
    .increment_lsb = "lsb_delta_angle_rad"};

const SensorKeys accelerometer_keys = {
    .value = {unit(key_units::acceleration, "_m_per_s2"), unit(key_units::acceleration, "_g"),
              unit(key_units::acceleration, "_mg"), unit(key_units::acceleration, "_ug")},
    .white = "velocity_random_walk",
    .white_units = {{"m_per_s_per_rt_s", 1}, {"m_per_s_per_rt_hr", 1 / root_hour}},
    .density = {{"m_per_s2_per_rt_hz", 1}, {"mg_per_rt_hz", 1e-3 * g}, {"ug_per_rt_hz", 1e-6 * g}},
    .walk = "acceleration_random_walk",
    .ramp = "acceleration_ramp",
    .walk_units = {{"m_per_s2_per_rt_s", 1},
                   {"mg_per_rt_hr", 1e-3 * g / root_hour},
                   {"ug_per_rt_hr", 1e-6 * g / root_hour}},
    .ramp_units = {{"m_per_s3", 1}, {"mg_per_hr", 1e-3 * g / hour}, {"ug_per_hr", 1e-6 * g / hour}},
    .increment_lsb = "lsb_delta_velocity_m_per_s"};

const SensorKeys magnetometer_keys = {
    .value = {unit(key_units::magnetic_field, "_t"), unit(key_units::magnetic_field, "_ut"),
              unit(key_units::magnetic_field, "_nt")},
    .white = "",
    .white_units = {},
    .density = {{"t_per_rt_hz", 1}, {"ut_per_rt_hz", 1e-6}, {"nt_per_rt_hz", 1e-9}},
    .walk = "field_random_walk",
    .ramp = "field_ramp",
    .walk_units = {{"t_per_rt_s", 1}, {"nt_per_rt_s", 1e-9}},
    .ramp_units = {{"t_per_s", 1}, {"nt_per_hr", 1e-9 / hour}},
    .increment_lsb = ""};

const ErrorUnit* given_unit(TableReader& table, std::string_view stem, std::span<const ErrorUnit> units) {
  const ErrorUnit* given = nullptr;
  for (const ErrorUnit& unit : units)
    if (table.has(key_of(stem, unit.suffix)) && given == nullptr) given = &unit;
  return given;
}

Vector3 in_units(TableReader& table, std::string_view stem, std::span<const ErrorUnit> units, const Vector3& fallback,
                 double min) {
  return in_given_unit(table, stem, units, fallback, [&](const std::string& key, const Vector3& absent) {
    return table.per_axis(key, absent, min, huge);
  });
}

double number_in_units(TableReader& table, std::string_view stem, std::span<const ErrorUnit> units, double fallback,
                       double min) {
  return in_given_unit(table, stem, units, fallback,
                       [&](const std::string& key, double absent) { return table.real(key, absent, min, huge); });
}

// A key for each unit of each degree.
void read_temperature_terms(TableReader& table, const SensorKeys& keys, bool is_sigma, Matrix3& scale,
                            Matrix3& bias) {
  constexpr std::string_view powers[] = {"per_c", "per_c2", "per_c3"};
  for (int degree = 0; degree < 3; ++degree) {
    const std::string_view per = powers[degree];
    scale.col(degree) =
        ppm * table.per_axis(key_of("temperature_scale_ppm", per), scale.col(degree) / ppm, is_sigma ? 0 : -1e6, 1e6);
    std::vector<std::string> suffixes;
    std::vector<ErrorUnit> units;
    for (const ErrorUnit& unit : keys.value) suffixes.push_back(key_of(unit.suffix, per));
    for (std::size_t i = 0; i < suffixes.size(); ++i) units.push_back({suffixes[i], keys.value.begin()[i].si});
    bias.col(degree) = in_units(table, "temperature_bias", units, bias.col(degree), is_sigma ? 0 : -huge);
  }
}

void read_spreads(TableReader& table, const SensorKeys& keys, TriadErrors& errors) {
  const AxisLimits range = errors.range();
  if (table.has("unit_sigma") || errors.unit_sigma.is_on())
    read_spread(table.child("unit_sigma"), keys, range, true, errors.unit_sigma);
  if (table.has("turn_on_sigma") || errors.turn_on_sigma.is_on())
    read_spread(table.child("turn_on_sigma"), keys, range, false, errors.turn_on_sigma);
}

}  // namespace imud
