#include "emulator/imu/awaited_truth.hpp"

#include <atomic>
#include <limits>

namespace imud {

namespace {

void raise(std::atomic<double>& greatest, double value) noexcept {
  if (value > greatest.load(std::memory_order_relaxed)) greatest.store(value, std::memory_order_relaxed);
}

}  // namespace

void AwaitedTruth::add(const Imu& imu, Nanoseconds ahead, bool is_extrapolated,
                       const std::optional<FeedSample>& shown) noexcept {
  if (shown && count_ == 0 && ahead.count() <= 0) feed_->push(*shown);
  const bool waits = ahead.count() > 0 || (shown && count_ > 0);
  if (!waits || (!is_extrapolated && !shown)) return;
  const TruthTime time = imu.advanced_to();
  // Simulation time stands still while the simulator stands still. The sensor's time goes on.
  const auto is_overdue = [&] {
    if (time - first().time > patience) return true;
    std::size_t i = 0;
    while (i < count_ && !ring_[(first_ + i) % capacity].is_shown) ++i;
    return shown && i < count_ && shown->time_ns - ring_[(first_ + i) % capacity].shown.time_ns > patience.count();
  };
  while (count_ > 0 && (count_ == capacity || is_overdue())) give_up_first();
  Awaiting& added = ring_[(first_ + count_++) % capacity];
  added.time = time;
  added.ahead = ahead;
  added.is_extrapolated = is_extrapolated;
  added.rate = imu.true_rate();
  added.specific_force = imu.true_specific_force();
  added.is_shown = shown.has_value();
  if (shown) added.shown = *shown;
}

void AwaitedTruth::review(const Timeline& timeline, TruthQuality::ExtrapolationError& error) noexcept {
  while (count_ > 0 && first().time <= timeline.newest()) {
    Awaiting& one = first();
    const MotionState state = timeline.at(one.time);
    if (state.basis != MotionState::Basis::interpolated || state.time != one.time) {  // of another run
      give_up_first();
      continue;
    }
    const Vector3& omega = state.omega_BN_B;
    const Vector3 rate = dcm_PB_ * omega;
    const Vector3 specific_force =
        dcm_PB_ * (state.specific_force_B + state.omegaDot_BN_B.cross(r_SB_B_) + omega.cross(omega.cross(r_SB_B_)));
    if (one.is_extrapolated) {
      raise(error.ahead_s, seconds(one.ahead));
      raise(error.rate_rad_per_s, (one.rate - rate).norm());
      raise(error.specific_force_m_per_s2, (one.specific_force - specific_force).norm());
      error.samples.fetch_add(1, std::memory_order_relaxed);
    }
    if (one.is_shown) {
      one.shown.true_rate = rate;
      one.shown.true_specific_force = specific_force;
      feed_->push(one.shown);
    }
    remove_first();
  }
}

void AwaitedTruth::give_up_first() noexcept {
  if (Awaiting& one = first(); one.is_shown) {
    one.shown.true_rate.setConstant(std::numeric_limits<double>::quiet_NaN());
    one.shown.true_specific_force = one.shown.true_rate;
    feed_->push(one.shown);
  }
  remove_first();
}

void AwaitedTruth::clear() noexcept {
  while (count_ > 0) give_up_first();
}

}  // namespace imud
