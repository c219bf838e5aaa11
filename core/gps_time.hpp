// GPS time: its epoch, its weeks, and its relation to UTC. They are defined nowhere else.
#pragma once

#include <chrono>
#include <cstdint>

#include "core/time.hpp"

namespace imud {

// A GPS time is the number of ns since its epoch, 1980-01-06 00:00 UTC, leap seconds included.
inline constexpr std::chrono::sys_days gps_epoch{std::chrono::year(1980) / std::chrono::January / 6};
inline constexpr std::int64_t gps_week_s = 604'800, gps_week_ns = gps_week_s * 1'000'000'000;
// GPS time less UTC, s, since 2017 (IERS Bulletin C 52); the conversions below are valid from then on.
inline constexpr std::int64_t gps_leap_s = 18;

// Returns the GPS time, ns, of a UTC in s since 1970-01-01.
constexpr std::int64_t gps_ns_from_unix(std::int64_t utc_s) noexcept {
  const std::chrono::sys_seconds epoch = gps_epoch;
  return (utc_s - epoch.time_since_epoch().count() + gps_leap_s) * 1'000'000'000;
}
// Returns the UTC of a GPS time in ns.
constexpr std::chrono::sys_time<Nanoseconds> utc_from_gps(std::int64_t gps_ns) noexcept {
  return gps_epoch + Nanoseconds(gps_ns) - std::chrono::seconds(gps_leap_s);
}

}  // namespace imud
