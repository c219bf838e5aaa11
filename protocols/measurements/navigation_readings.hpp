// How the quantities of navigation are read: place, calendar, the receiver's fix, and the unit's own solution. The
// table of measured_quantities.cpp names them. Each function returns a number, SI, of a reading; pure.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/gps_time.hpp"
#include "core/numbers/elementary.hpp"
#include "protocols/measurements/measured_quantities.hpp"
#include "protocols/measurements/receiver_accuracy.hpp"

namespace imud::navigation_readings {

// --- Navigation ---
// The source of the navigation: the unit's own (while a filter has no place, the receiver's), or the receiver's.
using Source = const Navigation& (Sample::*)() const noexcept;
inline constexpr Source own = &Sample::timed, received = &Sample::fix;
template <Source From>
const Navigation& navigation_of(const Reading& reading) noexcept {
  return (reading.sample.*From)();
}

template <Source From, double Navigation::*Member>
double place(const Reading& reading) noexcept {
  return navigation_of<From>(reading).*Member;
}
template <Source From, int Axis>
double velocity_L(const Reading& reading) noexcept {
  return navigation_of<From>(reading).v_L[Axis];
}
template <Source From>
double climb(const Reading& reading) noexcept {
  return -velocity_L<From, 2>(reading);
}
template <Source From>
double ground_speed(const Reading& reading) noexcept {
  return navigation_of<From>(reading).v_L.template head<2>().norm();
}
template <Source From>
double track(const Reading& reading) noexcept {
  const Vector3& v = navigation_of<From>(reading).v_L;
  return elementary::atan2(v.y(), v.x());
}
template <int Axis>
double velocity_P(const Reading& reading) noexcept {
  return (reading.sample.q_LP.conjugate() * navigation_of<own>(reading).v_L)[Axis];
}
template <int Axis>
double position(const Reading& reading) noexcept {
  return navigation_of<own>(reading).r_E[Axis];
}
template <int Axis>
double relative_position(const Reading& reading) noexcept {
  const Navigation& navigation = navigation_of<own>(reading);
  return navigation.is_known ? r_L_from_origin(navigation)[Axis] : 0;
}
inline double speed(const Reading& reading) noexcept { return navigation_of<own>(reading).v_L.norm(); }

// --- Calendar: UTC in the present number of leap seconds; 0 where the time is not known ---
namespace chrono = std::chrono;
using Utc = chrono::sys_time<Nanoseconds>;
template <auto Part>
double utc(const Reading& reading) noexcept {
  const Navigation& timed = reading.sample.timed();
  return timed.is_known ? static_cast<double>(Part(utc_from_gps(timed.gps_ns))) : 0;
}
inline chrono::year_month_day date(Utc at) noexcept { return chrono::floor<chrono::days>(at); }
template <class Unit, class Whole>  // the number of `Unit`s since the last full `Whole`
std::int64_t since(Utc at) noexcept {
  return chrono::floor<Unit>(at - chrono::floor<Whole>(at)).count();
}

inline int year(Utc at) noexcept { return int{date(at).year()}; }
inline unsigned month(Utc at) noexcept { return unsigned{date(at).month()}; }
inline unsigned day(Utc at) noexcept { return unsigned{date(at).day()}; }
// Returns the fraction of a second, rounded down to 0.1 ms, so that a field with this resolution never shows the next
// second.
inline double subsecond(Utc at) noexcept {
  return 1e-4 * static_cast<double>(since<Nanoseconds, chrono::seconds>(at) / 100'000);
}
inline std::int64_t day_of_year(Utc at) noexcept {
  return (chrono::floor<chrono::days>(at) - chrono::sys_days(date(at).year() / chrono::January / 1)).count() + 1;
}
inline double time_of_day(Utc at) noexcept {
  return 1e-9 * static_cast<double>(since<Nanoseconds, chrono::days>(at));
}
inline double unix_time(Utc at) noexcept { return 1e-9 * static_cast<double>(at.time_since_epoch().count()); }
// The GPS time of a reading, ns since 1980-01-06: the present one, or the one of the receiver's fix.
using GpsTime = std::int64_t (*)(const Sample&) noexcept;
inline constexpr GpsTime at_present = [](const Sample& sample) noexcept { return sample.timed().gps_ns; };
inline constexpr GpsTime at_fix = [](const Sample& sample) noexcept { return sample.fix_gps_ns(); };
template <GpsTime At>
double time_of_week(const Reading& r) noexcept {
  return 1e-9 * static_cast<double>(At(r.sample) % gps_week_ns);
}
template <GpsTime At>
double gps_week(const Reading& r) noexcept {
  return static_cast<double>(At(r.sample) / gps_week_ns);
}
inline double gps_time(const Reading& r) noexcept { return 1e-9 * static_cast<double>(at_present(r.sample)); }

inline double fix(const Reading& r) noexcept { return r.sample.fix().is_known ? 1 : 0; }
// If every sample has a fix of its own, the fixes of a receiver of 10 Hz are new: in 5 ms of 100 ms.
inline double is_new_fix(const Reading& r) noexcept {
  const Navigation& timed = r.sample.timed();
  if (r.sample.solution && r.sample.solution->has_epochs)
    return r.sample.fix().is_known && r.sample.solution->since_epoch == 0 ? 1 : 0;
  if (!timed.is_known) return 0;
  const std::int64_t part = since<Nanoseconds, chrono::seconds>(utc_from_gps(timed.gps_ns)) / 100'000 % 1000;
  return part >= 455 && part < 505 ? 1 : 0;
}
template <float Dilution::*Member>
double dilution(const Reading& r) noexcept {
  const Navigation& receiver = r.sample.fix();
  return receiver.is_known ? double{receiver.dilution.known_or(open_sky).*Member} : 0;
}
template <Vector3 ReceiverAccuracy::*Member, int Axis>
double receiver_sigma(const Reading& r) noexcept {
  return (receiver_accuracy(r).*Member)[Axis];
}
inline double horizontal_sigma(const Reading& r) noexcept {
  const double north = receiver_sigma<&ReceiverAccuracy::position, 0>(r),
               east = receiver_sigma<&ReceiverAccuracy::position, 1>(r);
  return std::sqrt(north * north + east * east);
}
// Returns 655.35 m without a fix: in cm the 65535 by which messages report that an accuracy is not known.
inline double known_or_largest(const Reading& r, double accuracy) noexcept {
  return r.sample.fix().is_known ? std::min(655.34, accuracy) : 655.35;
}
inline double horizontal_accuracy(const Reading& r) noexcept { return known_or_largest(r, horizontal_sigma(r)); }
inline double vertical_accuracy(const Reading& r) noexcept {
  return known_or_largest(r, receiver_sigma<&ReceiverAccuracy::position, 2>(r));
}
// The azimuth of the line of two antennas, 0 where the receiver has none.
inline double has_antennas(const Reading& r) noexcept { return r.sample.antennas() != nullptr ? 1 : 0; }
inline double antennas_heading(const Reading& r) noexcept {
  const AntennaLine* const line = r.sample.antennas();
  return line != nullptr ? elementary::atan2(line->direction_L.y(), line->direction_L.x()) : 0;
}
inline double antennas_sigma(const Reading& r) noexcept {
  return r.sample.antennas() != nullptr ? r.sample.antennas()->sigma : 0;
}
inline double satellites(const Reading& r) noexcept {
  return r.sample.fix().is_known ? r.sample.fix().satellites : 0;
}

// --- The unit's own solution, and its receiver's fix ---
template <Solution::State State>
double is_in(const Reading& r) noexcept {
  return r.sample.solution && r.sample.solution->state == State ? 1 : 0;
}
inline double navigates(const Reading& r) noexcept {
  return is_in<Solution::State::coasting>(r) + is_in<Solution::State::aided>(r);
}
inline double navigation_state(const Reading& r) noexcept {
  return r.sample.solution ? 1 + static_cast<double>(r.sample.solution->state) : 0;
}
inline double fix_age(const Reading& r) noexcept {
  return r.sample.solution ? static_cast<double>(r.sample.solution->since_fix_s) : 0;
}
inline double position_quality(const Reading& r) noexcept {
  return r.sample.navigation.is_known ? 2 - is_in<Solution::State::coasting>(r) : 0;
}
template <std::uint16_t Aids>
double uses(const Reading& r) noexcept {
  return r.sample.solution && (r.sample.solution->used & Aids) != 0 ? 1 : 0;
}

template <int Axis>
double attitude_deviation(const Reading& r) noexcept {
  return r.sample.solution ? static_cast<double>(r.sample.solution->attitude[Axis]) : 0;
}
template <int Angle>
double angle_deviation(const Reading& r) noexcept {
  if (!r.sample.solution) return 0;
  return roll_pitch_yaw_deviations(r.sample.q_LP, r.sample.solution->attitude.cast<double>())[Angle];
}
// Returns 0 while the unit aligns or has no place, because then there is no deviation that a status could judge.
inline double heading_deviation(const Reading& r) noexcept { return navigates(r) != 0 ? angle_deviation<2>(r) : 0; }
// Returns a deviation of the solution. While there is no place, the deviation is as if the unit were anywhere on the
// Earth, at any speed up to orbital speed.
template <Eigen::Vector3f Solution::*Member, int Axis>
double deviation(const Reading& r) noexcept {
  if (!r.sample.solution) return 0;
  constexpr double half_round_m = 2e7, orbital_m_per_s = 8e3;
  if (!r.sample.navigation.is_known) return Member == &Solution::position ? half_round_m : orbital_m_per_s;
  return static_cast<double>(((*r.sample.solution).*Member)[Axis]);
}

}  // namespace imud::navigation_readings
