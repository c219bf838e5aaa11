// The errors of barometers and navigation solutions in a configuration.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include "core/gps_time.hpp"
#include "core/navigation/navigator.hpp"
#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/ground/rinex_navigation.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/ground/yuma_almanac.hpp"

namespace imud {
namespace {
constexpr double most = 1e6;
}

void read_barometer(TableReader table, BarometerErrors& errors) {
  const auto has_barometer = [](const PresetErrors& preset) { return preset.barometer.has_value(); };
  if (const auto named = read_field_model(table, has_barometer, 1.0)) errors = *named->barometer;
  errors.lag_s = table.real("lag_s", errors.lag_s, 0, most);
  errors.bias = table.real("bias_pa", errors.bias, -most, most);
  errors.drift = table.real("drift_pa", errors.drift, 0, most);
  errors.drift_correlation_s = table.real("drift_correlation_s", errors.drift_correlation_s, 1e-3, 1e9);
  errors.noise = table.real("noise_pa", errors.noise, 0, most);
  errors.bias_sigma = table.real("bias_sigma_pa", errors.bias_sigma, 0, most);
  errors.temperature_bias = table.real("temperature_bias_pa_per_c", errors.temperature_bias, -most, most);
  errors.reference_temperature_c =
      table.real("reference_temperature_c", errors.reference_temperature_c, -273.15, 1e4);
  errors.lsb = table.real("lsb_pa", errors.lsb, 0, most);
  errors.least = table.real("min_pa", errors.least, 0, BarometerErrors::huge_pressure);
  errors.largest = table.real("max_pa", errors.largest, 0, BarometerErrors::huge_pressure);
  if (errors.least >= errors.largest) table.fault("max_pa", "give a pressure above min_pa");
  errors.port = table.real("port_error", errors.port, -10, 10);
  errors.port_per_attack = table.real("port_error_per_rad_attack", errors.port_per_attack, -100, 100);
  errors.port_per_sideslip2 = table.real("port_error_per_rad2_sideslip", errors.port_per_sideslip2, -100, 100);
  errors.port_sigma = table.real("port_error_sigma", errors.port_sigma, 0, 10);
  table.finish();
}

namespace {

// Returns whether the truth has places on the Earth; nullopt if this is not known before the first truth.
std::optional<bool> has_places(const TruthConfig& truth) {
  using Frame = EarthModel::Frame;
  using Kind = TruthFrame::Kind;
  if (truth.earth.frame == Frame::none) return false;
  if (truth.earth.frame != Frame::automatic) return true;
  if (truth.frame.kind == Kind::unknown) return std::nullopt;
  return truth.frame.kind == Kind::earth;
}

void check_places(TableReader& table, const std::optional<bool>& has_places) {
  if (!has_places)
    table.warn("solution",
               "\"filter\" aligns only with truth that has places on the Earth; give earth.frame if it has positions "
               "alone");
  else if (!*has_places)
    table.fault("solution",
                "\"filter\" needs places on the Earth for its receiver, which this truth does not have; give "
                "earth.frame = \"local\" with latitude_deg and longitude_deg, or \"inertial\"");
}

// A filter levels by the specific force, which must contain gravity's reaction. Returns why the specific force
// does not contain it; empty if it does.
std::string_view weightless(const TruthConfig& truth) {
  if (truth.ignores_force)
    return "the unit's filter levels by the specific force, which truth.specific_force = \"none\" leaves 0; give "
           "\"auto\"";
  using Gravity = GravitationModel::Kind;
  const GravitationModel& gravitation = truth.gravitation;
  const bool is_off =
      gravitation.kind == Gravity::none || (gravitation.kind == Gravity::constant && gravitation.constant == 0);
  if (is_off && truth.fit && truth.fit->specific_force != PoseFit::Source::given)
    return "the unit's filter levels by gravity, which a derived specific force has only if truth.gravity takes it "
           "away; "
           "give truth.gravity = \"auto\", or gravity_m_per_s2, or send the specific force with "
           "truth.specific_force = \"given\"";
  return {};
}

void check_weight(TableReader& table, const TruthConfig& truth) {
  if (const std::string_view why = weightless(truth); !why.empty()) table.fault("solution", why);
}

using NavigatorKind = NavigatorModel::Kind;

// A product with the errors of a preset computes its solution where the truth has places, of which receiver and
// magnetometer measure, and weight, unless the attitude's errors are given, which a filter does not take. A record of
// a run without such a choice is repeated as it was.
std::optional<NavigatorKind> default_solution(TableReader& table, const TruthConfig& truth, const ImuConfig& imu) {
  if (imu.protocol == nullptr || imu.protocol->solves == nullptr || find_preset(imu.errors_model) == nullptr ||
      !has_places(truth).value_or(false) || !weightless(truth).empty() || table.has("roll_pitch_deg") ||
      table.has("heading_deg") || was_recorded_without(truth.port, "solution = "))
    return std::nullopt;
  const Solves solves = imu.protocol->solves(imu.settings);
  if (solves == Solves::place) return NavigatorKind::inertial;
  return solves == Solves::attitude ? std::optional(NavigatorKind::attitude) : std::nullopt;
}

// The keys of the unit's own filter. Where no accuracies are stated, the receiver is under an open sky.
void read_navigator(TableReader& table, const TruthConfig& truth, ImuConfig& imu) {
  const ImuModel& model = imu.model;
  NavigatorModel& navigator = imu.navigator;
  const std::optional<bool> places = has_places(truth);
  navigator.gravitation = truth.gravitation;
  using OfKind = std::optional<NavigatorKind>;
  const OfKind chosen = table.choice<OfKind>(
      "solution",
      {{std::nullopt, "truth"}, {NavigatorKind::inertial, "filter"}, {NavigatorKind::attitude, "attitude"}},
      default_solution(table, truth, imu));
  navigator.is_on = chosen.has_value();
  navigator.kind = chosen.value_or(NavigatorKind::inertial);
  const bool is_inertial = chosen == NavigatorKind::inertial, is_attitude = chosen == NavigatorKind::attitude;
  // An absent key of a filter that is not chosen has no value.
  const auto check = [&](const char* key, bool is_read, const char* needed) {
    if (!is_read) table.fault(key, fmt::format("needs solution = {}", needed));
  };
  constexpr const char* either = "\"filter\" or \"attitude\"";
  const auto number = [&](const char* key, double initial, double min, double max, bool is_read, const char* needed) {
    if (!is_read && !table.has(key)) return initial;
    const double value = table.real(key, initial, min, max);
    check(key, is_read, needed);
    return value;
  };
  const auto of_both = [&](const char* key, double initial, double min, double max) {
    return number(key, initial, min, max, navigator.is_on, either);
  };
  using Alignment = NavigatorModel::Alignment;
  if (navigator.is_on || table.has("alignment")) {
    navigator.alignment = table.choice<Alignment>(
        "alignment", {{Alignment::coarse, "coarse"}, {Alignment::truth, "truth"}}, Alignment::coarse);
    check("alignment", navigator.is_on, either);
  }
  const auto of_filter = [&](const char* key, double initial, double min, double max) {
    return number(key, initial, min, max, is_inertial, "\"filter\"");
  };
  navigator.alignment_s = of_both("alignment_s", navigator.alignment_s, 0.01, 3600);
  navigator.gnss_rate_hz = of_filter("gnss_rate_hz", navigator.gnss_rate_hz, 0, 100);
  navigator.magnetic_rate_hz = of_both("magnetic_rate_hz", navigator.magnetic_rate_hz, 0, 100);
  navigator.heading = units::degree * of_both("magnetic_heading_deg", 2, 0.01, 180);
  if (is_inertial || table.has("antennas_heading_deg"))
    imu.model.navigation.antennas_heading = units::degree * table.real("antennas_heading_deg", 0, 0, 10);
  if (is_attitude && model.navigation.antennas_heading > 0)
    table.warn("antennas_heading_deg",
               "is only reported, as the receiver's: solution = \"attitude\" takes no heading of a receiver");
  if (is_inertial && model.navigation.antennas_heading > 0 && navigator.gnss_rate_hz == 0)
    table.fault("antennas_heading_deg", "comes with fixes; give a gnss_rate_hz above 0");
  navigator.barometer_rate_hz = of_filter("barometer_rate_hz", navigator.barometer_rate_hz, 0, 100);
  navigator.barometric_height = of_filter("barometric_height_m", navigator.barometric_height, 0.01, most);
  navigator.barometric_walk = of_filter("barometric_walk_m_per_rt_s", navigator.barometric_walk, 1e-4, most);
  if (is_inertial || table.has("zero_velocity")) {
    navigator.zero_velocity = table.flag("zero_velocity", false);
    check("zero_velocity", is_inertial, "\"filter\"");
  }
  if (is_inertial || table.has("estimate_scale_factors")) {
    navigator.estimates_scale_factors = table.flag("estimate_scale_factors", false);
    check("estimate_scale_factors", is_inertial, "\"filter\"");
  }
  for (const char* key : {"barometric_height_m", "barometric_walk_m_per_rt_s"})
    if (is_inertial && navigator.barometer_rate_hz == 0 && table.has(key))
      table.warn(key, "has no effect without a barometer_rate_hz above 0");
  navigator.accept_after_s = of_both("accept_after_s", navigator.accept_after_s, 0, 1e6);
  navigator.accept_heading_after_s = of_filter("accept_heading_after_s", navigator.accept_heading_after_s, 0, 1e6);
  navigator.quiet_acceleration =
      number("quiet_m_per_s2", navigator.quiet_acceleration, 1e-4, 100, is_attitude, "\"attitude\"");
  if (!navigator.is_on) return;
  if (navigator.alignment == Alignment::coarse) check_weight(table, truth);
  if (is_inertial) check_places(table, places);
  const NavigationErrors& errors = model.navigation;
  if (!errors.attitude.isZero(0.0))
    table.fault(errors.attitude.x() > 0 ? "roll_pitch_deg" : "heading_deg",
                "the filter computes the attitude from the sensors; omit the key");
  constexpr double least = 0.01;  // m, m/s
  constexpr double part = 0.1;    // share of the correlated errors that counts as noise as well; chosen
  const auto allow = [least, part](const Vector3& slow, const Vector3& white, Vector3& noise, Vector3& correlated) {
    if (slow.isZero(0.0) && white.isZero(0.0)) return;
    noise = ((part * slow).array().square() + white.array().square()).sqrt().max(least);
    correlated = slow;
  };
  allow(errors.position, errors.position_noise, navigator.position, navigator.slow_position);
  allow(errors.velocity, errors.velocity_noise, navigator.velocity, navigator.slow_velocity);
  navigator.slow_position_s = errors.position_correlation_s;
  navigator.slow_velocity_s = errors.velocity_correlation_s;
  tune(navigator, model);
}

// The age above which an almanac is probably not the intended almanac; chosen.
constexpr std::int64_t oldest_weeks = 13;

void read_almanac(TableReader& table, const std::string& path, std::int64_t start_ns, GnssModel& gnss) {
  try {
    const std::string text = read_whole(path);
    gnss.almanac = is_rinex(text) ? rinex_navigation(text) : yuma_almanac(text, start_ns);
  } catch (const std::system_error& error) {
    return table.fault("gnss_almanac", fmt::format("{}: cannot be read: {}", path, error.code().message()));
  } catch (const std::runtime_error& error) {
    return table.fault("gnss_almanac", fmt::format("{}: {}", path, error.what()));
  }
  const auto is_near = [start_ns](const AlmanacOrbit& orbit) {
    return std::abs(orbit.reference_ns - start_ns) <= oldest_weeks * gps_week_ns;
  };
  for (const AlmanacOrbit& orbit : gnss.almanac)
    if (std::ranges::none_of(gnss.almanac,
                             [&](const AlmanacOrbit& other) { return other.prn == orbit.prn && is_near(other); }))
      return table.warn("gnss_almanac",
                        fmt::format("its satellite {} is of a date more than {} weeks from earth.start; "
                                    "give another almanac, or another start",
                                    orbit.prn, oldest_weeks));
}

void read_receiver(TableReader& table, const TruthConfig& truth, GnssModel& gnss) {
  const std::string path = file_named(table, "gnss_almanac", table.text("gnss_almanac", ""));
  if (!path.empty()) read_almanac(table, path, truth.earth.start_gps_ns, gnss);
  const auto of_almanac = [&](const char* key, double initial, double min, double max) {
    if (path.empty() && !table.has(key)) return initial;
    const double value = table.real(key, initial, min, max);
    if (path.empty()) table.fault(key, "needs gnss_almanac");
    return value;
  };
  gnss.mask = units::degree * of_almanac("gnss_mask_deg", 5, 0, 89);
  gnss.multipath = of_almanac("gnss_multipath_m", gnss.multipath, 0, most);
  gnss.multipath_s = of_almanac("gnss_multipath_s", gnss.multipath_s, 1, most);
  gnss.first_fix_s = table.real("gnss_first_fix_s", gnss.first_fix_s, 0, 1e5);
  gnss.reacquire_s = table.real("gnss_reacquire_s", gnss.reacquire_s, 0, 1e5);
}

}  // namespace

void read_navigation(TableReader table, const TruthConfig& truth, ImuConfig& imu) {
  NavigationErrors& errors = imu.model.navigation;
  const auto correlation = [&table](std::string_view key, double& time_s) {
    time_s = table.real(key, time_s, 1e-3, 1e9);
  };
  errors.latency = nanoseconds(table.real("latency_s", 0, 0, 10));
  errors.time_s = table.real("time_s", errors.time_s, 0, 1);
  correlation("time_correlation_s", errors.time_correlation_s);
  errors.position = table.per_axis("position_m", errors.position, 0, most);
  correlation("position_correlation_s", errors.position_correlation_s);
  errors.position_noise = table.per_axis("position_noise_m", errors.position_noise, 0, most);
  errors.velocity = table.per_axis("velocity_m_per_s", errors.velocity, 0, most);
  correlation("velocity_correlation_s", errors.velocity_correlation_s);
  errors.velocity_noise = table.per_axis("velocity_noise_m_per_s", errors.velocity_noise, 0, most);
  const double roll_pitch = units::degree * table.real("roll_pitch_deg", 0, 0, 90);
  errors.attitude = {roll_pitch, roll_pitch, units::degree * table.real("heading_deg", 0, 0, 180)};
  correlation("attitude_correlation_s", errors.attitude_correlation_s);
  read_receiver(table, truth, errors.gnss);
  read_navigator(table, truth, imu);
  table.finish();
}

}  // namespace imud
