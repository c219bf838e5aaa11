// The samples of a repeated run: taken with the truth of the record, and sent at the recorded pace or at once.
#include <algorithm>

#include "emulator/drive/recorded_run.hpp"

namespace imud {

void RecordedRun::take_sample(Channel& channel, const RecordEvent& event) noexcept {
  if (prepared_.size() == prepared_.capacity()) return;  // a damaged record
  const auto k = static_cast<std::uint64_t>(event.c);
  if (awaits_truth(channel, event)) return;
  if ((event.flags & RecordEvent::at_rest) != 0) {
    engine_->prepare_at_rest(channel, k, Nanoseconds(event.a));
  } else if (engine_->timeline().empty()) {
    return;
  } else {
    if (engine_->timeline().newest().ns != event.b) ++differing_;
    engine_->prepare(channel, k, TruthTime{event.a});
  }
  prepared_.push_back(&channel);
}

// Returns true if the sample belongs to a twin, and is taken later.
bool RecordedRun::awaits_truth(const Channel& channel, const RecordEvent& event) noexcept {
  if (!options_.awaits_truth || (event.flags & RecordEvent::at_rest) != 0 || engine_->timeline().empty())
    return false;
  const auto all = engine_->channels();
  const auto found = std::find_if(all.begin(), all.end(), [&](const auto& c) { return c.get() == &channel; });
  const auto number = static_cast<std::size_t>(found - all.begin());
  if (number % 2 != 0) return false;
  std::deque<RecordEvent>& waiting = awaited_[&channel];
  if (waiting.empty() && TruthTime{event.a} <= engine_->timeline().newest()) return false;
  waiting.push_back(event);
  options_.awaits_truth(number);
  return true;
}

// Takes the samples of twins whose truth has come; `all`: also if their truth never comes.
void RecordedRun::take_awaited(bool all) noexcept {
  if (awaited_.empty() || engine_->timeline().empty()) return;
  const TruthTime newest = engine_->timeline().newest();
  for (const auto& channel : engine_->channels()) {
    const auto waiting = awaited_.find(channel.get());
    if (waiting == awaited_.end()) continue;
    for (std::deque<RecordEvent>& events = waiting->second;
         !events.empty() && (all || TruthTime{events.front().a} <= newest); events.pop_front()) {
      channel->sense(engine_->timeline(), TruthTime{events.front().a}, static_cast<std::uint64_t>(events.front().c));
      channel->prepare(TruthTime{events.front().a}, false);
      channel->encode();
      channel->transmit();
    }
  }
}

// Waits until the thread spins for the instant of the recorded run, in steps, so that a signal ends the wait. Returns
// the instant of the replay.
HostTime RecordedRun::wait_until(HostTime instant) noexcept {
  const HostTime now = host_->now();
  if (!shift_) shift_ = now - instant;
  constexpr Nanoseconds step = std::chrono::milliseconds(20);
  const HostTime due = instant + *shift_, until = due - pace_->spin();
  for (HostTime at = now; at < until && !stop_->load(std::memory_order_relaxed);) {
    at = host_->sleep_until(std::min(until, at + step));
    engine_->flush();
  }
  return due;
}

void RecordedRun::transmit(const RecordEvent& event) noexcept {
  std::optional<HostTime> due;
  if (pace_) due = wait_until(HostTime{event.a});
  if (due && *stop_) return;  // the instant has not come
  const bool was_skipped = (event.flags & RecordEvent::skipped) != 0;
  if (was_skipped) poll(event.b);
  if (was_skipped || (due && pace_->is_too_late(*due, host_->now())))
    for (Channel* channel : prepared_) channel->skip();
  else if (due)
    transmit_at(*due);
  else
    transmit_at_once();
  for (Channel* channel : prepared_) channel->count_sample();
  engine_->count_samples(prepared_.size());
  prepared_.clear();
}

void RecordedRun::transmit_at(HostTime due) noexcept {
  for (Channel* channel : prepared_) channel->encode();
  pace_->transmit(prepared_, due);
}

void RecordedRun::transmit_at_once() noexcept {
  for (Channel* channel : prepared_) {
    channel->wait_for_room(*stop_);
    channel->encode();
  }
  for (Channel* channel : prepared_) {
    channel->wait_for_room(*stop_);
    channel->transmit();
    if (channel->is_can()) channel->wait_until_sent(*stop_);
  }
}

}  // namespace imud
