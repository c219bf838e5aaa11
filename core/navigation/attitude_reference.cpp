#include "core/navigation/attitude_reference.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/attitude.hpp"
#include "core/navigation/azimuth.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

using Filter = AttitudeFilter;

double gravity_of(const GravitationModel& gravitation) {
  const bool is_constant = gravitation.kind == GravitationModel::Kind::constant && gravitation.constant != 0;
  return is_constant ? std::abs(gravitation.constant) : units::standard_gravity;
}

Vector3 horizontal(const Vector3& v) { return {v.x(), v.y(), 0.0}; }

}  // namespace

AttitudeReference::AttitudeReference(const NavigatorModel& model, const ImuModel& imu)
    : model_(model),
      earth_(imu.earth),
      filter_({imu.delta_angle, imu.delta_velocity}, {.noise = model.noise,
                                                      .acceleration = model.quiet_acceleration,
                                                      .accelerometer_bias = model.accelerometer_bias,
                                                      .gravity = gravity_of(model.gravitation),
                                                      .unmodelled_rate = units::earth_rate}),
      heading_every_(samples_between(imu.rate_hz, model.magnetic_rate_hz)) {}

void AttitudeReference::restart() noexcept {
  is_aligned_ = false;
  held_s_ = 0;
  last_time_.reset();
  number_ = 0;
  given_.reset();
}

void AttitudeReference::set_aids(const NavigationAids& aids) noexcept {
  aids_ = aids;
  filter_.set_levelling((aids.withheld & aid::gravity) == 0);
}

void AttitudeReference::give(const GivenHeading& heading) noexcept {
  if (!is_aligned_) {
    alignment_.begin();
    given_ = heading;
  } else if (!heading.only_in_alignment) {
    const std::optional<double> angle = turn_to(heading, filter_.q_LP());
    if (!angle) return;
    filter_.turn(*angle, square(GivenHeading::sigma));
    is_rejecting_ = false;
  }
}

void AttitudeReference::take(Sample& sample) noexcept {
  const double dt = last_time_ ? seconds(sample.time - *last_time_) : 0;
  last_time_ = sample.time;
  if ((sample.status & status::truth_stale) != 0) {
    held_s_ += dt;
  } else {
    if (held_s_ > longest_hold_s) {
      is_aligned_ = false;
      number_ = 0;
    }
    held_s_ = 0;
  }
  if (!is_aligned_) {
    align(sample, dt);
  } else if (dt > 0) {
    filter_.advance(sample.delta_angle, sample.delta_velocity, dt);
    if (heading_every_ > 0 && (number_ - aligned_at_) % heading_every_ == 0) use_heading(sample);
  }
  ++number_;
  write(sample);
}

// GivenHeading::ahead_P is in the axes of the platform at the begin of the window. The direction does not turn with
// the platform, so that a new window needs its components in the new axes.
void AttitudeReference::begin_window() noexcept {
  if (given_) given_->ahead_P = alignment_.q_P0P().conjugate() * given_->ahead_P;
  alignment_.begin();
}

void AttitudeReference::find_north(const Sample& sample) noexcept {
  if (knows_north_ || !sample.navigation.is_known) return;
  knows_north_ = true;
  const Vector3 model_L = earth_.magnetic_field_L(sample.navigation);
  north_ = has_azimuth(model_L) ? horizontal(model_L).normalized() : Vector3(Vector3::UnitX());
}

void AttitudeReference::align(const Sample& sample, double dt) noexcept {
  if (number_ == 0) {
    alignment_.begin();
    knows_north_ = false;
    north_ = Vector3::UnitX();
  } else if (dt > 0) {
    alignment_.add(sample.delta_angle, sample.delta_velocity, dt, sample.magnetic_field);
  }
  find_north(sample);
  constexpr double tiny = 1e-6;  // s, rad
  if (model_.alignment == NavigatorModel::Alignment::truth) {
    const Vector3 field_L = sample.q_LP * sample.magnetic_field;
    if (!knows_north_ && has_azimuth(field_L)) north_ = horizontal(field_L).normalized();
    return begin_filter(sample.q_LP, {tiny, tiny}, field_L);
  }
  const double t = alignment_.time_s();
  if (t < model_.alignment_s - tiny) return;
  const double g = filter_.tuning().gravity, force = alignment_.delta_velocity_P0().norm() / t;
  const bool is_level = std::abs(force - g) < 0.5 * g;
  if (!is_level || (aids_.waits && !given_)) return begin_window();
  // A steady acceleration is an error of all the window.
  const double excess = std::max(0.0, std::abs(force - g) - Filter::gravity_of_place);
  const Quaternion q_LP = levelled(sample);
  begin_filter(q_LP, {std::sqrt(square(model_.quiet_acceleration) + square(excess)) / g, units::pi},
               q_LP * (alignment_.q_P0P().conjugate() * alignment_.magnetic_field_P0()) / t);
}

// Returns the attitude by the sums of the alignment, which include this sample, or by this sample alone if there are
// no sums.
Quaternion AttitudeReference::levelled(const Sample& sample) const noexcept {
  const bool has_sums = alignment_.time_s() > 0;
  const Quaternion q_P0P = has_sums ? alignment_.q_P0P() : Quaternion::Identity();
  const Vector3 up = has_sums ? alignment_.delta_velocity_P0() : sample.specific_force;
  const Vector3 field = has_sums ? alignment_.magnetic_field_P0() : sample.magnetic_field;
  if (up.isZero(0.0)) return Quaternion::Identity();
  Vector3 ahead_L = north_, ahead_P0 = field;
  constexpr double least_sine2 = 1e-4;
  if (given_ && are_apart(up, given_->ahead_P, least_sine2)) {
    ahead_L = horizontal_at(given_->azimuth);
    ahead_P0 = given_->ahead_P;
  } else if (!are_apart(up, field, least_sine2)) {
    ahead_L = Vector3::UnitX();
    ahead_P0 = q_P0P * Vector3::UnitX();
    if (!are_apart(up, ahead_P0, least_sine2)) ahead_P0 = q_P0P * Vector3::UnitZ();
  }
  return (rotation_of_pairs(-Vector3::UnitZ(), ahead_L, up, ahead_P0) * q_P0P).normalized();
}

// The heading of `q_LP` is by the field. The filter gets this heading as a measurement, because the error of the
// heading depends on the tilt.
void AttitudeReference::begin_filter(const Quaternion& q_LP, const Vector2& sigma, const Vector3& field_L) noexcept {
  Filter::Covariance P = Filter::Covariance::Zero();
  P.diagonal() << square(sigma.x()), square(sigma.x()), square(sigma.y()),
      Vector3::Constant(square(model_.gyro_bias) + square(units::earth_rate));
  filter_.begin(q_LP, P);
  is_aligned_ = true;
  aligned_at_ = number_;
  is_rejecting_ = false;
  used_ = rejected_ = 0;
  field_.reset();
  if (given_) given_->ahead_P = alignment_.q_P0P().conjugate() * given_->ahead_P;
  const std::optional<double> to_given = given_ ? turn_to(*given_, q_LP) : std::nullopt;
  given_.reset();
  if (to_given) filter_.turn(*to_given, square(GivenHeading::sigma));
  if (!has_azimuth(field_L)) return;
  field_ = field_of(field_L);
  if (!to_given) filter_.update(heading_by(field_L));
}

AttitudeReference::Field AttitudeReference::field_of(const Vector3& field_L) noexcept {
  return {field_L.norm(), field_L.z() / horizontal(field_L).norm()};
}

// Returns the angle about the vertical from the horizontal part of the measured field to north, as a measurement. A
// tilt about north changes this angle by the tangent of the dip.
Filter::Heading AttitudeReference::heading_by(const Vector3& field_L) const noexcept {
  const double across = field_L.x() * north_.y() - field_L.y() * north_.x();
  return {.axis_L = Vector3::UnitZ() - field_->dip * north_,
          .innovation = elementary::atan2(across, horizontal(field_L).dot(north_)),
          .variance = square(model_.heading)};
}

void AttitudeReference::use_heading(const Sample& sample) noexcept {
  used_ = static_cast<std::uint16_t>(used_ & ~aid::magnetic_heading);
  rejected_ = static_cast<std::uint16_t>(rejected_ & ~aid::magnetic_heading);
  const Vector3 field_L = filter_.q_LP() * sample.magnetic_field;
  if (!has_azimuth(field_L)) return;
  if (!field_) {
    find_north(sample);
    field_ = field_of(field_L);
  }
  const Filter::Heading heading = heading_by(field_L);
  const double interval_s = 1 / model_.magnetic_rate_hz;
  // Neither the field nor the heading is trusted any more.
  if (is_rejecting_ && rejecting_s_ + interval_s > model_.accept_after_s) {
    field_ = field_of(field_L);
    filter_.add_heading_variance(square(heading.innovation));
  }
  const bool is_disturbed = std::abs(field_L.norm() - field_->strength) > field_change * field_->strength;
  if (is_disturbed || !(filter_.normalized_square(heading) <= model_.gate)) {
    rejecting_s_ = std::exchange(is_rejecting_, true) ? rejecting_s_ + interval_s : 0;
    rejected_ |= aid::magnetic_heading;
    ++headings_.rejected;
    return;
  }
  filter_.update(heading);
  is_rejecting_ = false;
  used_ |= aid::magnetic_heading;
  ++headings_.used;
}

// An error of the accelerometers is a tilt that the filter cannot see.
void AttitudeReference::write(Sample& sample) const noexcept {
  Solution& solution = sample.solution.emplace();
  solution.receiver = sample.navigation;
  if (!is_aligned_) {
    sample.q_LP = levelled(sample);
    solution.attitude.setConstant(static_cast<float>(units::pi));  // anything, as far as is known
    return;
  }
  sample.q_LP = filter_.q_LP();
  const double bias2 = square(model_.accelerometer_bias / filter_.tuning().gravity),
               dip2 = field_ ? square(field_->dip) : 0;
  const Filter::State variance = filter_.covariance().diagonal();
  const Vector3 attitude2 = variance.segment<3>(Filter::phi) + bias2 * Vector3(1, 1, dip2);
  solution.state = Solution::State::levelled;
  solution.used = static_cast<std::uint16_t>(used_ | (aid::gravity & ~aids_.withheld));
  solution.rejected = rejected_;
  if (sample.navigation.is_known) {  // the place is the truth's with the errors of a receiver
    const auto sigma = [&](const Vector3& noise, const Vector3& slow) -> Eigen::Vector3f {
      const Vector3 root = (noise.array().square() + slow.array().square()).sqrt();
      return sample.navigation.accuracy_factor * root.cast<float>();
    };
    solution.position = sigma(model_.position, model_.slow_position);
    solution.velocity = sigma(model_.velocity, model_.slow_velocity);
  }
  solution.attitude = attitude2.cwiseSqrt().cwiseMin(units::pi).cast<float>();
  solution.gyro_bias = filter_.gyro_bias_P().cast<float>();
  solution.gyro_bias_sigma = variance.segment<3>(Filter::gyro_bias).cwiseSqrt().cast<float>();
}

}  // namespace imud
