#include "transports/can/can_queue.hpp"

#include <algorithm>

namespace imud {

std::size_t CanQueue::ready(HostTime now) const noexcept {
  if (now < retry_) return 0;
  std::size_t n = 0;
  for (HostTime at = std::max(paced_, now - max_burst); n < count_ && at <= now; ++n) at = at + (*this)[n].spacing;
  return n;
}

void CanQueue::sent(std::size_t count, HostTime now) noexcept {
  if (count > 0) retry_ = {};
  for (; count > 0; --count) {
    if (const Nanoseconds spacing = (*this)[0].spacing; spacing > Nanoseconds{0})
      paced_ = std::max(paced_, now - max_burst) + spacing;
    drop_first();
  }
}

void CanQueue::drop_first() noexcept {
  first_ = (first_ + 1) % max_frames;
  --count_;
}

std::size_t CanQueue::drop_stale(HostTime now) noexcept {
  std::size_t begun = 0;  // frames at the front that were queued together, and of which the first has left
  while (begun < count_ && !(*this)[begun].first) ++begun;
  std::size_t end = begun;  // end of the stale frames behind them; older frames precede newer frames
  while (end < count_ && (!(*this)[end].first || now - (*this)[end].since > max_age_)) ++end;
  const std::size_t stale = end - begun;
  if (stale == 0) return 0;
  for (std::size_t i = begun; i > 0; --i) queue_[(first_ + stale + i - 1) % max_frames] = (*this)[i - 1];
  first_ = (first_ + stale) % max_frames;
  count_ -= stale;
  return stale;
}

std::size_t CanQueue::clear() noexcept {
  const std::size_t dropped = count_;
  count_ = 0;
  return dropped;
}

std::optional<HostTime> CanQueue::next() const noexcept {
  if (count_ == 0) return std::nullopt;
  return std::max(paced_, retry_);
}

}  // namespace imud
