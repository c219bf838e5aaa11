#include "protocols/measurements/measured_quantities.hpp"

#include <chrono>
#include <iterator>
#include <limits>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "protocols/measurements/measured_vectors.hpp"
#include "protocols/measurements/navigation_readings.hpp"

namespace imud {
namespace {

using namespace navigation_readings;

// --- Vectors; `Place` is the number of the first bit in ReadBack::components, divided by 3 ---
template <Vector3 Sample::*Member, int Axis>
double newest(const Reading& reading) noexcept {
  return (reading.sample.*Member)[Axis];
}
template <Vector3 Reading::*Member, int Axis>
double sum(const Reading& reading) noexcept {
  return (reading.*Member)[Axis];
}
// Returns the mean over the interval. The interval of the first message is not known: returns its newest value.
template <Vector3 Reading::*Member, Vector3 Sample::*Newest, int Axis>
double mean(const Reading& reading) noexcept {
  return reading.interval_s > 0 ? (reading.*Member)[Axis] / reading.interval_s : (reading.sample.*Newest)[Axis];
}
template <Vector3 Sample::*Member, int Place, int Axis>
void put(double value, ReadBack& read) noexcept {
  (read.measurement.sample.*Member)[Axis] = value;
  read.components |= 1U << (3 * Place + Axis);
}

// --- Attitude ---
template <int Index>  // 0 yaw, 1 pitch, 2 roll
double euler(const Reading& reading) noexcept {
  return yaw_pitch_roll_from_dcm(reading.sample.q_LP.conjugate().toRotationMatrix())[Index];
}
// Returns the rate at which the horizontal part of the sensor's x axis turns; 0 where x has no such part.
double yaw_rate(const Reading& reading) noexcept {
  const Quaternion& q = reading.sample.q_LP;
  const Vector3 x_L = q * Vector3::UnitX(), moving = (q * reading.sample.rate).cross(x_L);
  const double horizontal = x_L.x() * x_L.x() + x_L.y() * x_L.y();
  return horizontal > 1e-12 ? (x_L.x() * moving.y() - x_L.y() * moving.x()) / horizontal : 0;
}
// Angles of the sensor's axes right, forward, up relative to east, north, up.
template <int Index>  // 0 yaw, 1 pitch, 2 roll
double euler_RFU(const Reading& reading) noexcept {
  const Quaternion& q = reading.sample.q_LP;
  return yaw_pitch_roll_from_dcm(Quaternion(q.w(), q.y(), q.x(), -q.z()).conjugate().toRotationMatrix())[Index];
}
// Returns a component (0 to 3: w, x, y, z) of the unit quaternion q or -q, whichever has w >= 0.
double component(const Quaternion& q, int index) noexcept {
  const double value = index == 0 ? q.w() : q.vec()[index - 1];
  return q.w() < 0 ? -value : value;
}
template <int Index>
double attitude(const Reading& reading) noexcept {
  return component(reading.sample.q_LP, Index);
}
template <int Index>
double rotation(const Reading& reading) noexcept {
  return component(reading.rotation, Index);
}
template <int Axis>  // relative to rest in standard gravity, in L
double free_acceleration(const Reading& reading) noexcept {
  return (reading.sample.q_LP * reading.sample.specific_force)[Axis] + (Axis == 2 ? units::standard_gravity : 0);
}
template <int Axis>  // in P
double acceleration(const Reading& reading) noexcept {
  const Sample& sample = reading.sample;
  return (sample.specific_force + sample.q_LP.conjugate() * Vector3(0, 0, units::standard_gravity))[Axis];
}
template <int Index>  // the parameters of norm 1 at most: vec / (1 + w)
double rodrigues(const Reading& reading) noexcept {
  return component(reading.sample.q_LP, Index + 1) / (1 + component(reading.sample.q_LP, 0));
}

double temperature(const Reading& r) noexcept { return r.sample.temperature_c; }
void put_temperature(double value, ReadBack& read) noexcept {
  read.measurement.sample.temperature_c = value;
  read.measurement.fields |= Measurement::temperature;
}
double pressure(const Reading& r) noexcept { return r.sample.pressure; }
double pressure_altitude(const Reading& r) noexcept {
  return r.sample.pressure > 0 ? standard_altitude(r.sample.pressure) : 0;
}

constexpr MeasuredQuantity anywhere(std::string_view name, std::string_view help, std::span<const KeyUnit> units,
                                    double (*get)(const Reading&) noexcept) {
  return {.name = name, .help = help, .units = units, .get = get, .needs = MeasuredQuantity::Needs::nothing};
}
constexpr MeasuredQuantity at_place(std::string_view name, std::string_view help, std::span<const KeyUnit> units,
                                    double (*get)(const Reading&) noexcept) {
  return {.name = name, .help = help, .units = units, .get = get, .needs = MeasuredQuantity::Needs::place};
}
constexpr MeasuredQuantity at_time(std::string_view name, std::string_view help, std::span<const KeyUnit> units,
                                   double (*get)(const Reading&) noexcept) {
  return {.name = name, .help = help, .units = units, .get = get, .needs = MeasuredQuantity::Needs::time};
}
constexpr MeasuredQuantity with_fix(std::string_view name, std::string_view help, std::span<const KeyUnit> units,
                                    double (*get)(const Reading&) noexcept) {
  return {.name = name, .help = help, .units = units, .get = get, .needs = MeasuredQuantity::Needs::fix};
}

constexpr MeasuredQuantity with_antennas(std::string_view name, std::string_view help, std::span<const KeyUnit> units,
                                         double (*get)(const Reading&) noexcept) {
  return {.name = name, .help = help, .units = units, .get = get, .needs = MeasuredQuantity::Needs::antennas};
}

using enum MeasuredQuantity::Kind;
constexpr MeasuredQuantity quantities[] = {
    {"rate_x", "angular rate", key_units::rate, newest<&Sample::rate, 0>, put<&Sample::rate, 0, 0>},
    {"rate_y", "", key_units::rate, newest<&Sample::rate, 1>, put<&Sample::rate, 0, 1>},
    {"rate_z", "", key_units::rate, newest<&Sample::rate, 2>, put<&Sample::rate, 0, 2>},
    {"specific_force_x", "specific force", key_units::acceleration, newest<&Sample::specific_force, 0>,
     put<&Sample::specific_force, 1, 0>},
    {"specific_force_y", "", key_units::acceleration, newest<&Sample::specific_force, 1>,
     put<&Sample::specific_force, 1, 1>},
    {"specific_force_z", "", key_units::acceleration, newest<&Sample::specific_force, 2>,
     put<&Sample::specific_force, 1, 2>},
    {"delta_angle_x", "sum of the delta-angles since the last message", key_units::angle,
     sum<&Reading::delta_angle, 0>, put<&Sample::delta_angle, 2, 0>, number, true},
    {"delta_angle_y", "", key_units::angle, sum<&Reading::delta_angle, 1>, put<&Sample::delta_angle, 2, 1>, number,
     true},
    {"delta_angle_z", "", key_units::angle, sum<&Reading::delta_angle, 2>, put<&Sample::delta_angle, 2, 2>, number,
     true},
    {"delta_velocity_x", "sum of the delta-velocities since the last message", key_units::speed,
     sum<&Reading::delta_velocity, 0>, put<&Sample::delta_velocity, 3, 0>, number, true},
    {"delta_velocity_y", "", key_units::speed, sum<&Reading::delta_velocity, 1>, put<&Sample::delta_velocity, 3, 1>,
     number, true},
    {"delta_velocity_z", "", key_units::speed, sum<&Reading::delta_velocity, 2>, put<&Sample::delta_velocity, 3, 2>,
     number, true},
    {"mean_rate_x", "delta-angle divided by its interval", key_units::rate,
     mean<&Reading::delta_angle, &Sample::rate, 0>, nullptr, number, true},
    {"mean_rate_y", "", key_units::rate, mean<&Reading::delta_angle, &Sample::rate, 1>, nullptr, number, true},
    {"mean_rate_z", "", key_units::rate, mean<&Reading::delta_angle, &Sample::rate, 2>, nullptr, number, true},
    {"mean_specific_force_x", "delta-velocity divided by its interval", key_units::acceleration,
     mean<&Reading::delta_velocity, &Sample::specific_force, 0>, nullptr, number, true},
    {"mean_specific_force_y", "", key_units::acceleration, mean<&Reading::delta_velocity, &Sample::specific_force, 1>,
     nullptr, number, true},
    {"mean_specific_force_z", "", key_units::acceleration, mean<&Reading::delta_velocity, &Sample::specific_force, 2>,
     nullptr, number, true},
    {"rotation_w", "quaternion of the rotation since the last message", {}, rotation<0>, nullptr, number, true},
    {"rotation_x", "", {}, rotation<1>, nullptr, number, true},
    {"rotation_y", "", {}, rotation<2>, nullptr, number, true},
    {"rotation_z", "", {}, rotation<3>, nullptr, number, true},
    {"temperature", "temperature of the sensor", key_units::temperature, temperature, put_temperature},
    {"magnetic_field_x", "magnetic field", key_units::magnetic_field, newest<&Sample::magnetic_field, 0>},
    {"magnetic_field_y", "", key_units::magnetic_field, newest<&Sample::magnetic_field, 1>},
    {"magnetic_field_z", "", key_units::magnetic_field, newest<&Sample::magnetic_field, 2>},
    {"pressure", "static pressure", key_units::pressure, pressure},
    anywhere("pressure_altitude", "of that pressure in the standard atmosphere; 0 where it is not known",
             key_units::length, pressure_altitude),
    {"q_LP_w", "attitude relative to north-east-down, v_L = q_LP v_P", {}, attitude<0>},
    {"q_LP_x", "", {}, attitude<1>},
    {"q_LP_y", "", {}, attitude<2>},
    {"q_LP_z", "", {}, attitude<3>},
    {"sigma_LP_1", "the same as modified Rodrigues parameters", {}, rodrigues<0>},
    {"sigma_LP_2", "", {}, rodrigues<1>},
    {"sigma_LP_3", "", {}, rodrigues<2>},
    {"yaw", "attitude relative to north-east-down, 3-2-1", key_units::angle, euler<0>},
    {"pitch", "", key_units::angle, euler<1>},
    {"roll", "", key_units::angle, euler<2>},
    {"yaw_rate", "derivative of the yaw, with the Earth's rate where the gyros measure it", key_units::rate,
     yaw_rate},
    {"yaw_RFU", "of right-forward-up relative to east-north-up, 3-2-1", key_units::angle, euler_RFU<0>},
    {"pitch_RFU", "", key_units::angle, euler_RFU<1>},
    {"roll_RFU", "", key_units::angle, euler_RFU<2>},
    {"free_acceleration_north", "specific force less gravity", key_units::acceleration, free_acceleration<0>},
    {"free_acceleration_east", "", key_units::acceleration, free_acceleration<1>},
    {"free_acceleration_down", "", key_units::acceleration, free_acceleration<2>},
    {"acceleration_x", "the same in the axes of the sensor", key_units::acceleration, acceleration<0>},
    {"acceleration_y", "", key_units::acceleration, acceleration<1>},
    {"acceleration_z", "", key_units::acceleration, acceleration<2>},
    at_place("latitude", "geodetic, WGS 84; the receiver's while its own solution has no place", key_units::angle,
             place<own, &Navigation::latitude>),
    at_place("longitude", "", key_units::angle, place<own, &Navigation::longitude>),
    at_place("height", "above the ellipsoid", key_units::length, place<own, &Navigation::height>),
    at_place("position_north", "from where the first truth was, or from the local level's origin; axes there",
             key_units::length, relative_position<0>),
    at_place("position_east", "", key_units::length, relative_position<1>),
    at_place("position_down", "", key_units::length, relative_position<2>),
    at_place("velocity_north", "velocity relative to the Earth", key_units::speed, velocity_L<own, 0>),
    at_place("velocity_east", "", key_units::speed, velocity_L<own, 1>),
    at_place("velocity_down", "", key_units::speed, velocity_L<own, 2>),
    at_place("velocity_up", "", key_units::speed, climb<own>),
    at_place("speed", "magnitude of the velocity", key_units::speed, speed),
    at_place("ground_speed", "its horizontal part", key_units::speed, ground_speed<own>),
    at_place("track", "its direction, from north to east", key_units::angle, track<own>),
    at_place("velocity_x", "the same in the axes of the sensor", key_units::speed, velocity_P<0>),
    at_place("velocity_y", "", key_units::speed, velocity_P<1>),
    at_place("velocity_z", "", key_units::speed, velocity_P<2>),
    at_place("r_E_x", "position in Earth-fixed axes", key_units::length, position<0>),
    at_place("r_E_y", "", key_units::length, position<1>),
    at_place("r_E_z", "", key_units::length, position<2>),
    {"time", "clock of the sensor; wraps", key_units::time, nullptr, nullptr, time},
    {.name = "gnss_time",
     .help = "the same at the instant of the receiver's fix",
     .units = key_units::time,
     .kind = time,
     .instant = MeasuredQuantity::Instant::fix},
    {.name = "gnss_heading_time",
     .help = "the same at the instant of the heading of its two antennas",
     .units = key_units::time,
     .kind = time,
     .instant = MeasuredQuantity::Instant::antennas},
    at_time("utc_year", "UTC; all are 0 where the truth has no date", {}, utc<year>),
    at_time("utc_month", "", {}, utc<month>),
    at_time("utc_day", "", {}, utc<day>),
    at_time("utc_hour", "", {}, utc<since<chrono::hours, chrono::days>>),
    at_time("utc_minute", "", {}, utc<since<chrono::minutes, chrono::hours>>),
    at_time("utc_second", "", {}, utc<since<chrono::seconds, chrono::minutes>>),
    at_time("day_of_year", "from 1", {}, utc<day_of_year>),
    at_time("time_of_day", "UTC", key_units::time, utc<time_of_day>),
    at_time("unix_time", "UTC, since 1970", key_units::time, utc<unix_time>),
    at_time("utc_subsecond", "in steps of 0.1 ms", key_units::time, utc<subsecond>),
    at_time("gps_week", "GPS time", {}, gps_week<at_present>),
    at_time("gps_time_of_week", "", key_units::time, time_of_week<at_present>),
    at_time("gps_time", "since 1980-01-06", key_units::time, gps_time),
    with_fix("gnss_fix", "1 while the receiver has a fix, else 0", {}, fix),
    with_fix("gnss_week", "GPS time of the fix; without a fix the present time", {}, gps_week<at_fix>),
    with_fix("gnss_time_of_week", "", key_units::time, time_of_week<at_fix>),
    with_fix("gnss_is_new", "1 in a sample at which the receiver makes a fix, else 0; see protocols/README.md", {},
             is_new_fix),
    with_fix("gnss_satellites", "that the receiver uses", {}, satellites),
    with_fix("gnss_gdop", "its dilutions of precision: geometric", {}, dilution<&Dilution::geometric>),
    with_fix("gnss_pdop", "of the position", {}, dilution<&Dilution::position>),
    with_fix("gnss_hdop", "horizontal", {}, dilution<&Dilution::horizontal>),
    with_fix("gnss_vdop", "vertical", {}, dilution<&Dilution::vertical>),
    with_fix("gnss_tdop", "of its clock", {}, dilution<&Dilution::time>),
    {"navigation_state",
     "0 truth; of the unit's own solution: 1 aligning, 2 coasting, 3 aided, 4 an attitude without a place",
     {},
     navigation_state},
    anywhere("fix_age", "of its own solution: since the last fix that it used", key_units::time, fix_age),
    {"solution_is_aligning",
     "1 while its own solution is in that state, else 0; the four below likewise",
     {},
     is_in<Solution::State::aligning>},
    {"solution_is_coasting", "", {}, is_in<Solution::State::coasting>},
    {"solution_is_aided", "", {}, is_in<Solution::State::aided>},
    {"solution_is_navigating", "coasting or aided", {}, navigates},
    {"solution_is_levelled", "an attitude without a place", {}, is_in<Solution::State::levelled>},
    {"aid_gnss_used",
     "1 where its own solution has used the aid when it was due last, else 0",
     {},
     uses<aid::position | aid::velocity>},
    {"aid_magnetic_used", "", {}, uses<aid::magnetic_heading>},
    {"aid_antennas_used", "", {}, uses<aid::antennas_heading>},
    {"aid_pressure_used", "", {}, uses<aid::pressure>},
    {"position_quality", "0 where the place is not known, 1 by dead reckoning, 2 otherwise", {}, position_quality},
    anywhere("attitude_sigma_north", "standard deviations of its own solution: tilt about north", key_units::angle,
             attitude_deviation<0>),
    anywhere("attitude_sigma_east", "", key_units::angle, attitude_deviation<1>),
    anywhere("attitude_sigma_down", "", key_units::angle, attitude_deviation<2>),
    anywhere("roll_sigma", "of roll, pitch and yaw, by these", key_units::angle, angle_deviation<0>),
    anywhere("pitch_sigma", "", key_units::angle, angle_deviation<1>),
    anywhere("yaw_sigma", "", key_units::angle, angle_deviation<2>),
    anywhere("navigation_heading_sigma", "of the heading while it is coasting or aided, else 0", key_units::angle,
             heading_deviation),
    anywhere("velocity_sigma_north", "", key_units::speed, deviation<&Solution::velocity, 0>),
    anywhere("velocity_sigma_east", "", key_units::speed, deviation<&Solution::velocity, 1>),
    anywhere("velocity_sigma_down", "", key_units::speed, deviation<&Solution::velocity, 2>),
    anywhere("position_sigma_north", "", key_units::length, deviation<&Solution::position, 0>),
    anywhere("position_sigma_east", "", key_units::length, deviation<&Solution::position, 1>),
    anywhere("position_sigma_down", "", key_units::length, deviation<&Solution::position, 2>),
    with_fix("gnss_latitude", "fix of the receiver, without the unit's own solution", key_units::angle,
             place<received, &Navigation::latitude>),
    with_fix("gnss_longitude", "", key_units::angle, place<received, &Navigation::longitude>),
    with_fix("gnss_height", "", key_units::length, place<received, &Navigation::height>),
    with_fix("gnss_velocity_north", "", key_units::speed, velocity_L<received, 0>),
    with_fix("gnss_velocity_east", "", key_units::speed, velocity_L<received, 1>),
    with_fix("gnss_velocity_down", "", key_units::speed, velocity_L<received, 2>),
    with_fix("gnss_velocity_up", "", key_units::speed, climb<received>),
    with_fix("gnss_ground_speed", "", key_units::speed, ground_speed<received>),
    with_fix("gnss_track", "", key_units::angle, track<received>),
    {"gnss_has_heading", "1 while two antennas of the receiver give a heading, else 0", {}, has_antennas},
    with_antennas("gnss_heading", "of its two antennas, along x of the sensor, from north", key_units::angle,
                  antennas_heading),
    with_antennas("gnss_heading_sigma", "its standard deviation", key_units::angle, antennas_sigma),
    with_fix("gnss_position_sigma_north", "standard deviations that the receiver reports", key_units::length,
             receiver_sigma<&ReceiverAccuracy::position, 0>),
    with_fix("gnss_position_sigma_east", "", key_units::length, receiver_sigma<&ReceiverAccuracy::position, 1>),
    with_fix("gnss_position_sigma_down", "", key_units::length, receiver_sigma<&ReceiverAccuracy::position, 2>),
    with_fix("gnss_horizontal_sigma", "root of the sum of the squares of north and east", key_units::length,
             horizontal_sigma),
    anywhere("gnss_horizontal_accuracy", "the same, at most 655.34 m, and 655.35 m without a fix", key_units::length,
             horizontal_accuracy),
    anywhere("gnss_vertical_accuracy", "gnss_position_sigma_down with these limits", key_units::length,
             vertical_accuracy),
    with_fix("gnss_velocity_sigma_north", "", key_units::speed, receiver_sigma<&ReceiverAccuracy::velocity, 0>),
    with_fix("gnss_velocity_sigma_east", "", key_units::speed, receiver_sigma<&ReceiverAccuracy::velocity, 1>),
    with_fix("gnss_velocity_sigma_down", "", key_units::speed, receiver_sigma<&ReceiverAccuracy::velocity, 2>),
    {"sample_counter", "wraps", {}, nullptr, nullptr, counter},
    {"status", "bits of core/sample.hpp", {}, nullptr, nullptr, status},
};

}  // namespace

void ReadBack::complete_vectors(std::uint32_t sent) noexcept {
  for (std::size_t i = 0; i < std::size(measured_vectors); ++i) {
    const std::uint32_t all = sent >> 3 * i & 7U;
    if (all == 0 || (components >> 3 * i & all) != all) continue;
    measurement.fields |= measured_vectors[i].field;
    for (int axis = 0; axis < 3; ++axis)
      if ((all >> axis & 1U) == 0)
        (measurement.sample.*measured_vectors[i].values)[axis] = std::numeric_limits<double>::quiet_NaN();
  }
}

bool MeasuredQuantity::is_known(const Sample& sample) const noexcept {
  switch (needs) {
    case Needs::place:
      return sample.navigation.is_known;
    case Needs::time:
      return sample.timed().is_known;
    case Needs::fix:
      return sample.fix().is_known;
    case Needs::antennas:
      return sample.antennas() != nullptr;
    case Needs::nothing:
    default:
      return true;
  }
}

std::span<const MeasuredQuantity> measured_quantities() noexcept { return quantities; }

std::optional<MeasuredIn> find_measured(std::string_view name) noexcept {
  const bool negated = name.starts_with('-');
  if (negated) name.remove_prefix(1);
  for (const MeasuredQuantity& quantity : quantities) {
    if (!name.starts_with(quantity.name)) continue;
    const std::string_view suffix = name.substr(quantity.name.size());
    if (negated && quantity.kind != number) continue;
    const double sign = negated ? -1 : 1;
    if (suffix.empty() && quantity.units.empty()) return MeasuredIn{&quantity, sign, 0};
    if (const KeyUnit* unit = find_unit(quantity.units, suffix))
      return MeasuredIn{&quantity, sign * unit->factor, unit->offset};
  }
  return std::nullopt;
}

std::string measured_names() {
  std::string names;
  for (const MeasuredQuantity& quantity : quantities) {
    if (!names.empty()) names += ", ";
    names += quantity.name;
    if (!quantity.units.empty()) names += quantity.units[0].suffix;
  }
  return names;
}

}  // namespace imud
