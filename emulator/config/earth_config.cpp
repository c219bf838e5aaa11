// The keys of [earth], how the truth's frame N relates to the Earth, and truth.max_*.
#include <cmath>

#include "core/earth/igrf.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"

namespace imud {
namespace {

using EarthFrame = EarthModel::Frame;
using Kind = TruthFrame::Kind;

constexpr std::string_view automatic = "auto";

// Adds a fault if the truth cannot have this frame.
void check_frame(TableReader& table, EarthFrame frame, const TruthConfig& truth) {
  if (truth.format == nullptr) return;
  const bool is_centred = truth.frame.kind == Kind::earth || truth.frame.kind == Kind::inertial;
  if (frame == EarthFrame::local && is_centred)
    table.fault("frame", fmt::format("N of {} truth is inertial, with its origin at the Earth's centre; {}",
                                     truth.format->name,
                                     truth.frame.kind == Kind::earth
                                         ? "leave out frame, latitude_deg, longitude_deg and height_m: truth has the "
                                           "place (a vehicle at rest: rest_latitude_deg and so on)"
                                         : "give \"inertial\""));
  if (frame == EarthFrame::inertial && truth.frame.kind == Kind::local)
    table.fault("frame", fmt::format("N of {} truth is a local level; give \"local\" with latitude_deg and "
                                     "longitude_deg of its origin",
                                     truth.format->name));
}

// Reads the angle of the Earth at truth time 0, rad; `of_start`: the angle by the key `start`.
double read_angle(TableReader& table, TruthConfig& truth, double of_start) {
  constexpr std::string_view key = "angle_deg";
  if (is_text(table, key) || !table.has(key)) {
    if (table.text(key, std::string(automatic)) != automatic)
      table.fault(key, "give degrees from -360 to 360, or \"auto\"");
    return truth.frame.angle.value_or(of_start);
  }
  truth.is_earth_angle_given = true;
  const double angle = units::degree * table.real(key, 0.0, -360.0, 360.0);
  if (truth.frame.angle && std::abs(angle_between(angle, *truth.frame.angle)) > EarthModel::largest_angle_error)
    table.fault(key,
                fmt::format("is {:.6g}, but N of this truth has its x axis at {:.6g} deg from the prime meridian at "
                            "truth time 0; leave it out",
                            angle / units::degree, *truth.frame.angle / units::degree));
  return angle;
}

}  // namespace

EarthModel read_earth(TableReader table, TruthConfig& truth) {
  EarthModel earth;
  earth.frame = table.choice<EarthFrame>("frame",
                                         {{EarthFrame::automatic, "auto"},
                                          {EarthFrame::none, "none"},
                                          {EarthFrame::local, "local"},
                                          {EarthFrame::inertial, "inertial"}},
                                         EarthFrame::automatic);
  check_frame(table, earth.frame, truth);
  const toml::date_time in_2025(toml::date(2025, 1, 1), toml::time(0, 0, 0), toml::time_offset());
  const std::int64_t start = utc_s(table, "start", in_2025, first_year_of_start, 2100);
  earth.start_gps_ns = gps_ns_from_unix(start);
  if (earth.frame != EarthFrame::none && decimal_year(earth.start_gps_ns) > igrf14_end)
    table.warn("start", fmt::format("IGRF-14 ends in {}; the magnetic field is extrapolated", igrf14_end));
  const bool is_inertial = earth.frame == EarthFrame::inertial;
  // A key that belongs to another frame has no value if it is absent.
  const auto number = [&](const std::string& key, bool fits, std::string_view needs, double min, double max) {
    if (!fits && !table.has(key)) return 0.0;
    const double value = table.real(key, 0.0, min, max);
    if (!fits) table.fault(key, fmt::format("needs frame = {}", needs));
    return value;
  };
  if (earth.frame == EarthFrame::local) {
    require(table, "latitude_deg", "the latitude of N's origin");
    require(table, "longitude_deg", "the longitude of N's origin");
  }
  // The place of the vehicle at rest: the origin of a local frame, or the keys rest_*.
  const auto place = [&](const std::string& prefix, bool fits, std::string_view needs) {
    earth.latitude += units::degree * number(prefix + "latitude_deg", fits, needs, -90.0, 90.0);
    earth.longitude += units::degree * number(prefix + "longitude_deg", fits, needs, -180.0, 360.0);
    earth.height += number(prefix + "height_m", fits, needs, -1e4, 1e8);
  };
  place("", earth.frame == EarthFrame::local, "\"local\"");
  earth.is_rest_known = earth.frame == EarthFrame::automatic && truth.frame.kind != Kind::local &&
                        (table.has("rest_latitude_deg") || table.has("rest_longitude_deg"));
  place("rest_", is_inertial || earth.is_rest_known, "\"inertial\", or a truth that has places on the Earth");
  if (is_inertial || table.has("angle_deg")) earth.angle = read_angle(table, truth, earth_rotation_angle(start));
  if (!is_inertial && table.has("angle_deg")) table.fault("angle_deg", "needs frame = \"inertial\"");
  earth.rest_yaw_pitch_roll = units::degree * table.vector3("rest_yaw_pitch_roll_deg", Vector3::Zero());
  if (earth.rest_yaw_pitch_roll.cwiseAbs().maxCoeff() > 1e4)
    table.fault("rest_yaw_pitch_roll_deg", "give angles from -572957 to 572957");
  table.finish();
  return earth;
}

std::string earth_text(const TruthConfig& truth) {
  const EarthModel& earth = truth.earth;
  const auto degrees = [](double angle) { return angle / units::degree; };
  const bool has_angle = truth.frame.kind == Kind::earth;
  switch (earth.frame) {
    case EarthFrame::local:
      return fmt::format(
          "N is a local level with its origin at latitude {:.6f}, longitude {:.6f} deg, height {:.6g} m",
          degrees(earth.latitude), degrees(earth.longitude), earth.height);
    case EarthFrame::inertial:
      return fmt::format("N is inertial, its origin the Earth's centre; the prime meridian at truth time 0 is {}",
                         has_angle && !truth.is_earth_angle_given && !truth.frame.angle
                             ? "where the truth has it"
                             : fmt::format("{:.6f} deg from its x axis", degrees(earth.angle)));
    case EarthFrame::automatic:
      if (has_angle)
        return truth.format->columns.empty()
                   ? "the truth has places on the Earth"
                   : "the truth has places on the Earth, if it has positions and velocities (imud list " +
                         std::string(truth.format->name) + ")";
      if (truth.frame.kind == Kind::unknown)
        return "places, magnetic field and pressure are known if the truth has latitude and longitude or a position "
               "relative to the Earth, or with [earth] frame = \"local\" and a place";
      return fmt::format("N is {}: places, magnetic field and pressure are unknown without [earth] frame = \"{}\"",
                         truth.frame.kind == Kind::local ? "a local level" : "inertial",
                         truth.frame.kind == Kind::local ? "local" : "inertial");
    case EarthFrame::none:
    default:
      return "no places, magnetic field and pressure, as [earth] frame is \"none\"";
  }
}

void read_bounds(TableReader& table, TruthBounds& bounds) {
  constexpr double most = 1e9;
  const auto bound = [&](std::string_view key, double& value) {
    if (table.has(key)) value = table.real(key, 0.0, 1e-9, most);
  };
  bound("max_rad_per_s", bounds.rate);
  bound("max_m_per_s2", bounds.acceleration);
  bound("max_m_per_s", bounds.velocity);
}

void set_bounds(const std::vector<ImuConfig>& imus, TruthBounds& bounds) {
  const auto widest = [&](TriadErrors ImuModel::*triad) {
    double most = 0;
    for (const ImuConfig& imu : imus) {
      const AxisLimits limits = (imu.model.*triad).range();
      most = std::max(most, limits.upper.cwiseMax(-limits.lower).norm());
    }
    return most;
  };
  if (bounds.rate == 0) bounds.rate = widest(&ImuModel::gyro);
  if (bounds.acceleration == 0) bounds.acceleration = widest(&ImuModel::accelerometer);
}

}  // namespace imud
