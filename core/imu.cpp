#include "core/imu.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "core/attitude.hpp"
#include "core/numbers/dispatch.hpp"
#include "core/numbers/lane_rotation.hpp"

namespace imud {
namespace {

// These copy as bytes what an assignment copies. Eigen's assignment is not trivial, and copies each number alone.
void copy_all(const MotionState& from, MotionState& to) noexcept {
  static_assert(std::is_trivially_destructible_v<MotionState>);
  std::memcpy(static_cast<void*>(&to), &from, sizeof to);
}
template <class Numbers>
void copy_numbers(const Numbers& from, Numbers& to) noexcept {
  std::memcpy(to.data(), from.data(), sizeof to);
}

}  // namespace

void Imu::advance(const Timeline& timeline, TruthTime until) noexcept {
  until = until - model_.sampling_delay;
  if (run_ != Run::truth || until > timeline.newest()) return;
  if (is_held() && until > sampled_) end_hold();
  until = until - model_.sampling_jitter;  // the next sample may be that much earlier
  if (until <= advanced_.time) return;
  while (has_internal_left() && next_internal() <= until) take_internal(timeline, next_internal());
  accumulate(timeline, timeline.at(until));
}

// Extends the sums from advanced_ to `end`, truth by truth, as the motion is smooth only between two truths.
void Imu::accumulate(const Timeline& timeline, const MotionState& end) noexcept {
  if (model_.delta_angle == DeltaAngle::rotation_vector && model_.delta_velocity == DeltaVelocity::end_frame) {
    advanced_.time = end.time;  // these increments are differences of two states and need no sums
    return;
  }
  if (advanced_.basis != MotionState::Basis::interpolated || timeline.revision() != revision_) {
    // advanced_ was extrapolated, or interpolated across a truth that arrived late. These increments contain the
    // difference between advanced_ and the state as the timeline knows it now.
    revision_ = timeline.revision();
    const MotionState known = timeline.at(advanced_.time);
    angle_sum_B_.add(lanes(log(advanced_.q_NB.conjugate() * known.q_NB)));
    velocity_sum_B_.add(lanes(known.q_NB.conjugate() * (known.dv_N - advanced_.dv_N)));
    advanced_ = known;
  }
  for (TruthTime next = timeline.next_truth(advanced_.time); next < end.time; next = timeline.next_truth(next))
    add_piece(timeline.at(next));
  add_piece(end);
}

// Adds the integrals from advanced_ to `end` by the corrected trapezoidal rule, which needs only values and slopes at
// the two ends and is exact to the third order:  integral of g = h/2 (g1 + g2) + h^2/12 (g1' - g2').
//
// The specific force f is used only by its given integral V. By parts, in moving axes:
//   integral of f = u2 + integral of omega x u,   u = C_BN (V - V1),   u' = f - omega x u,   u1 = 0;
// so the sums agree with V, because only the second, small term has the error of the rule.
void Imu::add_piece(const MotionState& end) noexcept {
  const MotionState& begin = advanced_;
  const double h = seconds(end.time - begin.time);
  const Lanes u2 = rotate(conjugate(lanes(end.q_NB)), lanes(end.dv_N) - lanes(begin.dv_N));
  if (begin.basis == MotionState::Basis::held || end.basis == MotionState::Basis::held) [[unlikely]] {
    // The motion began or stopped within this step; f is constant.
    angle_sum_B_.add(lanes(log(begin.q_NB.conjugate() * end.q_NB)));
    velocity_sum_B_.add(model_.delta_velocity == DeltaVelocity::integral ? h * lanes(end.specific_force_B) : u2);
    advanced_ = end;
    return;
  }
  const auto integral = [h](Lanes g1, Lanes g2, Lanes g1_dot, Lanes g2_dot) __attribute__((always_inline)) {
    return (0.5 * h) * (g1 + g2) + (h * h / 12.0) * (g1_dot - g2_dot);
  };
  const Lanes omega1 = lanes(begin.omega_BN_B), omega2 = lanes(end.omega_BN_B);
  const Lanes omega1_dot = lanes(begin.omegaDot_BN_B), omega2_dot = lanes(end.omegaDot_BN_B);
  if (model_.delta_angle == DeltaAngle::integral) angle_sum_B_.add(integral(omega1, omega2, omega1_dot, omega2_dot));
  velocity_sum_B_.add(u2);
  if (model_.delta_velocity == DeltaVelocity::integral) {
    const Lanes g2 = cross(omega2, u2);
    velocity_sum_B_.add(integral(Lanes{}, g2, cross(omega1, lanes(begin.specific_force_B)),
                                 cross(omega2_dot, u2) + cross(omega2, lanes(end.specific_force_B) - g2)));
    if (!model_.r_SB_B.isZero(0.0)) {
      const Lanes r = lanes(model_.r_SB_B);
      const Lanes v1 = cross(omega1, r), v2 = cross(omega2, r);
      centripetal_sum_B_.add(integral(cross(omega1, v1), cross(omega2, v2),
                                      cross(omega1_dot, v1) + cross(omega1, cross(omega1_dot, r)),
                                      cross(omega2_dot, v2) + cross(omega2, cross(omega2_dot, r))));
    }
    if (size_effect_.is_on()) size_effect_.add_piece(begin, end, h);
  }
  copy_all(end, advanced_);
}

[[gnu::always_inline]] inline Lanes Imu::true_delta_angle_B(const MotionState& now) const noexcept {
  if (model_.delta_angle == DeltaAngle::integral) return angle_sum_B_.lanes();
  return log_of_rotation(product(conjugate(lanes(last_.q_NB)), lanes(now.q_NB)));
}

[[gnu::always_inline]] inline Lanes Imu::true_delta_velocity_B(const MotionState& now) const noexcept {
  const Lanes r = lanes(model_.r_SB_B), omega = lanes(now.omega_BN_B), last_omega = lanes(last_.omega_BN_B);
  switch (model_.delta_velocity) {
    case DeltaVelocity::memo:
      return velocity_sum_B_.lanes() + cross(omega - last_omega, r);
    case DeltaVelocity::end_frame: {
      const Lanes moved = rotate(lanes(last_.q_NB), cross(last_omega, r));
      const Lanes change_N = lanes(now.dv_N) - lanes(last_.dv_N) - moved;
      return rotate(conjugate(lanes(now.q_NB)), change_N) + cross(omega, r);
    }
    case DeltaVelocity::integral:
    default:
      return velocity_sum_B_.lanes() + cross(omega - last_omega, r) + centripetal_sum_B_.lanes();
  }
}

// These two return the true increments since the last sample, in platform axes.
[[gnu::always_inline]] inline Lanes Imu::true_delta_angle(const MotionState& now) const noexcept {
  return dcm_PB_ * true_delta_angle_B(now);  // Eq. 4
}
[[gnu::always_inline]] inline Lanes Imu::true_delta_velocity(const MotionState& now) const noexcept {
  const Lanes delta_velocity = dcm_PB_ * true_delta_velocity_B(now);  // Eq. 14
  if (!is_disturbed_) [[likely]]
    return delta_velocity;
  return delta_velocity + lanes(size_effect_.increments(last_, now, model_.delta_velocity));
}

// Adds the vibration, and the distances of the accelerometers, to the sensors' input.
void Imu::disturb(const MotionState& now, TruthTime time, double dt, Disturbed& input) noexcept {
  if (size_effect_.is_on()) size_effect_.add_to_values(now, input.specific_force);
  if (vibration_.is_on())
    vibration_.add_to({input.rate, input.delta_angle, input.specific_force, input.delta_velocity}, time, dt);
}

// Inline, as sense() is, because this is most of the work of a step. `Out` is a Sample or a Measured.
template <bool Rare, class Out>
[[gnu::always_inline]] inline void Imu::measure(const MotionState& now, TruthTime time, std::uint64_t k, double dt,
                                                double since_power_on, bool begins_run, Lanes delta_angle,
                                                Lanes delta_velocity, Out& out) noexcept {
  const Lanes omega = lanes(now.omega_BN_B), r = lanes(model_.r_SB_B);
  Lanes rate = dcm_PB_ * omega;  // Eq. 1
  const Lanes specific_force_B =
      lanes(now.specific_force_B) + cross(lanes(now.omegaDot_BN_B), r) + cross(omega, cross(omega, r));  // Eq. 8
  Vector3 specific_force = vector_of(dcm_PB_ * specific_force_B);                                        // Eq. 9
  true_rate_ = vector_of(rate);
  true_specific_force_ = specific_force;
  if (is_disturbed_) [[unlikely]] {
    // disturb() gets copies, so that the values can stay in registers where nothing disturbs them.
    Disturbed input = {vector_of(rate), vector_of(delta_angle), specific_force, vector_of(delta_velocity)};
    disturb(now, time, dt, input);
    rate = lanes(input.rate);
    delta_angle = lanes(input.delta_angle);
    specific_force = input.specific_force;
    delta_velocity = lanes(input.delta_velocity);
  }
  const Vector3 velocity_change = vector_of(delta_velocity);
  const auto step_of = [&](Lanes value, Lanes increment) __attribute__((always_inline)) {
    return TriadStep{.normals = normals_,
                     .k = k,
                     .dt = dt,
                     .since_power_on = since_power_on,
                     .specific_force = specific_force,
                     .delta_velocity = velocity_change,
                     .surroundings = surroundings_,
                     .value = value,
                     .increment = increment,
                     .begins_run = begins_run};
  };
  TriadStep gyro = step_of(rate, delta_angle), accelerometer = step_of(lanes(specific_force), delta_velocity);
  gyro_.apply<Rare>(gyro);
  accelerometer_.apply<Rare>(accelerometer);
  out.rate = vector_of(gyro.value);
  out.specific_force = vector_of(accelerometer.value);
  out.delta_angle = vector_of(gyro.increment);
  out.delta_velocity = vector_of(accelerometer.increment);
  out.status =
      gyro.saturated * status::gyro_saturated_x + accelerometer.saturated * status::accelerometer_saturated_x;
  if (inclinometer_) [[unlikely]] {
    // incline() gets copies, as disturb() does.
    const Vector3 force = specific_force, change = velocity_change;
    out.status |= incline({.normals = normals_,
                           .k = k,
                           .dt = dt,
                           .since_power_on = since_power_on,
                           .specific_force = force,
                           .delta_velocity = change,
                           .surroundings = surroundings_,
                           .value = lanes(force),
                           .increment = lanes(change),
                           .begins_run = begins_run});
    if constexpr (std::is_same_v<Out, Sample>) {
      out.inclination = inclination_;
      // Zeros have no sign, as where internal samples are added to them.
      out.delta_angle.array() += 0.0;
      out.delta_velocity.array() += 0.0;
    }
  }
}

// Takes an internal sample of the inclinometers, which stand where the accelerometers stand. Returns its status.
IMUD_DISPATCHED [[gnu::noinline]] std::uint32_t Imu::incline(TriadStep step) noexcept {
  inclinometer_->apply(step);
  inclination_ = vector_of(step.value);
  return step.saturated * status::inclinometer_saturated_x;
}

TruthTime Imu::next_internal() const noexcept {
  const double offset_ns = 1e9 * internal_period_s(model_) * (internal_.taken + 1);
  return last_time_ + Nanoseconds(static_cast<std::int64_t>(offset_ns + 0.5));
}

void Imu::take_internal(const Timeline& timeline, TruthTime time) noexcept {
  MotionState other;
  const MotionState& now = timeline.at(time, other);
  accumulate(timeline, now);
  take_internal(now, time);
}

// Takes an internal sample that is not the last of its sample. The sums end at `now`.
IMUD_DISPATCHED [[gnu::noinline]] void Imu::take_internal(const MotionState& now, TruthTime time) noexcept {
  const Lanes delta_angle = true_delta_angle(now), delta_velocity = true_delta_velocity(now);
  const Lanes angle_piece = delta_angle - lanes(internal_.true_delta_angle);
  const Lanes velocity_piece = delta_velocity - lanes(internal_.true_delta_velocity);
  Measured measured;
  measure<true>(now, time, internal_number(), seconds(time - internal_.time),
                internal_.since_power_on + seconds(time - last_time_), false, angle_piece, velocity_piece, measured);
  ++internal_.taken;
  internal_.time = time;
  internal_.true_delta_angle = vector_of(delta_angle);
  internal_.true_delta_velocity = vector_of(delta_velocity);
  internal_.delta_angle += measured.delta_angle;
  internal_.delta_velocity += measured.delta_velocity;
  internal_.status |= measured.status;
}

// Takes the internal sample that is the last of its sample. The true increments of the sample are given. In the first
// sample of a run, takes the sample's other internal samples before.
IMUD_DISPATCHED [[gnu::noinline]] void Imu::measure_last(const MotionState& now, TruthTime time, bool is_first,
                                                         Vector3 delta_angle, Vector3 delta_velocity,
                                                         Sample& out) noexcept {
  const double since_power_on = time_since_power_on();
  bool begins_run = is_first;
  if (is_first) {
    internal_ = {.taken = internal_.taken, .time = time};  // the numbers continue
    for (Measured other; has_internal_left(); ++internal_.taken, begins_run = false) {
      measure<true>(now, time, internal_number(), 0, since_power_on, begins_run, Lanes{}, Lanes{}, other);
      internal_.status |= other.status;
    }
  }
  delta_angle -= internal_.true_delta_angle;
  delta_velocity -= internal_.true_delta_velocity;
  measure<true>(now, time, internal_number(), seconds(time - internal_.time), since_power_on, begins_run,
                lanes(delta_angle), lanes(delta_velocity), out);
  out.delta_angle += internal_.delta_angle;
  out.delta_velocity += internal_.delta_velocity;
  out.status |= internal_.status;
  internal_ = {.time = time, .since_power_on = since_power_on};
}

// Returns the gyros' and accelerometers' values at `now`, with the increments since the last sample of the run.
// Inline, because this is most of the work of a step, and a Sample is large.
[[gnu::always_inline]] inline Sample Imu::sense(const MotionState& now, TruthTime time, bool is_first,
                                                DeviceTime stamp) noexcept {
  Sample out;
  out.time = stamp;
  out.counter = counter_;
  if (has_surroundings_) [[unlikely]]
    update_surroundings();
  out.temperature_c = temperature_.reported_c();

  Lanes delta_angle = {}, delta_velocity = {};
  double dt = 0.0;
  if (!is_first) {
    dt = seconds(time - last_time_);
    delta_angle = true_delta_angle(now);
    delta_velocity = true_delta_velocity(now);
  }
  copy_numbers(now.q_NB.coeffs(), last_.q_NB.coeffs());
  copy_numbers(now.omega_BN_B, last_.omega_BN_B);
  copy_numbers(now.dv_N, last_.dv_N);
  copy_numbers(now.specific_force_B, last_force_B_);
  last_time_ = time;
  angle_sum_B_ = {};
  velocity_sum_B_ = {};
  centripetal_sum_B_ = {};
  if (is_disturbed_) [[unlikely]]
    size_effect_.clear();

  if (measures_slowly_) [[unlikely]]
    measure_last(now, time, is_first, vector_of(delta_angle), vector_of(delta_velocity), out);
  else
    measure<false>(now, time, counter_, dt, time_since_power_on(), is_first, delta_angle, delta_velocity, out);
  out.q_LP = now.q_NB * q_BP_;
  return out;
}

// Returns the time by which the next sample is earlier than its nominal instant.
Nanoseconds Imu::jitter() const noexcept {
  const auto most = static_cast<double>(model_.sampling_jitter.count());
  return Nanoseconds{
      static_cast<std::int64_t>(most * normals_.uniform(Quantity::rate, Process::sampling_jitter, counter_))};
}

IMUD_DISPATCHED Sample Imu::sample_moving(const Timeline& timeline, TruthTime time, DeviceTime stamp) noexcept {
  const bool is_first = run_ != Run::truth;
  sampled_ = time;
  if (model_.sampling_jitter.count() > 0 && !is_first) [[unlikely]]
    time = time - jitter();
  MotionState other;
  const MotionState& now = timeline.at(time, other);
  run_ = Run::truth;
  if (is_first) {
    held_ = may_catch_up_ = Nanoseconds{0};
    barometer_.begin_run();
    had_field_ = false;
    origin_.reset();
    advanced_ = now;
    revision_ = timeline.revision();
  } else {
    if (has_internal()) [[unlikely]]
      while (has_internal_left()) take_internal(timeline, std::min(next_internal(), time));
    accumulate(timeline, now);
  }
  if (follows_truth_) [[unlikely]]
    follow_truth(timeline, time);
  Sample out = sense(now, time, is_first, stamp);
  finish(timeline, now, time, out);
  return out;
}

// Out of line, because a Surroundings is large.
[[gnu::noinline]] void Imu::sense_surroundings(const Timeline& timeline, const MotionState& now, TruthTime time,
                                               Sample& out) noexcept {
  const Timeline::Surroundings given =
      timeline.has_surroundings() ? timeline.surroundings(time) : Timeline::Surroundings{};
  const PositionVelocity position = timeline.position(now.time);
  if (!origin_) origin_ = earth_.origin(timeline.position(timeline.run_start()));
  if (!origin_) origin_ = earth_.origin(position);
  sense_earth(earth_, position, given, now, out);
  if (navigation_.latency().count() > 0) delay(timeline, now, out.navigation);
}

// Adds the other quantities, and the status.
[[gnu::always_inline]] inline void Imu::finish(const Timeline& timeline, const MotionState& now, TruthTime time,
                                               Sample& out) noexcept {
  const bool has_given = timeline.has_surroundings();
  const bool has_place = earth_.is_on() && (!earth_.is_automatic() || timeline.has_earth_angle());
  if (has_place || has_given) sense_surroundings(timeline, now, time, out);
  if (navigation_.is_on()) navigation_.apply(out, normals_, counter_);
  out.status |= now.derived;
  if (now.basis != MotionState::Basis::interpolated) out.status |= status::truth_extrapolated;
  if (now.basis == MotionState::Basis::held) out.status |= status::truth_stale;
  ++counter_;
}

// Used at rest and while the simulator stands still. Out of line, so that the code of all other samples stays as it
// is.
[[gnu::noinline]] void Imu::finish_slowly(const Timeline& timeline, const MotionState& now, Sample& out) noexcept {
  finish(timeline, now, sampled_, out);
}
[[gnu::noinline]] Sample Imu::sense_slowly(const MotionState& now, TruthTime time, bool is_first,
                                           DeviceTime stamp) noexcept {
  return sense(now, time, is_first, stamp);
}

Sample Imu::sample_at_rest(Nanoseconds since_power_on, DeviceTime stamp) noexcept {
  const TruthTime time = TruthTime{} + since_power_on;
  const MotionState now = rest_.at(time, time);
  const bool is_first = run_ != Run::rest;
  run_ = Run::rest;
  if (is_first) {
    barometer_.begin_run();
    had_field_ = false;
    origin_ = rest_.earth().origin({});
  } else {
    advanced_ = rest_.at(last_time_, time);
    last_ = {advanced_.q_NB, advanced_.omega_BN_B, advanced_.dv_N};
    while (has_internal_left()) {
      const TruthTime at = std::min(next_internal(), time);
      add_piece(rest_.at(at, time));
      take_internal(advanced_, at);
    }
    add_piece(now);
  }
  if (follows_truth_) {  // of a vehicle at rest no state is known
    surroundings_c_.reset();
    vibration_.follow(time, std::nullopt, std::nullopt);
  }
  Sample out = sense_slowly(now, time, is_first, stamp);
  if (rest_.earth().is_on()) {
    sense_earth(rest_.earth(), {true, time, Vector3::Zero(), Vector3::Zero()}, {}, now, out);
    out.navigation.v_L.setZero();
  }
  if (navigation_.is_on()) navigation_.apply(out, normals_, counter_);
  out.status |= status::at_rest;
  ++counter_;
  return out;
}

}  // namespace imud
