#include "core/navigation/navigator.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/attitude.hpp"
#include "core/navigation/azimuth.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

std::uint64_t samples_of(Nanoseconds latency, double rate_hz) {
  return static_cast<std::uint64_t>(seconds(latency) * rate_hz + 0.5);
}

// The errors of the aids that the filter estimates, and the numbers of the first of each aid; -1: it has none.
struct AidErrors {
  explicit AidErrors(const NavigatorModel& model) {
    using Error = InertialFilter::AidError;
    const auto add = [this](int& number, const Vector3& sigma, double time_s) {
      if (sigma.isZero(0.0)) return;
      number = static_cast<int>(all.size());
      for (const double of_axis : sigma) all.push_back(Error::correlated(of_axis, time_s));
    };
    add(position, model.slow_position, model.slow_position_s);
    add(velocity, model.slow_velocity, model.slow_velocity_s);
    if (model.barometer_rate_hz <= 0) return;
    height = static_cast<int>(all.size());
    all.push_back(Error::walk(NavigatorModel::barometric_offset, model.barometric_walk));
  }
  std::vector<InertialFilter::AidError> all;
  int position = -1, velocity = -1, height = -1;
};

// Returns the covariance in other axes of components with the standard deviations `sigma`. The columns of `axes` are
// the directions of the components.
Matrix3 turned(const Matrix3& axes, const Vector3& sigma) {
  return axes * sigma.cwiseProduct(sigma).asDiagonal() * axes.transpose();
}

}  // namespace

Navigator::Navigator(const NavigatorModel& model, const ImuModel& imu)
    : model_(model),
      earth_(imu.earth),
      start_gps_ns_(imu.earth.start_gps_ns),
      filter_(model_.gravitation, {imu.delta_angle, imu.delta_velocity}, model_.noise, AidErrors(model_).all),
      period_s_(1.0 / imu.rate_hz),
      latency_(imu.navigation.latency),
      fix_every_(samples_between(imu.rate_hz, model_.gnss_rate_hz)),
      heading_every_(samples_between(imu.rate_hz, model_.magnetic_rate_hz)),
      height_every_(samples_between(imu.rate_hz, model_.barometer_rate_hz)),
      receiver_(fix_every_),
      position_error_(AidErrors(model_).position),
      velocity_error_(AidErrors(model_).velocity),
      height_error_(AidErrors(model_).height),
      past_(static_cast<std::size_t>(samples_of(latency_, imu.rate_hz) + 1)),
      rest_detector_(model_.noise) {
  filter_.estimate_scale_factors(scale_sigmas());
}

void Navigator::restart() noexcept {
  is_aligned_ = has_begun_ = false;
  held_s_ = 0;
  truth_time_.reset();
  last_time_.reset();
  up_P_.reset();
  number_ = 0;
  given_.reset();
  receiver_.restart();
}

void Navigator::set_aids(const NavigationAids& aids) noexcept {
  const double before = scale_sigmas().accelerometer;
  aids_ = aids;
  filter_.estimate_scale_factors(scale_sigmas());
  if (!is_aligned_ || scale_sigmas().accelerometer == before) return;
  // In gravity the scale factors were a part of the estimated bias, or will be a part of it.
  const double in_gravity = units::standard_gravity * model_.accelerometer_scale_factor;
  filter_.add_variance(InertialFilter::accelerometer_bias, square(in_gravity));
}

void Navigator::give(const GivenHeading& heading) noexcept {
  if (!is_aligned_) {
    alignment_.begin();
    has_begun_ = false;
    given_ = heading;
  } else if (!heading.only_in_alignment) {
    const Quaternion q_LN = earth_.q_LN(position_of(at_), place(at_));
    const Vector3 down_N = q_LN.conjugate() * Vector3::UnitZ();
    const std::optional<double> angle = turn_to(heading, q_LN * filter_.motion().q_NP);
    if (!angle) return;
    filter_.turn(down_N, *angle, square(GivenHeading::sigma));
    headings_rejected_s_ = antenna_headings_rejected_s_ = 0;
    other_attitude_.reset();
  }
}

double Navigator::step(const Sample& sample) noexcept {
  const double dt = last_time_ ? seconds(sample.time - *last_time_) : 0;
  last_time_ = sample.time;
  return dt;
}

void Navigator::take_at_rest(Sample& sample) noexcept {
  const double dt = step(sample);
  receiver_.report(sample.navigation, dt, sample.solution.emplace());
  write_aligning(sample, dt);
}

void Navigator::take(Sample& sample, TruthTime time, std::optional<double> earth_angle) noexcept {
  const double dt = step(sample);
  const Navigation& fix = sample.navigation;
  if (fix.is_known) {
    origin_ = fix.origin;
    receiver_clock_ns_ = fix.gps_ns - start_gps_ns_ - (time - TruthTime{}).count();
  }
  const bool is_held = (sample.status & status::truth_stale) != 0 || (truth_time_ && time <= *truth_time_);
  truth_time_ = time;
  hold(is_held, time, dt);
  if (held_s_ <= longest_hold_s)
    at_ = {is_held && is_aligned_ ? std::max(time, at_.time + nanoseconds(dt)) : time, earth_angle};
  const At& at = at_;
  if (!is_aligned_ && !is_held) {
    align(sample, at, dt);
    if (is_aligned_) receiver_.restart();  // the filter begins with the fix of this sample
  }
  const bool is_epoch = receiver_.is_epoch();
  receiver_.report(fix, dt, sample.solution.emplace());
  if (!is_aligned_) return write_aligning(sample, dt);
  if (dt > 0 && held_s_ <= longest_hold_s && number_ != aligned_at_) {
    filter_.advance(sample.delta_angle, sample.delta_velocity, dt);
    since_fix_s_ += dt;
  }
  remember_motion();
  const std::uint64_t since = number_ - aligned_at_;
  if (!is_held && since > 0) {
    if (is_rejecting_) review(sample, at, dt);
    const bool is_due = is_epoch && fix_every_ > 0;
    if (is_due) {
      forget(aid::position | aid::velocity | aid::antennas_heading);
      use_fix(sample, at);
      if (has_antennas(sample)) use_antennas(sample, at);
    }
    if (heading_every_ > 0 && since % heading_every_ == 0) {
      forget(aid::magnetic_heading);
      use_heading(sample, at);
    }
    if (height_every_ > 0 && since % height_every_ == 0) {
      forget(aid::pressure);
      use_height(sample, at);
    }
    if (model_.zero_velocity && dt > 0) use_rest(sample, at, dt);
  }
  ++number_;
  if (write(sample, at)) return;
  is_aligned_ = has_begun_ = false;  // the solution has left the Earth
  write_aligning(sample, dt);
}

// While truth is late the filter's time runs on, and truth returns at about that time. If truth returns at an earlier
// time, the simulator stood still meanwhile, and the solution is not the one of the vehicle's motion.
void Navigator::hold(bool is_held, TruthTime time, double dt) noexcept {
  if (is_held) {
    held_s_ += dt;
    return;
  }
  const double held_s = std::exchange(held_s_, 0.0);
  const bool stood_still = held_s > 0 && at_.time + nanoseconds(dt) - time > nanoseconds(period_s_);
  if (held_s > longest_hold_s || (is_aligned_ && stood_still)) is_aligned_ = has_begun_ = false;
}

void Navigator::align(const Sample& sample, const At& at, double dt) noexcept {
  if (number_++ > 0 && dt > 0) alignment_.add(sample.delta_angle, sample.delta_velocity, dt, sample.magnetic_field);
  const Navigation& fix = sample.navigation;
  // Without a velocity, or a heading that is waited for, the attitude is levelled on, and the window begins later.
  if (!has_fix(sample) || (aids_.waits && !given_)) {
    has_begun_ = false;
    return;
  }
  const PositionVelocity now = in_N(fix, at);
  constexpr double rounding_s = 1e-6;
  if (model_.alignment == NavigatorModel::Alignment::truth) {
    // No truth is older than the run: the first fixes are not late.
    if (static_cast<double>(number_ - 1) * period_s_ + rounding_s < seconds(latency_)) return;
    PositionVelocity there = now;  // the attitude is not late
    there.time = at.time;
    std::optional<GivenHeading> given = std::exchange(given_, std::nullopt);
    begin_filter(now, sample, at, q_NL(there, fix) * sample.q_LP, {1e-6, 1e-6});
    if (!given) return;
    given->ahead_P = alignment_.q_P0P().conjugate() * given->ahead_P;
    given->only_in_alignment = false;
    return give(*given);
  }
  if (const auto aligned = measure_attitude(now, sample))
    begin_filter(now, sample, at, aligned->q_NP, aligned->sigma);
}

std::optional<Navigator::Aligned> Navigator::measure_attitude(const PositionVelocity& now,
                                                              const Sample& sample) noexcept {
  if (!std::exchange(has_begun_, true)) {
    // The direction that has the given heading does not turn with the platform.
    if (given_) given_->ahead_P = alignment_.q_P0P().conjugate() * given_->ahead_P;
    alignment_.begin();
    first_v_N_.reset();
    window_.reset();
  }
  // The fixes at the begin and at the end of the window arrive late.
  constexpr double rounding_s = 1e-6;
  const double t = alignment_.time_s() + rounding_s, late_s = seconds(latency_);
  if (!first_v_N_ && t >= late_s) first_v_N_ = now.v_N;
  if (!window_ && t >= model_.alignment_s) window_ = alignment_;
  if (!first_v_N_ || !window_ || t < model_.alignment_s + late_s) return std::nullopt;
  has_begun_ = false;
  return coarse_attitude(now, sample);
}

// The change of the velocity less the gravitation's is one direction. The other direction is the line between two
// antennas, the magnetic field, or the course, to which the platform's x axis is taken to point.
std::optional<Navigator::Aligned> Navigator::coarse_attitude(const PositionVelocity& now,
                                                             const Sample& sample) const noexcept {
  const double t = window_->time_s();
  const Vector3 first_N = now.v_N - *first_v_N_ - t * gravitation_N(filter_.gravitation(), now.r_N);
  const Vector3 first_P0 = window_->delta_velocity_P0();
  const Quaternion from_L = q_NL(now, sample.navigation);
  Vector3 second_N, second_P0;
  Vector2 sigma = {
      model_.accelerometer_bias / units::standard_gravity + 2.0 * model_.velocity.x() / (units::standard_gravity * t),
      2.0 * model_.heading};
  const auto add_tilt = [&sigma](const Vector3& second_L) {
    const double by_tilt = sigma.x() * second_L.z() / second_L.head<2>().norm();
    sigma.y() = std::sqrt(sigma.y() * sigma.y() + by_tilt * by_tilt);
  };
  constexpr double least_sine2 = 1e-2;
  if (given_ && are_apart(first_P0, given_->ahead_P, least_sine2)) {
    second_N = from_L * horizontal_at(given_->azimuth);
    second_P0 = given_->ahead_P;
    sigma.y() = GivenHeading::sigma;
  } else if (has_antennas(sample)) {
    const AntennaLine& line = sample.navigation.antennas;
    second_N = from_L * line.direction_L;
    sigma.y() = line.sigma;
    add_tilt(line.direction_L);
    second_P0 = alignment_.q_P0P() * Vector3::UnitX();
  } else if (!window_->magnetic_field_P0().isZero(0.0)) {
    const Vector3 field_L = earth_.magnetic_field_L(sample.navigation);
    second_N = from_L * field_L;
    add_tilt(field_L);
    second_P0 = window_->magnetic_field_P0();
  } else {
    constexpr double slowest = 2.0, sideslip = 0.17;  // m/s, rad
    const Vector3 course_L(sample.navigation.v_L.x(), sample.navigation.v_L.y(), 0.0);
    if (course_L.squaredNorm() < slowest * slowest) return std::nullopt;
    second_N = from_L * course_L;
    second_P0 = window_->q_P0P() * Vector3::UnitX();
    sigma.y() = sideslip;
  }
  if (!are_apart(first_N, second_N, least_sine2) || !are_apart(first_P0, second_P0, least_sine2)) return std::nullopt;
  return Aligned{rotation_of_pairs(first_N, second_N, first_P0, second_P0) * alignment_.q_P0P(), sigma};
}

void Navigator::begin_filter(const PositionVelocity& now, const Sample& sample, const At& at, const Quaternion& q_NP,
                             const Vector2& sigma, double more_gyro_bias) noexcept {
  using Inertial = InertialFilter;
  const Matrix3 axes = q_NL(now, sample.navigation).toRotationMatrix();
  Inertial::Covariance P = Inertial::Covariance::Zero();
  P.block<3, 3>(Inertial::phi, Inertial::phi) = turned(axes, {sigma.x(), sigma.x(), sigma.y()});
  P.block<3, 3>(Inertial::velocity, Inertial::velocity) =
      turned(axes, model_.velocity) + turned(axes, model_.slow_velocity);
  P.block<3, 3>(Inertial::position, Inertial::position) =
      turned(axes, model_.position) + turned(axes, model_.slow_position);
  P.block<3, 3>(Inertial::gyro_bias, Inertial::gyro_bias)
      .diagonal()
      .setConstant(model_.gyro_bias * model_.gyro_bias + more_gyro_bias * more_gyro_bias);
  P.block<3, 3>(Inertial::accelerometer_bias, Inertial::accelerometer_bias)
      .diagonal()
      .setConstant(square(scale_sigmas().accelerometer > 0 ? model_.accelerometer_bias_beside_scale
                                                           : model_.accelerometer_bias));
  const double age_s = seconds(at.time - now.time);
  const Vector3 change = age_s * (q_NP * sample.specific_force + gravitation_N(filter_.gravitation(), now.r_N));
  filter_.begin({q_NP, now.v_N + change, now.r_N + age_s * (now.v_N + 0.5 * change)}, Vector3::Zero(),
                Vector3::Zero(), P);
  // The first fix has the errors of the later ones.
  if (position_error_ >= 0) filter_.begin_by(Inertial::position, axes.transpose(), position_error_);
  if (velocity_error_ >= 0) filter_.begin_by(Inertial::velocity, axes.transpose(), velocity_error_);
  is_aligned_ = true;
  given_.reset();
  up_P_.reset();
  aligned_at_ = number_;
  since_fix_s_ = 0;
  is_rejecting_ = false;
  heights_rejected_s_ = headings_rejected_s_ = antenna_headings_rejected_s_ = 0;
  rest_detector_.begin();
  corrections_ = {};
  used_ = rejected_ = 0;
}

void Navigator::remember_motion() noexcept {
  past_[number_ % past_.size()] = {filter_.motion().v_N - corrections_.v_N, filter_.motion().r_N - corrections_.r_N};
}

Quaternion Navigator::q_NL(const PositionVelocity& position, const Navigation& place) const noexcept {
  return earth_.q_LN(position, place).conjugate();
}

PositionVelocity Navigator::in_N(const Navigation& fix, const At& at) const noexcept {
  return earth_.position_velocity(fix, at.time - latency_, at.earth_angle);
}

PositionVelocity Navigator::position_of(const At& at) const noexcept {
  return {.is_known = true,
          .time = at.time,
          .r_N = filter_.motion().r_N,
          .v_N = filter_.motion().v_N,
          .earth_angle = at.earth_angle};
}

Navigation Navigator::place(const At& at) const noexcept { return earth_.navigation(position_of(at)); }

// The attitude is levelled by the mean of the specific force, as if this were gravity's reaction alone, and turned
// north by the magnetic field, without declination.
void Navigator::write_aligning(Sample& sample, double dt) noexcept {
  if (!up_P_) up_P_ = sample.specific_force;
  *up_P_ = exp(-sample.delta_angle) * *up_P_;
  *up_P_ += std::min(1.0, dt / model_.alignment_s) * (sample.specific_force - *up_P_);
  const Vector3 up = *up_P_, field = sample.magnetic_field;
  const Vector3 ahead = field.isZero(0.0) ? Vector3(Vector3::UnitX()) : field;
  const bool is_level = are_apart(up, ahead, 1e-6);
  sample.q_LP = is_level ? rotation_of_pairs(-Vector3::UnitZ(), Vector3::UnitX(), up, ahead) : Quaternion::Identity();
  sample.navigation = {};
  sample.solution->attitude.setConstant(static_cast<float>(units::pi));  // anything, as far as is known
}

bool Navigator::write(Sample& sample, const At& at) const noexcept {
  sample.navigation = place(at);
  if (!sample.navigation.is_known) return false;
  const Quaternion q_LN = earth_.q_LN(position_of(at), sample.navigation);
  sample.navigation.gps_ns += receiver_clock_ns_;
  sample.navigation.origin = origin_;
  sample.navigation.satellites = sample.fix().is_known ? sample.fix().satellites : 0;
  sample.navigation.accuracy_factor = sample.fix().accuracy_factor;
  sample.navigation.dilution = sample.fix().dilution;
  sample.q_LP = q_LN * filter_.motion().q_NP;
  const Matrix3 axes = q_LN.toRotationMatrix();
  const auto sigma = [&](int first) {
    const Matrix3 P = axes * filter_.covariance().block<3, 3>(first, first) * axes.transpose();
    return Vector3(P.diagonal().cwiseSqrt());
  };
  const double gap_s = std::max(coasting_after_s, 3.0 * static_cast<double>(fix_every_) * period_s_);
  Solution& solution = *sample.solution;
  solution.state = since_fix_s_ > gap_s || fix_every_ == 0 ? Solution::State::coasting : Solution::State::aided;
  solution.used = used_;
  solution.rejected = rejected_;
  solution.since_fix_s = static_cast<float>(since_fix_s_);
  solution.attitude = sigma(InertialFilter::phi).cast<float>();
  solution.velocity = sigma(InertialFilter::velocity).cast<float>();
  solution.position = sigma(InertialFilter::position).cast<float>();
  solution.gyro_bias = filter_.gyro_bias_P().cast<float>();
  solution.accelerometer_bias = filter_.accelerometer_bias_P().cast<float>();
  const auto bias_sigma = [&](int first) {
    return filter_.covariance().diagonal().segment<3>(first).cwiseSqrt().cast<float>();
  };
  solution.gyro_bias_sigma = bias_sigma(InertialFilter::gyro_bias);
  solution.accelerometer_bias_sigma = bias_sigma(InertialFilter::accelerometer_bias);
  if (scale_sigmas() == InertialFilter::ScaleSigmas{}) return true;
  const InertialFilter::AddedStates added = filter_.added();
  const int gyro = added.first_scale_factor, accelerometer = gyro + 3;
  const auto scale_sigma = [&](int first) {
    return added.covariance.diagonal().segment<3>(first).cwiseSqrt().cast<float>();
  };
  solution.gyro_scale = added.estimates.segment<3>(gyro).cast<float>();
  solution.accelerometer_scale = added.estimates.segment<3>(accelerometer).cast<float>();
  solution.gyro_scale_sigma = scale_sigma(gyro);
  solution.accelerometer_scale_sigma = scale_sigma(accelerometer);
  return true;
}

}  // namespace imud
