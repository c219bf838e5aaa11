// Samples while the simulator stands still. This code has a file of its own, because the compiler optimises the path
// of the ordinary samples less if this code is beside it: g++ 12 makes 125 instructions a step more.
#include <algorithm>
#include <utility>

#include "core/imu.hpp"

namespace imud {

// The simulator stands still: the sensor's own time goes on, with its last attitude and force.
Sample Imu::sample_held(const Timeline& timeline, DeviceTime stamp) noexcept {
  if (may_catch_up_.count() > 0) catch_up(sampled_);
  const TruthTime begin = last_time_;
  const MotionBegin last = last_;
  const auto held_at = [&](TruthTime time) {
    MotionState state;
    state.time = time;
    state.basis = MotionState::Basis::held;
    state.q_NB = last.q_NB;
    state.specific_force_B = last_force_B_;
    state.dv_N = last.dv_N + seconds(time - begin) * (last.q_NB * last_force_B_);
    return state;
  };
  const Nanoseconds step = nanoseconds(period_s_);
  const TruthTime time = begin + step;
  held_ += step;
  if (advanced_.time <= begin) advanced_ = held_at(begin);
  while (has_internal_left()) {
    const MotionState at = held_at(std::min(next_internal(), time));
    add_piece(at);
    take_internal(at, at.time);
  }
  MotionState now = held_at(time);
  add_piece(now);
  if (follows_truth_) follow_truth(timeline, sampled_);
  Sample out = sense_slowly(now, time, false, stamp);
  now.time = sampled_;
  finish_slowly(timeline, now, out);
  return out;
}

Sample Imu::sample_around_hold(const Timeline& timeline, TruthTime time, DeviceTime stamp) noexcept {
  if (time <= sampled_) return sample_held(timeline, stamp);
  catch_up(time);
  return sample_moving(timeline, time, stamp);
}

// Removes the hold from the times and from the accumulated velocity, as if the simulator had not run meanwhile.
void Imu::end_hold() noexcept {
  const Vector3 dv_N = seconds(held_) * (last_.q_NB * last_force_B_);
  last_.dv_N -= dv_N;
  advanced_.dv_N -= dv_N;
  last_time_ = last_time_ - held_;
  advanced_.time = advanced_.time - held_;
  internal_.time = internal_.time - held_;
  may_catch_up_ = std::exchange(held_, Nanoseconds{0});
}

// The next sample is at `time`. As far as `time` is later than a step after the hold, the simulator has run
// meanwhile. The held samples have had their part of that time already.
void Imu::catch_up(TruthTime time) noexcept {
  if (is_held()) end_hold();
  const Nanoseconds had =
      std::clamp(time - sampled_ - nanoseconds(period_s_), Nanoseconds{0}, std::exchange(may_catch_up_, {}));
  const Vector3 dv_B = seconds(had) * last_force_B_;
  last_.dv_N += last_.q_NB * dv_B;
  velocity_sum_B_.subtract(lanes(dv_B));
  last_time_ = last_time_ + had;
  if (internal_.taken == 0) internal_.time = last_time_;
}

}  // namespace imud
