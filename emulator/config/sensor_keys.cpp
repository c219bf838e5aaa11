#include "emulator/config/sensor_keys.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"
#include "protocols/quantities/key_units.hpp"

namespace imud {
namespace {

using namespace sensor_units;
constexpr double root_hour = 60;  // sqrt(s)

// Returns the unit of that name, from the table of the units of all keys.
consteval ErrorUnit unit(std::span<const KeyUnit> units, std::string_view suffix) {
  const KeyUnit* found = find_unit(units, suffix);
  if (found == nullptr || found->offset != 0) throw "no such unit";
  return {found->suffix.substr(1), found->factor};
}

// Reads the bias that depends on the temperature's rate of change and on its history: the terms, or their standard
// deviations.
template <class Terms>
void read_thermal_drift(TableReader& table, const SensorKeys& keys, double least, Terms& e) {
  constexpr double minute = 60;
  std::vector<std::string> suffixes;
  std::vector<ErrorUnit> units;
  for (const ErrorUnit& unit : keys.value) suffixes.push_back(key_of(unit.suffix, "per_c_per_min"));
  for (std::size_t i = 0; i < suffixes.size(); ++i) units.push_back({suffixes[i], minute * keys.value.begin()[i].si});
  e.temperature_rate_bias = in_units(table, "temperature_rate_bias", units, e.temperature_rate_bias, least);
  e.temperature_hysteresis = in_units(table, "temperature_hysteresis", keys.value, e.temperature_hysteresis, least);
}

// Reads standard deviations of one layer. The bias of a power on is a term of its own, turn_on_bias.
void read_spread(TableReader table, const SensorKeys& keys, const AxisLimits& range, bool has_bias,
                 ConstantErrors& sigma) {
  constexpr bool is_sigma = true;
  if (has_bias) sigma.bias = in_units(table, "bias", keys.value, sigma.bias);
  sigma.scale_factor = ppm * table.per_axis("scale_factor_ppm", sigma.scale_factor / ppm, 0, 1e6);
  read_nonlinearity(table, range, is_sigma, sigma);
  // A row of a matrix has one standard deviation: for its off-diagonal elements, or for all elements.
  constexpr double mrad = 1e-3, most = 100;
  const Vector3 misalignment =
      mrad * table.per_axis("misalignment_mrad", sigma.misalignment.rowwise().maxCoeff() / mrad, 0, most);
  sigma.misalignment = misalignment.rowwise().replicate<3>();
  sigma.misalignment.diagonal().setZero();
  const auto rows = [&](std::string_view key, double unit, Matrix3& term) {
    const Vector3 of_rows = unit * table.per_axis(key, Vector3(term.rowwise().maxCoeff()) / unit, 0, huge);
    term = of_rows.rowwise().replicate<3>();
  };
  if (&keys == &gyro_keys) {
    constexpr double per_g = deg / hour / g;
    rows("g_sensitivity_deg_per_hr_per_g", per_g, sigma.g_sensitivity);
    rows("cross_sensitivity_deg_per_hr_per_g2", per_g / g, sigma.cross_sensitivity);
    rows("vibration_rectification_deg_per_hr_per_g2", per_g / g, sigma.vibration_rectification);
  }
  if (&keys == &accelerometer_keys || &keys == &inclinometer_keys) {
    constexpr double ug_per_g2 = 1e-6 / g;
    rows("cross_sensitivity_ug_per_g2", ug_per_g2, sigma.cross_sensitivity);
    rows("vibration_rectification_ug_per_g2", ug_per_g2, sigma.vibration_rectification);
    sigma.vibration_rectification = Matrix3(sigma.vibration_rectification.diagonal().asDiagonal());
  }
  read_temperature_terms(table, keys, is_sigma, sigma.temperature_scale, sigma.temperature_bias);
  read_thermal_drift(table, keys, 0, sigma);
  table.finish();
}

void read_popcorn(TableReader& table, const SensorKeys& keys, double rate_hz, TriadErrors& e) {
  e.popcorn_noise = in_units(table, "popcorn_noise", keys.value, e.popcorn_noise);
  e.popcorn_time = table.per_axis("popcorn_time_s", e.popcorn_time, 1e-6, huge);
  if (!e.popcorn_noise.isZero(0.0) && e.popcorn_time.minCoeff() < 1 / rate_hz)
    table.fault("popcorn_time_s",
                fmt::format("give at least {:.6g}, a period of the sensor's internal rate", 1 / rate_hz));
}

void read_taps(TableReader& table, FirTaps& taps) {
  constexpr std::size_t most = 1024;
  if (!table.has("fir_taps")) return;
  const std::vector<double> numbers = table.numbers("fir_taps", -1e3, 1e3);
  taps.reset();
  if (numbers.empty()) return;
  const double sum = std::accumulate(numbers.begin(), numbers.end(), 0.0);
  if (numbers.size() > most || std::abs(sum) < 1e-6)
    table.fault("fir_taps", fmt::format("give at most {} taps, whose sum, the gain of a constant input, is not 0: it "
                                        "is {:.3g}",
                                        most, sum));
  else
    taps = std::make_shared<const std::vector<double>>(numbers);
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
    .increment_lsb = "lsb_delta_angle_rad",
    .quantization = {{"rad", 1}, {"urad", 1e-6}, {"deg", deg}, {"arcsec", deg / hour}}};

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
    .increment_lsb = "lsb_delta_velocity_m_per_s",
    .quantization = {{"m_per_s", 1}, {"mm_per_s", 1e-3}, {"um_per_s", 1e-6}}};

// An inclinometer is an accelerometer without increments.
const SensorKeys inclinometer_keys = {.value = accelerometer_keys.value,
                                      .white = accelerometer_keys.white,
                                      .white_units = accelerometer_keys.white_units,
                                      .density = accelerometer_keys.density,
                                      .walk = accelerometer_keys.walk,
                                      .ramp = accelerometer_keys.ramp,
                                      .walk_units = accelerometer_keys.walk_units,
                                      .ramp_units = accelerometer_keys.ramp_units,
                                      .increment_lsb = "",
                                      .quantization = {}};

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
    .increment_lsb = "",
    .quantization = {}};

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

namespace {
constexpr std::string_view degrees_of_temperature[] = {"per_c", "per_c2", "per_c3"};
}  // namespace

// A key for each unit of each degree.
void read_temperature_terms(TableReader& table, const SensorKeys& keys, bool is_sigma, Matrix3& scale,
                            Matrix3& bias) {
  for (int degree = 0; degree < 3; ++degree) {
    const std::string_view per = degrees_of_temperature[degree];
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

void read_rare_terms(TableReader& table, const SensorKeys& keys, double rate_hz, TriadErrors& e) {
  e.dead_zone = in_units(table, "dead_zone", keys.value, e.dead_zone);
  read_thermal_drift(table, keys, -huge, e);
  e.temperature_hysteresis_c = table.real("temperature_hysteresis_c", e.temperature_hysteresis_c, 1e-3, 1e4);
  read_popcorn(table, keys, rate_hz, e);
  if (!std::empty(keys.quantization))
    e.quantization_noise = in_units(table, "quantization_noise", keys.quantization, e.quantization_noise);
  read_taps(table, e.fir_taps);
}

namespace {

constexpr std::string_view triad_names[] = {"gyro", "accelerometer", "magnetometer", "inclinometer"};
constexpr std::string_view layer_names[] = {"unit", "turn_on"};

// Reads the loads of one triad. Each row of a matrix has one load, but each degree of the temperature has its own
// load.
void read_loads(TableReader table, std::string_view triad, ConstantErrors& loads) {
  std::size_t i = 0;
  const bool measures_force = triad == "accelerometer" || triad == "inclinometer";
  const auto read = [&](const std::string& key) { return table.per_axis(key, Vector3::Zero(), -1, 1); };
  const auto read_term = [&](auto& term) {
    const std::string key(constant_error_names[i++]);
    if constexpr (std::is_same_v<std::remove_reference_t<decltype(term)>, Vector3>) {
      term = read(key);
    } else if (&term == &loads.temperature_scale || &term == &loads.temperature_bias) {
      for (int degree = 0; degree < 3; ++degree) term.col(degree) = read(key_of(key, degrees_of_temperature[degree]));
    } else {
      const bool has_it =
          triad == "gyro" || (measures_force && &term != &loads.g_sensitivity) || &term == &loads.misalignment;
      if (has_it) term = read(key).rowwise().template replicate<3>();
    }
  };
  for_each_constant(read_term, loads);
  // Clears the loads of elements that are never drawn.
  loads.misalignment.diagonal().setZero();
  if (measures_force) loads.vibration_rectification = Matrix3(loads.vibration_rectification.diagonal().asDiagonal());
  table.finish();
}

// Adds a fault for each load of a term that has no standard deviation, and for each term for which the causes
// explain more than the term's whole variance. `squares`: the sums of the squared loads of the causes so far.
void check_loads(TableReader& table, std::string_view triad, DrawnLayer layer, const ConstantErrors& loads,
                 ConstantErrors sigma, ConstantErrors& squares) {
  constexpr double rounding = 1e-9;
  std::size_t i = 0;
  const auto check = [&](const auto& load, const auto& deviation, auto& square) {
    const std::string_view term = constant_error_names[i++];
    square += load.cwiseAbs2();
    for (int row = 0; row < 3; ++row) {
      const auto loaded = load.row(row).array() != 0.0;
      const std::string where = fmt::format("{} of the {} axis", term, "xyz"[row]);
      if ((loaded && deviation.row(row).array() == 0.0).any())
        table.fault(triad, fmt::format("{} has no standard deviation to share; give {}", where,
                                       layer == DrawnLayer::turn_on && term == "bias"
                                           ? fmt::format("{}.turn_on_bias_*", triad)
                                           : fmt::format("it in {}.{}_sigma", triad,
                                                         layer_names[static_cast<std::size_t>(layer)])));
      if (loaded.any() && square.row(row).maxCoeff() > 1 + rounding)
        table.fault(triad,
                    fmt::format("the squares of the loads of {} add up to {:.4g}; give loads whose squares add "
                                "up to at most 1 over all causes",
                                where, square.row(row).maxCoeff()));
    }
  };
  for_each_constant(check, loads, sigma, squares);
}

bool is_name(std::string_view name) {
  return !name.empty() && name.size() <= 40 && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
}

}  // namespace

void read_causes(TableReader& imu, ImuModel& model) {
  ConstantErrors squares[2][4];
  const TriadErrors no_errors;
  for (TableReader& table : children(imu, "cause", "imu.cause")) {
    Cause cause;
    require(table, "name", "the cause's, by which summary and labels have what it drew");
    cause.name = table.text("name", "");
    if (table.has("name") && !is_name(cause.name)) table.fault("name", "give up to 40 letters, digits, - and _");
    for (const Cause& other : model.causes)
      if (stream_id(other.name) == stream_id(cause.name))
        table.fault("name", fmt::format("gives the random numbers of the cause \"{}\"; give another", other.name));
    cause.layer = table.choice<DrawnLayer>(
        "layer", {{DrawnLayer::unit, layer_names[0]}, {DrawnLayer::turn_on, layer_names[1]}}, DrawnLayer::unit);
    cause.is_per_axis = table.flag("per_axis", false);
    ConstantErrors* const loads[] = {&cause.gyro, &cause.accelerometer, &cause.magnetometer, &cause.inclinometer};
    const TriadErrors* const errors[] = {&model.gyro, &model.accelerometer, &model.magnetometer,
                                         model.inclinometer ? &*model.inclinometer : &no_errors};
    const bool is_of_unit = cause.layer == DrawnLayer::unit;
    for (std::size_t i = 0; i < std::size(loads); ++i) {
      // The key is known, but has no values in the resolved configuration of an imu without inclinometers.
      if (errors[i] == &no_errors && !table.has(triad_names[i])) continue;
      read_loads(table.child(triad_names[i]), triad_names[i], *loads[i]);
      ConstantErrors sigma = is_of_unit ? errors[i]->unit_sigma : errors[i]->turn_on_sigma;
      if (!is_of_unit) sigma.bias = errors[i]->turn_on_bias;
      check_loads(table, triad_names[i], cause.layer, *loads[i], sigma, squares[is_of_unit ? 0 : 1][i]);
    }
    if (std::ranges::none_of(loads, [](const ConstantErrors* load) { return load->is_on(); }))
      table.fault("name", "needs loads: the correlation of terms with it, such as gyro.bias = 0.5");
    table.finish();
    model.causes.push_back(std::move(cause));
  }
}

void read_vibration_average(TableReader& table, TriadErrors& e) {
  e.vibration_average = table.real("vibration_average_s", e.vibration_average, 0, huge);
}

}  // namespace imud
