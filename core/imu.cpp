#include "core/imu.hpp"

#include <algorithm>
#include <cmath>

#include "core/attitude.hpp"
#include "core/numbers/dispatch.hpp"

namespace imud {

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
    angle_sum_B_ += log(advanced_.q_NB.conjugate() * known.q_NB);
    velocity_sum_B_ += known.q_NB.conjugate() * (known.dv_N - advanced_.dv_N);
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
  const Vector3 u2 = end.q_NB.conjugate() * (end.dv_N - begin.dv_N);
  if (begin.basis == MotionState::Basis::held || end.basis == MotionState::Basis::held) {
    // The motion began or stopped within this step; f is constant.
    angle_sum_B_ += log(begin.q_NB.conjugate() * end.q_NB);
    velocity_sum_B_ += model_.delta_velocity == DeltaVelocity::integral ? Vector3(h * end.specific_force_B) : u2;
    advanced_ = end;
    return;
  }
  const auto integral = [h](const Vector3& g1, const Vector3& g2, const Vector3& g1_dot, const Vector3& g2_dot) {
    return Vector3((0.5 * h) * (g1 + g2) + (h * h / 12.0) * (g1_dot - g2_dot));
  };
  const Vector3& omega1 = begin.omega_BN_B;
  const Vector3& omega2 = end.omega_BN_B;
  const Vector3& omega1_dot = begin.omegaDot_BN_B;
  const Vector3& omega2_dot = end.omegaDot_BN_B;
  if (model_.delta_angle == DeltaAngle::integral) angle_sum_B_ += integral(omega1, omega2, omega1_dot, omega2_dot);
  velocity_sum_B_ += u2;
  if (model_.delta_velocity == DeltaVelocity::integral) {
    const Vector3 g2 = omega2.cross(u2);
    velocity_sum_B_ += integral(Vector3::Zero(), g2, omega1.cross(begin.specific_force_B),
                                omega2_dot.cross(u2) + omega2.cross(end.specific_force_B - g2));
    if (const Vector3& r = model_.r_SB_B; !r.isZero(0.0)) {
      const Vector3 v1 = omega1.cross(r);
      const Vector3 v2 = omega2.cross(r);
      centripetal_sum_B_ +=
          integral(omega1.cross(v1), omega2.cross(v2), omega1_dot.cross(v1) + omega1.cross(omega1_dot.cross(r)),
                   omega2_dot.cross(v2) + omega2.cross(omega2_dot.cross(r)));
    }
    if (size_effect_.is_on()) size_effect_.add_piece(begin, end, h);
  }
  advanced_ = end;
}

Vector3 Imu::true_delta_angle_B(const MotionState& now) const noexcept {
  if (model_.delta_angle == DeltaAngle::integral) return angle_sum_B_;
  return log(last_.q_NB.conjugate() * now.q_NB);
}

Vector3 Imu::true_delta_velocity_B(const MotionState& now) const noexcept {
  const Vector3& r = model_.r_SB_B;
  switch (model_.delta_velocity) {
    case DeltaVelocity::memo:
      return velocity_sum_B_ + (now.omega_BN_B - last_.omega_BN_B).cross(r);
    case DeltaVelocity::end_frame:
      return now.q_NB.conjugate() * (now.dv_N - last_.dv_N - last_.q_NB * last_.omega_BN_B.cross(r)) +
             now.omega_BN_B.cross(r);
    case DeltaVelocity::integral:
    default:
      return velocity_sum_B_ + (now.omega_BN_B - last_.omega_BN_B).cross(r) + centripetal_sum_B_;
  }
}

// These two return the true increments since the last sample, in platform axes.
Vector3 Imu::true_delta_angle(const MotionState& now) const noexcept {
  return vector_of(dcm_PB_ * true_delta_angle_B(now));  // Eq. 4
}
Vector3 Imu::true_delta_velocity(const MotionState& now) const noexcept {
  const Vector3 delta_velocity = vector_of(dcm_PB_ * true_delta_velocity_B(now));  // Eq. 14
  if (!is_disturbed_) [[likely]]
    return delta_velocity;
  return delta_velocity + size_effect_.increments(last_, now, model_.delta_velocity);
}

// Adds the vibration, and the distances of the accelerometers, to the sensors' input.
void Imu::disturb(const MotionState& now, TruthTime time, double dt, Disturbed& input) noexcept {
  if (size_effect_.is_on()) size_effect_.add_to_values(now, input.specific_force);
  if (vibration_.is_on())
    vibration_.add_to({input.rate, input.delta_angle, input.specific_force, input.delta_velocity}, time, dt);
}

// Inline, as sense() is, because this is most of the work of a step. `Out` is a Sample or a Measured. Changes the
// true increments.
template <bool Rare, class Out>
[[gnu::always_inline]] inline void Imu::measure(const MotionState& now, TruthTime time, std::uint64_t k, double dt,
                                                double since_power_on, bool begins_run, Vector3& delta_angle,
                                                Vector3& delta_velocity, Out& out) noexcept {
  Vector3 rate = vector_of(dcm_PB_ * now.omega_BN_B);  // Eq. 1
  const Vector3 specific_force_B = now.specific_force_B + now.omegaDot_BN_B.cross(model_.r_SB_B) +
                                   now.omega_BN_B.cross(now.omega_BN_B.cross(model_.r_SB_B));  // Eq. 8
  Vector3 specific_force = vector_of(dcm_PB_ * specific_force_B);                              // Eq. 9
  true_rate_ = rate;
  true_specific_force_ = specific_force;
  if (is_disturbed_) [[unlikely]] {
    // disturb() gets copies, so that the values can stay in registers where nothing disturbs them.
    Disturbed input = {rate, delta_angle, specific_force, delta_velocity};
    disturb(now, time, dt, input);
    rate = input.rate;
    delta_angle = input.delta_angle;
    specific_force = input.specific_force;
    delta_velocity = input.delta_velocity;
  }
  const auto step_of = [&](const Vector3& value, const Vector3& increment) {
    return TriadStep{.normals = normals_,
                     .k = k,
                     .dt = dt,
                     .since_power_on = since_power_on,
                     .specific_force = specific_force,
                     .delta_velocity = delta_velocity,
                     .surroundings = surroundings_,
                     .value = value,
                     .increment = increment,
                     .begins_run = begins_run};
  };
  TriadStep gyro = step_of(rate, delta_angle), accelerometer = step_of(specific_force, delta_velocity);
  gyro_.apply<Rare>(gyro);
  accelerometer_.apply<Rare>(accelerometer);
  out.rate = gyro.value;
  out.specific_force = accelerometer.value;
  out.delta_angle = gyro.increment;
  out.delta_velocity = accelerometer.increment;
  out.status =
      gyro.saturated * status::gyro_saturated_x + accelerometer.saturated * status::accelerometer_saturated_x;
  if constexpr (Rare)
    if (inclinometer_) [[unlikely]]
      out.status |= incline(step_of(specific_force, delta_velocity));
}

// Takes an internal sample of the inclinometers, which stand where the accelerometers stand. Returns its status.
IMUD_DISPATCHED [[gnu::noinline]] std::uint32_t Imu::incline(TriadStep step) noexcept {
  inclinometer_->apply(step);
  inclination_ = step.value;
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
  const Vector3 delta_angle = true_delta_angle(now), delta_velocity = true_delta_velocity(now);
  Vector3 angle_piece = delta_angle - internal_.true_delta_angle;
  Vector3 velocity_piece = delta_velocity - internal_.true_delta_velocity;
  Measured measured;
  measure<true>(now, time, internal_number(), seconds(time - internal_.time),
                internal_.since_power_on + seconds(time - last_time_), false, angle_piece, velocity_piece, measured);
  ++internal_.taken;
  internal_.time = time;
  internal_.true_delta_angle = delta_angle;
  internal_.true_delta_velocity = delta_velocity;
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
      Vector3 no_angle = Vector3::Zero(), no_velocity = Vector3::Zero();
      measure<true>(now, time, internal_number(), 0, since_power_on, begins_run, no_angle, no_velocity, other);
      internal_.status |= other.status;
    }
  }
  delta_angle -= internal_.true_delta_angle;
  delta_velocity -= internal_.true_delta_velocity;
  measure<true>(now, time, internal_number(), seconds(time - internal_.time), since_power_on, begins_run, delta_angle,
                delta_velocity, out);
  out.delta_angle += internal_.delta_angle;
  out.delta_velocity += internal_.delta_velocity;
  out.status |= internal_.status;
  if (inclinometer_) [[unlikely]]
    out.inclination = inclination_;
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

  Vector3 delta_angle = Vector3::Zero();
  Vector3 delta_velocity = Vector3::Zero();
  double dt = 0.0;
  if (!is_first) {
    dt = seconds(time - last_time_);
    delta_angle = true_delta_angle(now);
    delta_velocity = true_delta_velocity(now);
  }
  last_.q_NB = now.q_NB;
  last_.omega_BN_B = now.omega_BN_B;
  last_.dv_N = now.dv_N;
  last_force_B_ = now.specific_force_B;
  last_time_ = time;
  angle_sum_B_.setZero();
  velocity_sum_B_.setZero();
  centripetal_sum_B_.setZero();
  if (is_disturbed_) [[unlikely]]
    size_effect_.clear();

  if (measures_slowly_) [[unlikely]]
    measure_last(now, time, is_first, delta_angle, delta_velocity, out);
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
