#include "core/timeline.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/attitude.hpp"
#include "core/numbers/dispatch.hpp"
#include "core/numbers/lane_rotation.hpp"

namespace imud {
namespace {

constexpr Nanoseconds near = std::chrono::seconds(1);

// Cubic Hermite basis on [0, 1] and its first derivative: for the slope at 0, the value at 1 and the slope at 1. (The
// value at 0 is the origin of every curve here.)
struct Hermite {
  double slope0, value1, slope1;

  static Hermite value(double s) {
    const double s2 = s * s;
    const double s3 = s2 * s;
    return {s - 2.0 * s2 + s3, 3.0 * s2 - 2.0 * s3, s3 - s2};
  }
  static Hermite derivative(double s) {
    const double s2 = s * s;
    return {1.0 - 4.0 * s + 3.0 * s2, 6.0 * (s - s2), 3.0 * s2 - 2.0 * s};
  }
  Vector3 operator()(const Vector3& at0, const Vector3& delta, const Vector3& at1) const {
    return slope0 * at0 + value1 * delta + slope1 * at1;
  }
  [[gnu::always_inline]] Lanes operator()(Lanes at0, Lanes delta, Lanes at1) const {
    return slope0 * at0 + value1 * delta + slope1 * at1;
  }
};

// Returns the derivative of the right Jacobian along d phi/dt, applied to that: where omega = right_jacobian(phi,
// phi'), the angular acceleration is right_jacobian(phi, phi'') + jacobian_change(phi, phi').
// Out of line: only the curves of derived rates need it.
[[gnu::noinline]] Vector3 jacobian_change(const Vector3& phi, const Vector3& phi_dot) {
  // By z = |phi|^2: d versine/dz = (sinc - 2 versine)/(2 z) and d cubic/dz = (versine - 3 cubic)/(2 z). Near 0 these
  // cancel, and have the limits -1/24 and -1/120. The rate of versine's term is along phi x phi', of which the
  // derivative with phi' constant is 0.
  const double z = phi.squaredNorm();
  const auto even = elementary::even_series(z);
  const bool is_small = z < 1e-6;
  const double versine = is_small ? -1.0 / 24.0 : (even.sinc - 2.0 * even.versine) / (2.0 * z);
  const double cubic = is_small ? -1.0 / 120.0 : (even.versine - 3.0 * even.cubic) / (2.0 * z);
  const double z_dot = 2.0 * phi.dot(phi_dot);
  const Vector3 cross = phi.cross(phi_dot);
  return -z_dot * versine * cross + z_dot * cubic * phi.cross(cross) + even.cubic * phi_dot.cross(cross);
}

// Returns the second derivative of the rotation vector `phi` with the first derivative `phi_slope` and the angular
// acceleration `omega_dot`.
[[gnu::noinline]] Vector3 second_derivative(const Vector3& phi, const Vector3& phi_slope, const Vector3& omega_dot) {
  return inverse_right_jacobian(phi, omega_dot - jacobian_change(phi, phi_slope));
}

// Quintic Hermite basis on [0, 1]: for the slope and the second derivative at 0, the value, the slope and the second
// derivative at 1.
struct Quintic {
  double slope0, second0, value1, slope1, second1;

  static Quintic value(double s) {
    const double s2 = s * s, s3 = s2 * s, s4 = s3 * s, s5 = s4 * s;
    return {s - 6.0 * s3 + 8.0 * s4 - 3.0 * s5, 0.5 * s2 - 1.5 * s3 + 1.5 * s4 - 0.5 * s5,
            10.0 * s3 - 15.0 * s4 + 6.0 * s5, -4.0 * s3 + 7.0 * s4 - 3.0 * s5, 0.5 * s3 - s4 + 0.5 * s5};
  }
  static Quintic derivative(double s) {
    const double s2 = s * s, s3 = s2 * s, s4 = s3 * s;
    return {1.0 - 18.0 * s2 + 32.0 * s3 - 15.0 * s4, s - 4.5 * s2 + 6.0 * s3 - 2.5 * s4,
            30.0 * s2 - 60.0 * s3 + 30.0 * s4, -12.0 * s2 + 28.0 * s3 - 15.0 * s4, 1.5 * s2 - 4.0 * s3 + 2.5 * s4};
  }
  static Quintic second(double s) {
    const double s2 = s * s, s3 = s2 * s;
    return {-36.0 * s + 96.0 * s2 - 60.0 * s3, 1.0 - 9.0 * s + 18.0 * s2 - 10.0 * s3,
            60.0 * s - 180.0 * s2 + 120.0 * s3, -24.0 * s + 84.0 * s2 - 60.0 * s3, 3.0 * s - 12.0 * s2 + 10.0 * s3};
  }
  // `h`: length of the curve, s; `scale`: 1, 1/h or 1/h^2 for the value and the derivatives.
  Vector3 operator()(double h, double scale, const Vector3& slope_0, const Vector3& second_0, const Vector3& delta,
                     const Vector3& slope_1, const Vector3& second_1) const {
    return scale * (h * slope0 * slope_0 + h * h * second0 * second_0 + value1 * delta + h * slope1 * slope_1 +
                    h * h * second1 * second_1);
  }
};

}  // namespace

// The rotation vector of a curve, and its derivatives. The second derivative is only known for a quintic curve.
struct Timeline::Turn {
  Vector3 phi, first, second;
};

Timeline::Timeline(const Limits& limits) : limits_(limits), knots_(capacity), vehicles_(capacity) {}

Admission Timeline::classify(const Truth& truth) const noexcept {
  if (count_ == 0) return Admission::new_run;
  const Nanoseconds ahead = truth.time - newest();
  // True if a network, or a sender that waits for an answer, has repeated the run's first truth. If the newest truth
  // is later than `truth` by more than `near`, the simulator has been restarted.
  const bool repeated = truth.time == run_start_ && truth.sequence == run_start_sequence_ && ahead >= -near;
  if (truth.new_run && !repeated) return Admission::new_run;
  if (ahead > limits_.max_gap) return limits_.gap_begins_run ? Admission::new_run : Admission::time_jump;
  if (ahead.count() > 0) return Admission::accepted;
  if (ahead.count() == 0) return Admission::duplicate;
  for (std::size_t i = 0; i + 1 < count_; ++i)
    if (knot(i).state.time == truth.time) return Admission::duplicate;
  const auto newer = static_cast<std::int32_t>(truth.sequence - newest_sequence_);
  if (newer < 0) return Admission::reordered;
  if (newer > 0) return Admission::time_back;
  return ahead >= -near ? Admission::reordered : Admission::time_back;  // the sequence does not decide
}

IMUD_DISPATCHED Admission Timeline::push(const Truth& truth, TruthTime watermark) noexcept {
  Admission admission = classify(truth);
  if (admission == Admission::reordered &&
      truth.time > std::max(watermark, knot(count_ < capacity ? 0 : 1).state.time)) {
    insert(truth);
    return Admission::inserted;
  }
  if (admission != Admission::accepted && admission != Admission::new_run) {
    const bool follows =
        refused_in_row_ > 0 && truth.time > last_refused_ && truth.time - last_refused_ <= limits_.max_gap;
    refused_in_row_ = follows ? refused_in_row_ + 1 : 1;
    last_refused_ = truth.time;
    const bool far = std::chrono::abs(truth.time - newest()) > near;
    if (refused_in_row_ < (far ? limits_.restart_after_far : limits_.restart_after_near)) return admission;
    admission = Admission::new_run;
  }
  refused_in_row_ = 0;
  if (admission == Admission::new_run)
    begin_run(truth);
  else
    append(truth);
  if (truth.has_magnetic_field | truth.has_pressure | !truth.vehicle.is_empty()) [[unlikely]]
    take_surroundings(truth);
  if (truth.has_earth_angle) [[unlikely]]
    has_earth_angle_ = true;
  newest_sequence_ = truth.sequence;
  return admission;
}

void Timeline::begin_run(const Truth& truth) noexcept {
  first_ = 0;
  count_ = 0;
  has_surroundings_ = has_earth_angle_ = false;
  if (has_vehicle_) std::ranges::fill(vehicles_, VehicleAt{});
  run_start_ = truth.time;
  run_start_sequence_ = truth.sequence;
  append(truth);
}

void Timeline::forget_past() noexcept {
  Knot& newest = knot(count_ - 1);
  newest.h_s = 0;
  newest.rate_slope.setZero();
  first_ = (first_ + count_ - 1) % capacity;
  count_ = 1;
  run_start_ = newest.state.time;
  run_start_sequence_ = newest_sequence_;
}

// Makes room for a knot that becomes number i, and moves later ones up. A full ring drops its oldest knot; then i
// must be above 0.
Timeline::Knot& Timeline::make_room(std::size_t i) noexcept {
  if (count_ == capacity) {
    first_ = (first_ + 1) % capacity;
    --i;
  } else {
    ++count_;
  }
  for (std::size_t j = count_ - 1; j > i; --j) {
    knot(j) = knot(j - 1);
    if (has_vehicle_) vehicles_[(first_ + j) % capacity] = vehicles_[(first_ + j - 1) % capacity];
  }
  return knot(i);
}

void Timeline::append(const Truth& truth) noexcept {
  Knot& k = make_room(count_);
  place(truth, k);
  if (count_ > 1)
    link(knot(count_ - 2), k);
  else
    k.dv_origin_N = k.state.q_NB * k.accumulated_dv_B;
}

void Timeline::insert(const Truth& truth) noexcept {
  ++revision_;
  std::size_t i = count_ - 1;
  while (knot(i - 1).state.time > truth.time) --i;
  const std::size_t later = count_ - i;
  place(truth, make_room(i));
  for (i = count_ - 1 - later; i < count_; ++i) link(knot(i - 1), knot(i));
}

// Sets the members of a knot that depend on its own truth only.
void Timeline::place(const Truth& truth, Knot& k) noexcept {
  // link() sets the other members of all knots except the first. The other members of the first knot are not used.
  k.state.time = truth.time;
  k.state.q_NB = truth.q_NB.normalized();
  k.state.omega_BN_B = truth.omega_BN_B;
  k.state.dv_N.setZero();
  k.state.derived =
      (truth.is_rate_derived ? status::rate_derived : 0U) | (truth.is_force_derived ? status::force_derived : 0U);
  k.position.is_known = truth.has_position && truth.has_velocity;
  k.position.time = truth.time;
  k.position.r_N = truth.r_BN_N;
  k.position.v_N = truth.v_BN_N;
  k.position.earth_angle.reset();
  if (truth.has_earth_angle) [[unlikely]]
    k.position.earth_angle = truth.earth_angle;
  k.temperature_c = truth.has_temperature ? std::optional(truth.temperature_c) : std::nullopt;
  k.pressure = truth.has_pressure ? std::optional(truth.pressure) : std::nullopt;
  k.magnetic_field_B = truth.has_magnetic_field ? std::optional(truth.magnetic_field_B) : std::nullopt;
  k.has_angular_acceleration = truth.has_angular_acceleration;
  k.is_rate_derived = truth.is_rate_derived;
  k.follows_gap = truth.follows_gap;
  k.state.omegaDot_BN_B = truth.has_angular_acceleration ? truth.omegaDot_BN_B : Vector3::Zero();
  k.accumulated_dv = truth.accumulated_dv;
  k.accumulated_dv_B = truth.accumulated_dv_B;
  k.has_specific_force = truth.has_specific_force;
  k.state.specific_force_B = truth.has_specific_force ? truth.specific_force_B : Vector3::Zero();
  k.specific_force_N = k.state.q_NB * k.state.specific_force_B;
  k.h_s = 0;
  k.rate_slope.setZero();
}

// Sets the members of a knot that also depend on the truth before.
void Timeline::link(const Knot& before, Knot& k) noexcept {
  const Vector3 given_N = k.state.q_NB * k.accumulated_dv_B;  // of use if `accumulated_dv` is inertial
  k.dv_origin_N = before.dv_origin_N;

  // Attitude.
  k.h_s = seconds(k.state.time - before.state.time);
  const Lanes phi_of_curve = log_of_rotation(product(conjugate(lanes(before.state.q_NB)), lanes(k.state.q_NB)));
  k.phi = vector_of(phi_of_curve);
  k.phi_slope = vector_of(inverse_right_jacobian(phi_of_curve, lanes(k.state.omega_BN_B)));
  k.is_quintic = before.is_rate_derived && k.is_rate_derived && before.has_angular_acceleration &&
                 k.has_angular_acceleration && !k.follows_gap;
  if (k.is_quintic) [[unlikely]]
    k.phi_second = second_derivative(k.phi, k.phi_slope, k.state.omegaDot_BN_B);
  if (before.has_angular_acceleration && k.has_angular_acceleration) {
    k.omegaDot_begin = before.state.omegaDot_BN_B;
    k.omegaDot_end = k.state.omegaDot_BN_B;
  } else {
    // The curve's second derivative is not used: it multiplies any disagreement of attitude and rate by 6/h, and in
    // simulators that step the attitude by the old or the new rate (JSBSim) the two disagree by half a step's change
    // of rate. Instead, the angular acceleration is linear through the midpoints of this interval and the one before,
    // where it equals the differences of the rates.
    constexpr double meaningful_s = 1e-5;
    k.rate_slope =
        k.h_s < meaningful_s ? before.rate_slope : Vector3((k.state.omega_BN_B - before.state.omega_BN_B) / k.h_s);
    Vector3 half_change = Vector3::Zero();
    if (before.h_s >= meaningful_s && k.h_s >= meaningful_s)
      half_change = (k.rate_slope - before.rate_slope) * (k.h_s / (before.h_s + k.h_s));
    k.omegaDot_begin = k.rate_slope - half_change;
    k.omegaDot_end = k.rate_slope + half_change;
    if (!k.has_angular_acceleration) k.state.omegaDot_BN_B = k.omegaDot_end;
  }

  // Accumulated velocity.
  const AccumulatedDv kind = k.accumulated_dv == before.accumulated_dv ? k.accumulated_dv : AccumulatedDv::none;
  const bool has_force = before.has_specific_force && k.has_specific_force;
  switch (kind) {
    case AccumulatedDv::inertial:
      k.state.dv_N = given_N - k.dv_origin_N;
      break;
    case AccumulatedDv::body_sum:
      k.state.dv_N = before.state.dv_N + k.state.q_NB * (k.accumulated_dv_B - before.accumulated_dv_B);
      break;
    case AccumulatedDv::none: {
      Vector3 sum = Vector3::Zero();
      if (has_force) {
        // Gauss-Legendre, three points: exact to the fifth order along the curve.
        constexpr double offset = 0.38729833462074169;  // sqrt(3/5)/2
        constexpr std::array<double, 3> nodes = {0.5 - offset, 0.5, 0.5 + offset};
        constexpr std::array<double, 3> weights = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
        for (std::size_t i = 0; i < 3; ++i) {
          const double s = nodes[i];
          const Vector3 phi = k.is_quintic
                                  ? turn(before, k, s).phi
                                  : Hermite::value(s)(k.h_s * before.state.omega_BN_B, k.phi, k.h_s * k.phi_slope);
          const Vector3 force_B = (1.0 - s) * before.state.specific_force_B + s * k.state.specific_force_B;
          sum += weights[i] * ((before.state.q_NB * exp(phi)) * force_B);
        }
      }
      k.state.dv_N = before.state.dv_N + k.h_s * sum;
      k.dv_origin_N = given_N - k.state.dv_N;  // for accumulated velocity that begins with this truth
      break;
    }
  }
  k.linear_dv = !has_force;
  if (!k.has_specific_force)
    k.state.specific_force_B = k.state.q_NB.conjugate() * (k.state.dv_N - before.state.dv_N) / k.h_s;
}

std::size_t Timeline::segment_end(TruthTime time) const noexcept {
  // The end is usually one of the newest knots: search backwards with doubled steps, then bisect.
  std::size_t high = count_ - 1;
  std::size_t step = 1;
  while (high > step && time <= knot(high - step).state.time) {
    high -= step;
    step *= 2;
  }
  std::size_t low = high > step ? high - step + 1 : 1;
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (knot(middle).state.time < time)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

IMUD_DISPATCHED const MotionState& Timeline::at(TruthTime time, MotionState& other) const noexcept {
  if (time > newest()) return other = extrapolate(time);
  if (time == newest()) return knot(count_ - 1).state;
  if (time <= knot(0).state.time) return time < run_start_ && is_whole() ? other = before_run(time) : knot(0).state;
  const std::size_t end = segment_end(time);
  const Knot& k = knot(end);
  if (time == k.state.time) return k.state;
  const Knot& begin = knot(end - 1);
  interpolate(begin, k, seconds(time - begin.state.time) / k.h_s, other);
  other.time = time;
  return other;
}

[[gnu::noinline]] Timeline::Turn Timeline::turn(const Knot& begin, const Knot& end, double s) noexcept {
  const double h = end.h_s;
  // The second derivative at the begin is the angular acceleration, as the rotation vector is 0 there.
  const auto sum = [&](const Quintic& basis, double scale) {
    return basis(h, scale, begin.state.omega_BN_B, begin.state.omegaDot_BN_B, end.phi, end.phi_slope, end.phi_second);
  };
  return {sum(Quintic::value(s), 1.0), sum(Quintic::derivative(s), 1.0 / h), sum(Quintic::second(s), 1.0 / (h * h))};
}

// Sets all of `state` but its time.
void Timeline::interpolate(const Knot& begin, const Knot& end, double s, MotionState& state) noexcept {
  const Hermite value = Hermite::value(s);
  const Hermite derivative = Hermite::derivative(s);
  const double h = end.h_s;
  const double inverse_h = 1.0 / h;
  state.basis = MotionState::Basis::interpolated;
  state.derived = end.state.derived | (end.follows_gap ? status::truth_gap : 0U);
  Lanes q_NB;
  const Lanes begin_omega = lanes(begin.state.omega_BN_B);
  if (end.is_quintic) [[unlikely]] {
    const Turn curve = turn(begin, end, s);
    q_NB = lanes(begin.state.q_NB * exp(curve.phi));
    state.omega_BN_B = right_jacobian(curve.phi, curve.first);
    state.omegaDot_BN_B = right_jacobian(curve.phi, curve.second) + jacobian_change(curve.phi, curve.first);
  } else {
    const Lanes end_phi = lanes(end.phi), end_slope = lanes(end.phi_slope);
    const Lanes phi = value(h * begin_omega, end_phi, h * end_slope);
    const Lanes phi_dot = derivative(begin_omega, inverse_h * end_phi, end_slope);
    q_NB = product(lanes(begin.state.q_NB), exp_of_rotation(phi));
    state.omega_BN_B = vector_of(right_jacobian(phi, phi_dot));
    state.omegaDot_BN_B = vector_of((1.0 - s) * lanes(end.omegaDot_begin) + s * lanes(end.omegaDot_end));
  }
  state.q_NB = quaternion_of(q_NB);
  const Lanes begin_dv = lanes(begin.state.dv_N);
  const Lanes dv = lanes(end.state.dv_N) - begin_dv;
  Lanes force_N = inverse_h * dv;
  if (end.linear_dv) {
    state.dv_N = vector_of(begin_dv + s * dv);
  } else {
    const Lanes begin_force = lanes(begin.specific_force_N), end_force = lanes(end.specific_force_N);
    state.dv_N = vector_of(begin_dv + value(h * begin_force, dv, h * end_force));
    force_N = derivative(begin_force, force_N, end_force);
  }
  state.specific_force_B = vector_of(rotate(conjugate(q_NB), force_N));
}

MotionState Timeline::extrapolate(TruthTime time) const noexcept {
  const Knot& last = knot(count_ - 1);
  MotionState state = last.state;
  state.time = time;
  const Nanoseconds ahead = time - last.state.time;
  const double dt = seconds(std::min(ahead, limits_.extrapolate));
  const Vector3 phi = dt * state.omega_BN_B + (0.5 * dt * dt) * state.omegaDot_BN_B;
  const Vector3 phi_dot = state.omega_BN_B + dt * state.omegaDot_BN_B;
  state.dv_N += dt * (last.state.q_NB * right_jacobian(-phi, state.specific_force_B));
  state.q_NB = last.state.q_NB * exp(phi);
  state.omega_BN_B = right_jacobian(phi, phi_dot);
  if (ahead <= limits_.extrapolate) {
    state.basis = MotionState::Basis::extrapolated;
    return state;
  }
  state.basis = MotionState::Basis::held;
  state.omega_BN_B.setZero();
  state.omegaDot_BN_B.setZero();
  state.dv_N += seconds(ahead - limits_.extrapolate) * (state.q_NB * state.specific_force_B);
  return state;
}

// Returns the state before the first truth of a run: the vehicle stands still in that truth's attitude.
MotionState Timeline::before_run(TruthTime time) const noexcept {
  MotionState state = knot(0).state;
  state.dv_N -= seconds(state.time - time) * (state.q_NB * state.specific_force_B);
  state.time = time;
  state.basis = MotionState::Basis::held;
  state.omega_BN_B.setZero();
  state.omegaDot_BN_B.setZero();
  return state;
}

PositionVelocity Timeline::position(TruthTime time) const noexcept {
  const Knot& oldest = knot(0);
  if (time <= oldest.state.time) return oldest.position;
  if (time > newest()) return extrapolate_position(std::min(time, newest() + limits_.extrapolate));
  const std::size_t i = segment_end(time);
  const Knot &begin = knot(i - 1), &end = knot(i);
  if (time == end.state.time) return end.position;
  if (!begin.position.is_known || !end.position.is_known) return {};
  const double h = end.h_s;
  const double s = seconds(time - begin.state.time) / h;
  const Vector3 step = end.position.r_N - begin.position.r_N;
  const Vector3 &v1 = begin.position.v_N, &v2 = end.position.v_N;
  return {true, time, begin.position.r_N + Hermite::value(s)(h * v1, step, h * v2),
          Hermite::derivative(s)(v1, step / h, v2), begin.position.earth_angle};
}

TruthTime Timeline::next_truth(TruthTime time) const noexcept {
  if (count_ == 0 || time >= newest()) return never;
  if (count_ > 1 && time >= knot(count_ - 2).state.time) return newest();
  if (time < knot(0).state.time) return knot(0).state.time;
  const std::size_t end = segment_end(time);
  // segment_end() counts an instant at a truth to the segment before it.
  return knot(end).state.time > time ? knot(end).state.time : knot(end + 1).state.time;
}

}  // namespace imud
