// The samples of a repeated run: taken with the truth of the record, and sent at the recorded pace or at once.
#include <algorithm>

#include "emulator/drive/recorded_run.hpp"

namespace imud {

void RecordedRun::take_sample(std::uint16_t imu, const RecordEvent& event) noexcept {
  if (awaits_truth(imu, event)) return;
  const bool at_rest = (event.flags & RecordEvent::at_rest) != 0;
  if (!at_rest && !engine_->timeline().empty() && engine_->timeline().newest().ns != event.b) ++differing_;
  engine_->apply({event, imu});
}

// Returns true if the sample belongs to a twin, and is taken later.
bool RecordedRun::awaits_truth(std::uint16_t imu, const RecordEvent& event) noexcept {
  if (!options_.awaits_truth || (event.flags & RecordEvent::at_rest) != 0 || engine_->timeline().empty())
    return false;
  if (imu % 2 != 0) return false;
  std::deque<RecordEvent>& waiting = awaited_[imu];
  if (waiting.empty() && TruthTime{event.a} <= engine_->timeline().newest()) return false;
  waiting.push_back(event);
  options_.awaits_truth(imu);
  return true;
}

// Takes the samples of twins whose truth has come; with `all`, also the samples whose truth has not come.
void RecordedRun::take_awaited(bool all) noexcept {
  for (const auto& [imu, events] : awaited_) take_awaited_of(imu, all);
}

void RecordedRun::take_awaited_of(std::uint16_t imu, bool all) noexcept {
  const auto found = awaited_.find(imu);
  if (found == awaited_.end() || engine_->timeline().empty()) return;
  const TruthTime newest = engine_->timeline().newest();
  std::deque<RecordEvent>& events = found->second;
  for (; !events.empty() && (all || TruthTime{events.front().a} <= newest); events.pop_front()) {
    Step step{events.front(), imu};
    step.at_once = true;
    engine_->apply(step);
  }
}

// Waits for an instant of the recorded run until the thread begins to spin. Waits in steps, so that a signal ends the
// wait. Returns the instant in the replay.
HostTime RecordedRun::wait_until(HostTime instant) noexcept {
  const HostTime now = host_->now();
  if (!shift_) shift_ = now - instant;
  constexpr Nanoseconds step = std::chrono::milliseconds(20);
  const HostTime due = instant + *shift_, until = due - pace_->spin();
  for (HostTime at = now; at < until && !stop_->load(std::memory_order_relaxed);) {
    at = host_->sleep_until(std::min(until, at + step));
    for (const auto& channel : engine_->channels()) channel->flush();
  }
  return due;
}

void RecordedRun::transmit(const RecordEvent& event) noexcept {
  const HostTime instant{event.a}, due = pace_->is_paced() ? wait_until(instant) : instant;
  if (pace_->is_paced() && *stop_) return;  // the instant has not come
  const bool was_skipped = (event.flags & RecordEvent::skipped) != 0;
  if (was_skipped) poll(event.b);
  if (was_skipped || (pace_->is_paced() && pace_->is_too_late(due, host_->now())))
    pace_->skip(instant);
  else
    pace_->transmit(instant, due);
  engine_->complete();
}

}  // namespace imud
