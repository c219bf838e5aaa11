#include "emulator/truth/place_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "core/earth/earth.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "emulator/truth/remark_text.hpp"

namespace imud {

namespace {

using EarthFrame = EarthModel::Frame;

double degrees(double angle) { return angle / units::degree; }

// A date and time of UTC, in s since 1970.
struct Date {
  explicit Date(std::int64_t gps_ns) {
    using namespace std::chrono;
    const sys_seconds time = floor<std::chrono::seconds>(utc_from_gps(gps_ns));
    const auto midnight = floor<days>(time);
    const year_month_day ymd(midnight);
    year = static_cast<int>(ymd.year());
    month = static_cast<unsigned>(ymd.month());
    day = static_cast<unsigned>(ymd.day());
    second = (time - midnight).count();
  }
  int year = 0;
  unsigned month = 0, day = 0;
  std::int64_t second = 0;  // of the day
};

}  // namespace

std::size_t PlaceWatch::describe_place(const Truth& truth, std::span<char> room) const noexcept {
  if (!truth.has_position || earth_.frame == EarthFrame::none) return 0;
  constexpr double far = 3e6, deepest = 6'256'000.0;  // m
  const double distance = truth.r_BN_N.norm();
  if (!truth.has_earth_angle) {
    if (earth_.frame == EarthFrame::inertial && distance <= deepest)
      return write_remark(
          room,
          "its position is {:.0f} m from N's origin, which earth.frame = \"inertial\" takes as the Earth's "
          "centre: the place is unknown; for a local level give earth.frame = \"local\"",
          distance);
    if (earth_.frame == EarthFrame::local && distance > far)
      return write_remark(
          room,
          "its position is {:.0f} m from N's origin, which earth.frame = \"local\" has at latitude {:.6f}, "
          "longitude {:.6f} deg; for positions from the Earth's centre give earth.frame = \"inertial\"",
          distance, degrees(earth_.latitude), degrees(earth_.longitude));
    return 0;
  }
  if (earth_.frame == EarthFrame::local) {
    const double turned = earth_angle_at(truth);
    const Geodetic place = distance > deepest ? geodetic_of(truth.r_BN_N) : Geodetic{};
    return write_remark(
        room,
        "it is at latitude {:.6f}, longitude {:.6f} deg by its own place, which is used, and earth.frame = "
        "\"local\" has the origin of N at {:.6f}, {:.6f}; leave out earth.frame and its place",
        degrees(place.latitude), degrees(angle_between(place.longitude, turned)), degrees(earth_.latitude),
        degrees(earth_.longitude));
  }
  if (earth_.frame == EarthFrame::inertial && is_angle_given_ &&
      std::abs(angle_between(truth.earth_angle, earth_.angle)) > EarthModel::largest_angle_error)
    return write_remark(
        room,
        "the Earth's angle at truth time 0 is {:.6f} deg by the truth, which is used, and earth.angle_deg = "
        "{:.6f}; leave that out",
        degrees(truth.earth_angle), degrees(earth_.angle));
  return 0;
}

std::size_t PlaceWatch::describe_no_place(const Truth& truth, const TruthFormat& format,
                                          std::span<char> room) const noexcept {
  const std::string_view position = truth.has_position             ? ""
                                    : format.position_from.empty() ? "positions"
                                                                   : format.position_from;
  const std::string_view velocity = truth.has_velocity             ? ""
                                    : format.velocity_from.empty() ? "velocities"
                                                                   : format.velocity_from;
  const std::string_view and_field =
      truth.has_magnetic_field ? "" : "magnetometers measure 0, the headings of a unit's filter drift, ";
  const std::string_view and_pressure = truth.has_pressure ? "" : "barometers measure 0, ";
  if (has_pose(truth))
    return write_remark(
        room,
        "has positions and velocities, but nothing that relates them to the Earth, so there is no place: "
        "{}{}receivers have no fix; give earth.frame = \"local\" with latitude_deg and longitude_deg, or "
        "\"inertial\"; \"none\" if that is meant",
        and_field, and_pressure);
  return write_remark(room, "lacks {}{}{}, so there is no place: {}{}receivers have no fix; add them", position,
                      position.empty() || velocity.empty() ? "" : " and ", velocity, and_field, and_pressure);
}

std::size_t PlaceWatch::describe_date(const Truth& truth, std::span<char> room) const noexcept {
  constexpr std::int64_t tolerance_ns = 1'000'000'000;
  const bool has_place =
      earth_.frame == EarthFrame::automatic ? truth.has_earth_angle : earth_.frame != EarthFrame::none;
  if (!has_place || !truth.has_date || std::abs(truth.start_gps_ns - earth_.start_gps_ns) <= tolerance_ns) return 0;
  const Date own(truth.start_gps_ns), configured(earth_.start_gps_ns);
  constexpr std::int64_t hour = 3600, minute = 60;
  const std::string_view remedy =
      own.year >= first_year_of_start
          ? "give the truth's as earth.start"
          : "no earth.start can be the truth's: give times since the first truth, such as time_s, in place of dates";
  return write_remark(room,
                      "its time 0 is {:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z by its own date, and earth.start is "
                      "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z, which GPS time and magnetic field follow; {}",
                      own.year, own.month, own.day, own.second / hour, own.second / minute % minute,
                      own.second % minute, configured.year, configured.month, configured.day,
                      configured.second / hour, configured.second / minute % minute, configured.second % minute,
                      remedy);
}

}  // namespace imud
