#include "protocols/quantities/truth_assembly.hpp"

#include <cmath>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/earth/gravitation.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

using Group = TruthGroup;

constexpr double half_pi = 0x1.921fb54442d18p0;
constexpr double sqrt_half = 0x1.6a09e667f3bcdp-1;
constexpr std::int64_t day_ns = 86'400'000'000'000;

Quaternion about(const Vector3& axis, double angle) noexcept {
  const auto [sin, cos] = elementary::sincos(0.5 * angle);
  return {cos, sin * axis.x(), sin * axis.y(), sin * axis.z()};
}

const Vector3 x_axis = Vector3::UnitX(), y_axis = Vector3::UnitY(), z_axis = Vector3::UnitZ();
const Vector3 earth_rate = {0, 0, units::earth_rate};  // in E, and in an inertial N

}  // namespace

double largest_of(const TruthField& field) noexcept {
  if (field.kind != QuantityKind::time) return largest_number_of(field.kind) / field.factor;
  return truth_limit::time_ns / std::pow(10.0, field.exponent);
}

void TruthAssembly::set_limits() noexcept {
  for (const QuantityGroup& group : quantity_groups())
    for (std::size_t i = group.first; i < group.first + group.names.size(); ++i)
      if (given_[i]) limits_.push_back({static_cast<std::uint32_t>(i), largest_number_of(group.kind)});
}

Vector3 TruthAssembly::vector(const TruthReading& in, TruthGroup group) const noexcept {
  return {number(in, group, 0), number(in, group, 1), number(in, group, 2)};
}

// Returns in B a vector that is given in the body axes of the input.
Vector3 TruthAssembly::body(const Vector3& given) const noexcept {
  return axes_.is_flu ? Vector3(given.x(), -given.y(), -given.z()) : given;
}

Vector3 TruthAssembly::level(const TruthReading& in, TruthGroup horizontal, TruthGroup down,
                             TruthGroup up) const noexcept {
  return {number(in, horizontal, 0), number(in, horizontal, 1), has(down) ? number(in, down) : -number(in, up)};
}

void TruthAssembly::begin() noexcept {
  origin_ns_.reset();
  time_of_day_.reset();
  before_.reset();
}

bool TruthAssembly::convert_time(const TruthReading& in, Truth& truth) noexcept {
  using enum TruthGroup;
  constexpr std::int64_t days_per_week = 7;
  std::int64_t ns = in.time_ns();
  std::int64_t days = 0;
  if (time_ == gps_time_of_week) days = days_per_week * std::llround(number(in, gps_week));
  if (time_ == time_of_day && has(day)) {
    days = std::llround(number(in, day));
  } else if (time_ == time_of_day) {
    if (!time_of_day_) time_of_day_.emplace(day_ns);
    ns = time_of_day_->of(ns);
  }
  std::int64_t whole = 0;
  if (__builtin_mul_overflow(days, day_ns, &whole) || __builtin_add_overflow(ns, whole, &ns)) return false;
  const std::int64_t since_epoch = ns;
  if (is_inertial_ && time_ != time) {
    if (!origin_ns_) origin_ns_ = ns;
    if (__builtin_sub_overflow(ns, *origin_ns_, &ns)) return false;
  }
  truth.time.ns = ns;
  // A time that counts from a simulator's start is no date, even if its quantity has the name of a date.
  constexpr std::int64_t year_2001_s = 978'307'200;
  const bool is_utc = time_ == unix_time || time_ == utc;
  truth.has_date = is_utc ? since_epoch / 1'000'000'000 > year_2001_s : time_ == gps_time_of_week;
  if (truth.has_date) truth.start_gps_ns = since_epoch - ns + (is_utc ? gps_ns_from_unix(0) : 0);
  return true;
}

// Sets the Earth's angle and the place, if they are known. Returns false if the place is deep in the Earth.
bool TruthAssembly::convert_place(const TruthReading& in, Truth& truth) noexcept {
  using enum TruthGroup;
  constexpr double least_radius = 6'250'000;  // m
  q_NE_ = q_NL_ = Quaternion::Identity();
  gravity_ = units::standard_gravity;
  if (!is_inertial_) return true;
  const double turned = units::earth_rate * (static_cast<double>(truth.time.ns) * 1e-9);
  angle_ = has(earth_angle) ? number(in, earth_angle) : turned;
  truth.has_earth_angle = true;
  truth.earth_angle = has(earth_angle) ? angle_ - turned : 0.0;
  q_NE_ = about(z_axis, angle_);
  Geodetic place;
  if (has(geodetic)) {
    place = {number(in, geodetic, 0), number(in, geodetic, 1), has(height) ? number(in, height) : 0.0};
    r_E_ = r_E_of(place);
  } else if (has(r_BE_E) || has(r_BN_N)) {
    r_E_ = has(r_BE_E) ? vector(in, r_BE_E) : Vector3(q_NE_.conjugate() * vector(in, r_BN_N));
    if (r_E_.norm() < least_radius) return false;
    place = geodetic_of(r_E_);
  } else {
    return true;
  }
  q_NL_ = about(z_axis, angle_ + place.longitude) * about(y_axis, -half_pi - place.latitude);
  gravity_ = normal_gravity(place.latitude, place.height);
  return true;
}

Matrix3 TruthAssembly::matrix(const TruthReading& in, TruthGroup group) const noexcept {
  Matrix3 m;
  for (Eigen::Index i = 0; i < 3; ++i)
    for (Eigen::Index j = 0; j < 3; ++j) m(i, j) = number(in, group, static_cast<std::size_t>(3 * i + j));
  return m;
}

// Returns false if a quaternion or a matrix does not represent a rotation.
bool TruthAssembly::is_rotation(const TruthReading& in, TruthGroup group) const noexcept {
  constexpr double largest_defect = 0.02;  // of a quaternion's squared length, or a matrix; texts have few digits
  const std::size_t size = quantity_group(group).names.size();
  constexpr std::size_t quaternion = 4, elements = 9;
  if (size == elements) return rotation_defect(matrix(in, group)) <= largest_defect;
  if (size != quaternion) return true;
  double length = 0;
  for (std::size_t i = 0; i < quaternion; ++i) length += number(in, group, i) * number(in, group, i);
  return std::abs(length - 1.0) <= largest_defect;
}

// Returns q_XB for a group whose attitude is relative to a frame X: N, E, or north-east-down.
Quaternion TruthAssembly::attitude(const TruthReading& in, TruthGroup group) const noexcept {
  using enum TruthGroup;
  Quaternion q;
  switch (group) {
    case q_NB:
    case q_LB:
    case q_EB:
    case q_BN:
    case q_BL:
    case q_BE: {
      q = Quaternion(number(in, group, 0), number(in, group, 1), number(in, group, 2), number(in, group, 3));
      q.normalize();
      if (group == q_BN || group == q_BL || group == q_BE) q = q.conjugate();
      break;
    }
    case sigma_BN:
    case sigma_BL:
    case sigma_BE:
      q = quaternion_from_mrp(vector(in, group));
      break;
    case euler_N:
    case euler_L:
    case euler_E:
      q = about(z_axis, number(in, group, 0)) * about(y_axis, number(in, group, 1)) *
          about(x_axis, number(in, group, 2));
      break;
    default: {
      const Matrix3 m = matrix(in, group);
      const bool from_body = group == dcm_NB || group == dcm_LB || group == dcm_EB;
      q = Quaternion(from_body ? m : Matrix3(m.transpose()));
      q.normalize();
      break;
    }
  }
  if (axes_.is_flu) q = q * Quaternion(0, 1, 0, 0);
  const bool to_level = is_relative_to_level(group) || (!is_inertial_ && !is_relative_to_earth(group));
  if (axes_.is_enu && to_level) q = Quaternion(0, sqrt_half, sqrt_half, 0) * q;
  return q;
}

void TruthAssembly::convert_attitude(const TruthReading& in, Truth& truth) noexcept {
  const Quaternion q = attitude(in, *attitude_);
  truth.q_NB = is_relative_to_earth(*attitude_) ? q_NE_ * q : is_relative_to_level(*attitude_) ? q_NL_ * q : q;
}

void TruthAssembly::convert_rate(const TruthReading& in, Truth& truth) noexcept {
  using enum TruthGroup;
  truth.has_rate = rate_.has_value();
  if (!rate_) return;
  if (rate_ == euler_rate) {
    const auto [sin_pitch, cos_pitch] = elementary::sincos(number(in, *attitude_, 1));
    const auto [sin_roll, cos_roll] = elementary::sincos(number(in, *attitude_, 2));
    const double yaw = number(in, euler_rate, 0), pitch = number(in, euler_rate, 1), roll = number(in, euler_rate, 2);
    truth.omega_BN_B = body({roll - yaw * sin_pitch, pitch * cos_roll + yaw * cos_pitch * sin_roll,
                             yaw * cos_pitch * cos_roll - pitch * sin_roll});
  } else {
    truth.omega_BN_B = body(vector(in, *rate_));
  }
  if (is_inertial_ && rate_ != rate_N) truth.omega_BN_B += truth.q_NB.conjugate() * earth_rate;
}

// Integrates the attitude over a step, with the mean of the rates at both ends of the step, and their coning.
void TruthAssembly::integrate_attitude(Truth& truth) noexcept {
  constexpr double longest_s = 1.0;
  const double dt = before_ ? seconds(truth.time - before_->time) : 0.0;
  if (before_ && dt < -longest_s) before_.reset();
  if (before_) {
    const Vector3 &w0 = before_->omega_BN_B, &w1 = truth.omega_BN_B;
    truth.q_NB = before_->q_NB * exp(0.5 * dt * (w0 + w1) + (dt * dt / 12.0) * w0.cross(w1));
    truth.q_NB.normalize();
  }
  if (!before_ || dt > 0) before_ = truth;
}

// Returns whether the position alone shows that N is inertial: the position is relative to the Earth's centre, and of
// the axes only z is known.
bool TruthAssembly::is_about_earth(const Truth& truth) const noexcept {
  return !is_inertial_ && !axes_.is_enu && position_ == TruthGroup::r_BN_N && is_near_earth(truth.r_BN_N);
}

void TruthAssembly::convert_vehicle(const TruthReading& in, Truth& truth) const noexcept {
  using enum TruthGroup;
  constexpr struct {
    TruthGroup group;
    VehicleState state;
  } states[] = {{rotor_speed, VehicleState::rotor_speed},
                {throttle, VehicleState::throttle},
                {airspeed, VehicleState::airspeed},
                {dynamic_pressure, VehicleState::dynamic_pressure},
                {current, VehicleState::current}};
  for (const auto& [group, state] : states)
    if (has(group)) truth.vehicle.set(state, number(in, group));
}

void TruthAssembly::convert_force(const TruthReading& in, Truth& truth) noexcept {
  using enum TruthGroup;
  truth.has_specific_force = force_.has_value();
  if (!force_) return;
  if (force_ == specific_force) {
    truth.specific_force_B = body(vector(in, specific_force));
    return;
  }
  const bool is_on_earth = is_inertial_ || is_about_earth(truth);
  if (is_about_earth(truth)) {
    const Geodetic place = geodetic_of(truth.r_BN_N);
    q_NL_ = about(z_axis, place.longitude) * about(y_axis, -half_pi - place.latitude);
    gravity_ = normal_gravity(place.latitude, place.height);
    const Vector3 v_N = truth.has_velocity ? Vector3(truth.v_BN_N - earth_rate.cross(truth.r_BN_N)) : Vector3::Zero();
    v_L_ = q_NL_.conjugate() * v_N;
  }
  const Vector3 gravity_L = {0, 0, gravity_};
  if (force_ == acceleration_N) {
    Vector3 a_N = vector(in, acceleration_N), attraction_N = gravity_L;
    if (is_on_earth)
      attraction_N = gravitation_N({}, is_inertial_ ? Vector3(q_NE_ * r_E_) : truth.r_BN_N);
    else if (axes_.is_enu)
      a_N = {a_N.y(), a_N.x(), -a_N.z()};
    truth.specific_force_B = truth.q_NB.conjugate() * (a_N - attraction_N);
  } else {
    const Quaternion q_LB = q_NL_.conjugate() * truth.q_NB;
    Vector3 a_L = force_ == acceleration_B ? Vector3(q_LB * body(vector(in, acceleration_B)))
                                           : level(in, acceleration_horizontal, acceleration_down, acceleration_up);
    if (is_on_earth) a_L += 2.0 * (q_NL_.conjugate() * earth_rate).cross(v_L_);
    truth.specific_force_B = q_LB.conjugate() * (a_L - gravity_L);
  }
}

TruthResult TruthAssembly::convert(const TruthReading& in, Truth& truth) noexcept {
  using enum TruthGroup;
  truth = {};
  refused_ = quantity_count;
  for (const auto& [quantity, limit] : limits_)
    if (!(std::abs(in[quantity]) <= limit)) {
      refused_ = quantity;
      return std::isfinite(in[quantity]) ? TruthResult::out_of_range : TruthResult::not_finite;
    }
  const auto refuse = [this](Group group) {
    refused_ = quantity_group(group).first;
    return TruthResult::out_of_range;
  };
  if (!convert_time(in, truth)) return refuse(*time_);
  if (attitude_ && !is_rotation(in, *attitude_)) return refuse(*attitude_);
  if (!convert_place(in, truth)) return refuse(*position_);
  if (attitude_) convert_attitude(in, truth);
  convert_rate(in, truth);
  if (!attitude_) integrate_attitude(truth);

  if (position_ == r_BN_N || position_ == horizontal) {
    truth.r_BN_N = position_ == horizontal ? level(in, horizontal, down, up) : vector(in, r_BN_N);
    if (!is_inertial_ && axes_.is_enu && position_ == r_BN_N)
      truth.r_BN_N = {truth.r_BN_N.y(), truth.r_BN_N.x(), -truth.r_BN_N.z()};
    truth.has_position = true;
  } else if (position_ && (position_ != geodetic || has(height))) {
    truth.r_BN_N = q_NE_ * r_E_;
    truth.has_position = true;
  }
  const Vector3 turning_N = is_inertial_ ? Vector3(earth_rate.cross(q_NE_ * r_E_)) : Vector3(Vector3::Zero());
  if (velocity_) {
    truth.has_velocity = true;
    if (velocity_ == v_BN_N) {
      truth.v_BN_N = vector(in, v_BN_N);
      if (!is_inertial_ && axes_.is_enu) truth.v_BN_N = {truth.v_BN_N.y(), truth.v_BN_N.x(), -truth.v_BN_N.z()};
    } else {
      truth.v_BN_N = turning_N + (velocity_ == v_BE_E   ? q_NE_ * vector(in, v_BE_E)
                                  : velocity_ == v_BE_B ? truth.q_NB * body(vector(in, v_BE_B))
                                                        : q_NL_ * level(in, v_horizontal, v_down, v_up));
    }
  }
  v_L_ = truth.has_velocity ? Vector3(q_NL_.conjugate() * (truth.v_BN_N - turning_N)) : Vector3(Vector3::Zero());
  convert_force(in, truth);
  truth.has_angular_acceleration = has(angular_acceleration);
  if (truth.has_angular_acceleration) truth.omegaDot_BN_B = body(vector(in, angular_acceleration));
  if (has(accumulated_dv)) {
    truth.accumulated_dv = axes_.accumulated_dv;
    truth.accumulated_dv_B = body(vector(in, accumulated_dv));
  }
  truth.has_temperature = has(temperature);
  if (truth.has_temperature) truth.temperature_c = number(in, temperature);
  truth.has_magnetic_field = has(magnetic_field);
  if (truth.has_magnetic_field) truth.magnetic_field_B = body(vector(in, magnetic_field));
  truth.has_pressure = has(pressure);
  if (truth.has_pressure) truth.pressure = number(in, pressure);
  convert_vehicle(in, truth);
  if (has(vehicle)) truth.stream = static_cast<std::uint32_t>(std::llround(number(in, vehicle)));
  if (has(sequence)) truth.sequence = static_cast<std::uint32_t>(std::llround(number(in, sequence)));
  if (!is_finite(truth)) return TruthResult::not_finite;
  return is_in_range(truth) ? TruthResult::ok : TruthResult::out_of_range;
}

void TruthAssembly::describe(const TruthReading& in, RemarkWriter& out) const noexcept {
  if (refused_ == quantity_count) return;
  const auto* group = quantity_groups().data();
  while (refused_ >= group->first + group->names.size()) ++group;
  out << quantity_name(refused_) << " is ";
  if (group->kind == QuantityKind::time || group->kind == QuantityKind::text)
    out << in.time_ns() << " ns, and its limit is " << truth_limit::time_ns << " ns";
  else if (std::abs(in[refused_]) <= largest_number_of(group->kind))
    out << in[refused_] << ", and with those that belong to it no rotation, or no place";
  else
    out << in[refused_] << " in SI, and its limit is " << largest_number_of(group->kind);
}

}  // namespace imud
