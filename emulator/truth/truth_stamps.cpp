#include "emulator/truth/truth_stamps.hpp"

#include <chrono>

namespace imud {

TruthStamps::Taken TruthStamps::take(TruthTime time, const ClockStamp& stamp, SharedTime arrival) noexcept {
  const Knot next{time, stamp.time};
  const bool goes_on = count_ > 0 && next.difference() == knot(count_ - 1).difference();
  const Nanoseconds late = arrival - stamp.time;
  const bool is_far = late > (goes_on ? longest_hold_up : farthest) || late < -farthest;
  if (clock_ == SharedClock::none || stamp.clock != clock_ || is_far) {
    clear();
    if (clock_ == SharedClock::none || stamp.clock == SharedClock::none) return {};
    return {stamp.clock != clock_ ? Result::other_clock : Result::far};
  }
  if (count_ == 0) {
    first_ = 0;
    knots_[count_++] = next;
    return {Result::used};
  }
  const Knot& newest = knot(count_ - 1);
  if (next.stamp <= newest.stamp) return {Result::not_later};
  const Nanoseconds shift = next.difference() - newest.difference();
  const bool is_between = shift.count() == 0 && count_ > 1 && knot(count_ - 2).difference() == newest.difference();
  if (is_between)
    --count_;
  else if (count_ == knots_.size()) {
    first_ = (first_ + 1) % knots_.size();
    --count_;
  }
  knots_[(first_ + count_++) % knots_.size()] = next;
  return {Result::used, shift};
}

TruthTime TruthStamps::truth(SharedTime time) const noexcept {
  std::size_t after = count_;  // the first knot after `time`
  while (after > 0 && knot(after - 1).stamp > time) --after;
  if (after == 0) return knot(0).truth + (time - knot(0).stamp);
  const Knot& from = knot(after - 1);
  if (after == count_) return from.truth + (time - from.stamp);
  const Knot& to = knot(after);
  __extension__ using Wide = __int128;
  const Wide passed = Wide{(time - from.stamp).count()} * (to.truth - from.truth).count();
  return from.truth + Nanoseconds{static_cast<std::int64_t>(passed / (to.stamp - from.stamp).count())};
}

}  // namespace imud
