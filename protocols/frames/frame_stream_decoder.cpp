#include <algorithm>
#include <numeric>

#include "protocols/frames/frame_device.hpp"

namespace imud {
namespace {

// Samples between two messages, or the share of a second.
bool is_more_frequent(const FrameMessage& a, const FrameMessage& b) {
  if (a.period.count() != 0 && b.period.count() != 0) return a.period < b.period;
  if (a.period.count() != 0 || b.period.count() != 0) return b.period.count() != 0;
  return a.divider < b.divider;
}

}  // namespace

FrameStreamDecoder::FrameStreamDecoder(std::vector<FrameMessage> messages, std::span<const std::uint8_t> values) {
  const FrameMessage* most = nullptr;  // of the messages that are always sent
  for (const FrameMessage& message : messages)
    if (message.by_settings.is_always_on() && (most == nullptr || is_more_frequent(message, *most))) most = &message;
  for (const FrameMessage& message : messages) {
    const bool is_needed = most != nullptr && message.by_settings.is_always_on() && !is_more_frequent(*most, message);
    components_ |= message.layout.components();
    needed_ += is_needed;
    known_.push_back({message, is_needed});
  }
  const auto is_likely = [&](std::size_t i) {
    return known_[i].message.by_settings.when.empty() || known_[i].message.by_settings.is_on(values);
  };
  order_.resize(known_.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::stable_partition(order_.begin(), order_.end(), is_likely);
  choose_clocks();
}

// Chooses the message with the longest round among the needed messages, or else among the others.
void FrameStreamDecoder::choose_clocks() {
  const auto choose = [this](std::optional<std::size_t>& chosen,
                             std::optional<Wrapping> FrameLayout::Decoded::*part) {
    double best = 0;
    for (std::size_t i = 0; i < known_.size(); ++i) {
      const FrameLayout& layout = known_[i].message.layout;
      const std::optional<Wrapping> wrapping = layout.wrapping().*part;
      if (!wrapping) continue;
      const double values = wrapping->period == 0 ? 0x1p64 : static_cast<double>(wrapping->period);
      const double round = values * static_cast<double>(layout.time_lsb_ns()) * (known_[i].is_needed ? 0x1p64 : 1);
      if (round > best) chosen = i;
      best = std::max(best, round);
    }
  };
  choose(clock_, &FrameLayout::Decoded::time);
  choose(counter_, &FrameLayout::Decoded::counter);
  if (!counter_) choose(alive_counter_, &FrameLayout::Decoded::alive_counter);
}

std::uint64_t FrameStreamDecoder::Continued::next(const Wrapping& read, bool may_go_back) noexcept {
  const auto [value, period] = read;
  if (!last_ || (period != 0 && value >= period)) return *(last_ = value);
  if (period == 0) return *(last_ = value);
  const std::uint64_t phase = *last_ % period;
  const std::uint64_t step = value >= phase ? value - phase : value + (period - phase);
  const bool is_back = may_go_back && step > period / 2 && *last_ >= period - step;
  last_ = is_back ? *last_ - (period - step) : *last_ + step;
  return *last_;
}

void FrameStreamDecoder::begin() noexcept {
  next_ = found_ = 0;
  set_ = {};
}

void FrameStreamDecoder::end(MeasurementSink& sink) {
  if (next_ == 0) return;
  if (found_ < needed_) {
    ++errors_.incomplete;
    return begin();
  }
  constexpr std::uint32_t vectors[] = {Measurement::rate, Measurement::specific_force, Measurement::delta_angle,
                                       Measurement::delta_velocity};
  for (std::size_t i = 0; i < std::size(vectors); ++i) {
    const std::uint32_t all = components_ & 7U << 3 * i;
    if (all != 0 && (set_.components & all) == all) set_.measurement.fields |= vectors[i];
  }
  if (set_.measurement.fields != 0) sink.on_measurement(set_.measurement);
  begin();
}

bool FrameStreamDecoder::accept(std::size_t index, std::span<const std::byte> frame, MeasurementSink& sink) {
  const FrameLayout& layout = known_[index].message.layout;
  const bool begins_sample = index < next_;
  ReadBack read = begins_sample ? ReadBack() : set_;
  const auto decoded = layout.decode(frame, read);
  if (!decoded) return false;
  if (begins_sample) end(sink);
  set_ = read;
  next_ = index + 1;
  found_ += known_[index].is_needed;
  Sample& sample = set_.measurement.sample;
  const auto count = [&](const std::optional<Wrapping>& read_counter) {
    constexpr std::uint64_t short_round = 0x10000;  // a loss is more probable than a restart
    sample.counter = count_.next(*read_counter, read_counter->period > short_round);
    set_.measurement.fields |= Measurement::counter;
  };
  // A message may be sent in the place of the one that was chosen.
  const auto excluded = [&](std::size_t other) {
    return known_[other].message.by_settings.excludes(known_[index].message.by_settings);
  };
  const auto is_chosen = [&](const std::optional<std::size_t>& chosen) {
    return chosen && (index == *chosen || excluded(*chosen));
  };
  if (is_chosen(counter_) && decoded->counter) count(decoded->counter);
  if (is_chosen(alive_counter_) && decoded->alive_counter) count(decoded->alive_counter);
  if (is_chosen(clock_) && decoded->time) {
    const std::uint64_t ticks = time_.next(*decoded->time, true);
    sample.time.ns = static_cast<std::int64_t>(ticks * static_cast<std::uint64_t>(layout.time_lsb_ns()));
    set_.measurement.fields |= Measurement::time;
  }
  bool is_last = true;
  for (std::size_t i = next_; i < known_.size(); ++i) is_last &= excluded(i);
  if (is_last) end(sink);
  return true;
}

std::size_t FrameStreamDecoder::parse(std::span<const std::byte> held, MeasurementSink& sink) {
  using enum FrameLayout::Match;
  bool is_unfinished = false, has_wrong_check = false, is_malformed = false;
  for (const std::size_t i : order_) {
    const FrameLayout& layout = known_[i].message.layout;
    const FrameLayout::Match match = layout.match(held);
    is_unfinished |= match == unfinished;
    has_wrong_check |= match == wrong_check;
    if (match != yes) continue;
    if (accept(i, held.first(layout.size()), sink)) return layout.size();
    is_malformed = true;
  }
  if (is_unfinished) return Search::need_more;
  errors_.checksum += has_wrong_check;
  errors_.malformed += is_malformed;
  return Search::reject;
}

void FrameStreamDecoder::feed(const Frame& frame, MeasurementSink& sink) {
  errors_.skipped_bytes +=
      search_.feed(frame.bytes, [&](std::span<const std::byte> held) { return parse(held, sink); });
}

void FrameStreamDecoder::finish(MeasurementSink& sink) {
  errors_.skipped_bytes += search_.finish();
  end(sink);
}

}  // namespace imud
