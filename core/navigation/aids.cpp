// The measurements of a Navigator's aids, each compared with the motion of its time.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/navigation/azimuth.hpp"
#include "core/navigation/navigator.hpp"
#include "core/units.hpp"

namespace imud {

void Navigator::forget(unsigned aids) noexcept {
  used_ = static_cast<std::uint16_t>(used_ & ~aids);
  rejected_ = static_cast<std::uint16_t>(rejected_ & ~aids);
}

bool Navigator::use(std::uint16_t aid, const InertialFilter::Measurement& measurement) noexcept {
  const bool is_used = filter_.normalized_square(measurement) <= model_.gate;
  (is_used ? used_ : rejected_) |= aid;
  if (!is_used) return false;
  const InertialState before = filter_.motion();
  filter_.update(measurement);
  corrections_.v_N += filter_.motion().v_N - before.v_N;
  corrections_.r_N += filter_.motion().r_N - before.r_N;
  return true;
}

void Navigator::use_fix(const Sample& sample, const At& at) noexcept {
  const Navigation& fix = sample.navigation;
  const std::uint64_t lag = past_.size() - 1;
  if (!has_fix(sample) || number_ < aligned_at_ + lag) return;
  const PositionVelocity measured = in_N(fix, at);
  const Motion& past = past_[(number_ - lag) % past_.size()];
  const Vector3 v_N = past.v_N + corrections_.v_N, r_N = past.r_N + corrections_.r_N;
  const double early_s = seconds(latency_) - static_cast<double>(lag) * period_s_;  // of the fix before that
  const Matrix3 axes = q_NL(measured, fix).conjugate().toRotationMatrix();
  const double factor = static_cast<double>(fix.accuracy_factor);  // the receiver reports its accuracy
  filter_.propagate();
  // The update uses the covariance of the present state for the state at the time of the fix. The errors of the two
  // differ by the errors of the motion between them.
  const auto late2 = [&](int first, double rate) {
    const double change = rate * seconds(latency_);
    return change * change * filter_.covariance().diagonal().segment<3>(first).maxCoeff() * Vector3::Ones();
  };
  const Vector3 position_late2 = late2(InertialFilter::velocity, 1.0),
                velocity_late2 = late2(InertialFilter::phi, units::standard_gravity);
  // The slow errors are larger than the filter expects by the accuracy factor. The excess counts as noise.
  const auto noise2 = [factor](const Vector3& noise, const Vector3& slow) {
    const double more2 = std::max(0.0, factor * factor - 1);
    return Vector3((factor * noise).array().square() + more2 * slow.array().square());
  };
  const InertialFilter::Measurement position = {
      .first = InertialFilter::position,
      .axes_N = axes,
      .innovation = axes * (measured.r_N - r_N + early_s * v_N),
      .variance = position_late2 + noise2(model_.position, model_.slow_position),
      .error = position_error_};
  const double interval_s = static_cast<double>(fix_every_) * period_s_;
  if (is_rejecting_ && rejecting_s_ + interval_s > model_.accept_after_s) {
    if (other_attitude_) return begin_again(measured, sample, at);
    doubt(position.innovation, measured.v_N - v_N);
  }
  const bool is_near = use(aid::position, position);
  // The position has corrected the velocity as well.
  if (!is_near || !use(aid::velocity, {.first = InertialFilter::velocity,
                                       .axes_N = axes,
                                       .innovation = axes * (measured.v_N - past.v_N - corrections_.v_N),
                                       .variance = velocity_late2 + noise2(model_.velocity, model_.slow_velocity),
                                       .error = velocity_error_})) {
    if (std::exchange(is_rejecting_, true)) {
      rejecting_s_ += interval_s;
    } else {
      rejecting_s_ = 0;
      other_attitude_.reset();
      has_begun_ = false;
    }
    ++fixes_.rejected;
    return;
  }
  ++fixes_.used;
  since_fix_s_ = 0;
  is_rejecting_ = false;
}

// Measures the angle about the vertical between the horizontal parts of the measured field and of the Earth's.
void Navigator::use_heading(const Sample& sample, const At& at) noexcept {
  if (sample.magnetic_field.isZero(0.0)) return;
  const Navigation here = place(at);
  if (!here.is_known) return;
  const PositionVelocity position = position_of(at);
  const Quaternion q_LN = earth_.q_LN(position, here);
  const Vector3 field = q_LN * (filter_.motion().q_NP * sample.magnetic_field), model = earth_.magnetic_field_L(here);
  if (!has_azimuth(field) || !has_azimuth(model)) return;
  const InertialFilter::Measurement heading = azimuth_measurement(model, field, q_LN, model_.heading);
  const double interval_s = static_cast<double>(heading_every_) * period_s_;
  const bool is_used = use_azimuth(aid::magnetic_heading, heading, q_LN, interval_s, headings_rejected_s_);
  ++(is_used ? headings_.used : headings_.rejected);
}

bool Navigator::use_azimuth(std::uint16_t aid, const InertialFilter::Measurement& azimuth, const Quaternion& q_LN,
                            double interval_s, double& rejected_s) noexcept {
  filter_.propagate();
  if (rejected_s > model_.accept_heading_after_s)
    filter_.add_variance(InertialFilter::phi, q_LN.conjugate() * Vector3::UnitZ(),
                         azimuth.innovation[0] * azimuth.innovation[0]);
  const bool is_used = use(aid, azimuth);
  rejected_s = is_used ? 0 : rejected_s + interval_s;
  return is_used;
}

void Navigator::use_antennas(const Sample& sample, const At& at) noexcept {
  const Navigation here = place(at);
  const AntennaLine& line = sample.navigation.antennas;
  if (!sample.navigation.is_known || !here.is_known) return;
  const Quaternion q_LN = earth_.q_LN(position_of(at), here);
  const AntennaLine estimated = {.direction_L = q_LN * (filter_.motion().q_NP * Vector3::UnitX()),
                                 .sigma = line.sigma};
  if (!line.has_heading() || !estimated.has_heading()) return;
  const auto heading = azimuth_measurement(line.direction_L, estimated.direction_L, q_LN, line.sigma);
  const double interval_s = static_cast<double>(fix_every_) * period_s_;
  const bool is_used = use_azimuth(aid::antennas_heading, heading, q_LN, interval_s, antenna_headings_rejected_s_);
  ++(is_used ? antenna_headings_.used : antenna_headings_.rejected);
}

void Navigator::use_height(const Sample& sample, const At& at) noexcept {
  if (!(sample.pressure > 0) || !has(aid::pressure)) return;
  const Navigation here = place(at);
  if (!here.is_known) return;
  InertialFilter::Measurement height = {.first = InertialFilter::position, .rows = 1};
  height.axes_N.row(0) = -(q_NL(position_of(at), here) * Vector3::UnitZ()).transpose();
  height.innovation[0] = height_of(standard_altitude(sample.pressure)) - here.height;
  height.variance[0] = model_.barometric_height * model_.barometric_height;
  height.error = height_error_;
  filter_.propagate();
  if (heights_rejected_s_ > model_.accept_after_s) {  // the barometer's offset has changed
    const double beyond = height.innovation[0] - filter_.added().estimates[height_error_];
    filter_.add_aid_variance(height_error_, beyond * beyond);
  }
  if (use(aid::pressure, height)) {
    ++heights_.used;
    heights_rejected_s_ = 0;
  } else {
    ++heights_.rejected;
    heights_rejected_s_ += static_cast<double>(height_every_) * period_s_;
  }
}

// The sensors cannot tell rest from a smooth flight. The receiver's velocity can. Without a fix the solution's
// own velocity must be small: a unit that has coasted for long beyond `fastest` finds no rest.
bool Navigator::is_slow(const Navigation& here, const Navigation& fix) const noexcept {
  constexpr double fastest = 2.0, deviations = 5.0;  // m/s; both chosen
  if (here.v_L.squaredNorm() > fastest * fastest) return false;
  if (!fix.is_known || !has(aid::position)) return true;
  const Vector3 sigma = (model_.velocity.array().square() + model_.slow_velocity.array().square()).sqrt();
  const Vector3 largest = deviations * static_cast<double>(fix.accuracy_factor) * sigma;
  return (fix.v_L.array().abs() <= largest.array()).all();
}

void Navigator::use_rest(const Sample& sample, const At& at, double dt) noexcept {
  const Vector3 g_N = gravitation_N(filter_.gravitation(), filter_.motion().r_N);
  const auto step = filter_.corrected(sample.delta_angle, sample.delta_velocity, dt);
  const std::optional<bool> is_at_rest = rest_detector_.add(step.delta_angle, step.delta_velocity, dt, g_N.norm());
  if (!is_at_rest) return;
  forget(aid::zero_velocity);
  Navigation here = place(at);
  if (!*is_at_rest || !here.is_known) return;
  if (!is_slow(here, sample.navigation)) {
    rejected_ |= aid::zero_velocity;
    ++rests_.rejected;
    return;
  }
  here.v_L.setZero();
  const PositionVelocity still = earth_.position_velocity(here, at.time, at.earth_angle);
  constexpr double sigma = 0.02;  // m/s; chosen
  filter_.propagate();
  const bool is_used = use(aid::zero_velocity, {.first = InertialFilter::velocity,
                                                .innovation = still.v_N - filter_.motion().v_N,
                                                .variance = Vector3::Constant(sigma * sigma)});
  ++(is_used ? rests_.used : rests_.rejected);
}

}  // namespace imud
