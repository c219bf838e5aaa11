#include <algorithm>
#include <iterator>
#include <map>
#include <numeric>
#include <set>

#include "protocols/frames/frame_device.hpp"
#include "protocols/frames/layout/frame_layout.hpp"

namespace imud {
namespace {

bool is_more_frequent(const FrameMessage& a, const FrameMessage& b) {
  if (a.period.count() != 0 && b.period.count() != 0) return a.period < b.period;
  if (a.period.count() != 0 || b.period.count() != 0) return b.period.count() != 0;
  return a.phases.size() * b.divider > b.phases.size() * a.divider;
}

constexpr std::uint64_t bit(std::size_t index) noexcept { return std::uint64_t{1} << index; }

// Makes names differ: a name that was used before gets a number at its end.
class DifferentNames {
 public:
  std::string different(const std::string& name) {
    std::string one = name;
    for (int& number = numbers_[name]; !used_.insert(one).second; one = name + "_" + std::to_string(number))
      number = std::max(number + 1, 2);
    return one;
  }

 private:
  std::set<std::string> used_;
  std::map<std::string, int> numbers_;  // the last one given
};

std::vector<FrameKind> kinds_of(const std::vector<FrameMessage>& messages) {
  std::vector<FrameKind> kinds;
  DifferentNames names;
  for (const FrameMessage& message : messages) {
    FrameKind& kind = kinds.emplace_back(FrameKind{names.different(message.name), {}});
    DifferentNames fields;
    for (const std::string& field : message.layout->fields()) kind.fields.push_back(fields.different(field));
  }
  return kinds;
}

}  // namespace

bool may_coincide(const FrameMessage& a, const FrameMessage& b) {
  if (a.by_settings.excludes(b.by_settings)) return false;
  if (a.period.count() != 0 || b.period.count() != 0) return true;
  // There is a number that has both remainders if they are the same modulo the common divisor.
  const std::uint64_t common = std::gcd(a.divider, b.divider);
  const auto remainders = [common](std::vector<std::uint64_t> phases) {
    for (std::uint64_t& phase : phases) phase %= common;
    std::ranges::sort(phases);
    return phases;
  };
  const std::vector<std::uint64_t> of_a = remainders(a.phases), of_b = remainders(b.phases);
  std::vector<std::uint64_t> both;
  std::ranges::set_intersection(of_a, of_b, std::back_inserter(both));
  return !both.empty();
}

FrameStreamDecoder::FrameStreamDecoder(std::vector<FrameMessage> messages, FrameEscape escape,
                                       std::span<const FrameValue> values)
    : kinds_(kinds_of(messages)), escape_(escape), reader_(escape) {
  const FrameMessage* most = nullptr;  // of the messages that are always sent
  for (const FrameMessage& message : messages)
    if (message.by_settings.is_always_on() && (most == nullptr || is_more_frequent(message, *most))) most = &message;
  for (const FrameMessage& message : messages) {
    if (!values.empty()) message.layout->select(values);
    components_ |= message.layout->components();
    known_.push_back(
        {message, most != nullptr && message.by_settings.is_always_on() && !is_more_frequent(*most, message)});
    for (std::size_t i = 0; i < messages.size(); ++i)
      if (&messages[i] != &message && may_coincide(message, messages[i])) known_.back().partners |= bit(i);
  }
  const auto is_likely = [&](std::size_t i) {
    return known_[i].message.by_settings.when.empty() || known_[i].message.by_settings.is_on(values);
  };
  order_.resize(known_.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::stable_partition(order_.begin(), order_.end(), is_likely);
  begin();
  choose_clocks();
}

// Chooses for the clock and each counter the message with the longest period: a needed message, or if there is none,
// another one.
void FrameStreamDecoder::choose_clocks() {
  const auto choose = [this](std::optional<std::size_t>& chosen,
                             std::optional<Wrapping> MessageLayout::Decoded::*part) {
    double best = 0;
    for (std::size_t i = 0; i < known_.size(); ++i) {
      const MessageLayout& layout = *known_[i].message.layout;
      const std::optional<Wrapping> wrapping = layout.wrapping().*part;
      if (!wrapping) continue;
      const double values = wrapping->period == 0 ? 0x1p64 : static_cast<double>(wrapping->period);
      const double round = values * static_cast<double>(layout.time_lsb_ns()) * (known_[i].is_needed ? 0x1p64 : 1);
      if (round > best) chosen = i;
      best = std::max(best, round);
    }
  };
  std::optional<std::size_t> clock, counter, alive_counter, frame_counter;
  choose(clock, &MessageLayout::Decoded::time);
  choose(counter, &MessageLayout::Decoded::counter);
  if (!counter) choose(alive_counter, &MessageLayout::Decoded::alive_counter);
  // The counter of all messages has equal steps only if the same messages are sent each time.
  const bool has_equal_steps = std::ranges::all_of(known_, [this](const Known& one) {
    const FrameMessage& first = known_.front().message;
    return one.is_needed && one.message.period == first.period && one.message.divider == first.divider &&
           one.message.phases == first.phases;
  });
  const bool has_time = std::ranges::any_of(known_, [](const Known& one) { return one.message.layout->has_time(); });
  if (!counter && !alive_counter && !has_time && has_equal_steps)
    choose(frame_counter, &MessageLayout::Decoded::frame_counter);
  // Messages with the same clock or counter are read as well, and so are messages that settings may send instead.
  const auto all_like = [this](const std::optional<std::size_t>& chosen,
                               std::optional<Wrapping> MessageLayout::Decoded::*part, bool is_own) {
    std::uint64_t all = 0;
    for (std::size_t i = 0; chosen && i < known_.size(); ++i) {
      const FrameMessage &one = known_[i].message, &like = known_[*chosen].message;
      const std::optional<Wrapping> has = one.layout->wrapping().*part;
      const bool is_like = has && !is_own && has->period == (like.layout->wrapping().*part)->period &&
                           one.layout->time_lsb_ns() == like.layout->time_lsb_ns();
      if (i == *chosen || is_like || (has && like.by_settings.excludes(one.by_settings))) all |= bit(i);
    }
    return all;
  };
  clocks_ = all_like(clock, &MessageLayout::Decoded::time, false);
  counters_ = all_like(counter, &MessageLayout::Decoded::counter, false);
  alive_counters_ = all_like(alive_counter, &MessageLayout::Decoded::alive_counter, true);
  frame_counters_ = all_like(frame_counter, &MessageLayout::Decoded::frame_counter, true);
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
  found_ = 0;
  partners_ = low_bits(static_cast<unsigned>(known_.size()));
  set_ = {};
}

void FrameStreamDecoder::end(MeasurementSink& sink) {
  if (found_ == 0) return;
  for (std::size_t i = 0; i < known_.size(); ++i) {
    const bool is_missing = known_[i].is_needed && (found_ & bit(i)) == 0 && (found_ & ~known_[i].partners) == 0;
    if (!is_missing) continue;
    ++errors_.incomplete;
    return begin();
  }
  set_.complete_vectors(components_);
  if (set_.measurement.fields != 0) sink.on_measurement(set_.measurement);
  begin();
}

bool FrameStreamDecoder::accept(const DecodedFrame& frame, MeasurementSink& sink) {
  const std::size_t index = frame.kind;
  const MessageLayout& layout = *known_[index].message.layout;
  const bool begins_sample = (partners_ & bit(index)) == 0;
  ReadBack read = begins_sample ? ReadBack() : set_;
  const auto decoded = layout.decode(frame.bytes, read);
  if (!decoded) return false;
  if (receiver_ != nullptr) receiver_->on_frame(frame);
  if (begins_sample) end(sink);
  set_ = read;
  found_ |= bit(index);
  partners_ &= known_[index].partners & ~low_bits(static_cast<unsigned>(index + 1));
  Sample& sample = set_.measurement.sample;
  const auto count = [&](const std::optional<Wrapping>& read_counter) {
    constexpr std::uint64_t short_round = 0x10000;  // a loss is more probable than a restart
    sample.counter = count_.next(*read_counter, read_counter->period > short_round);
    set_.measurement.fields |= Measurement::counter;
  };
  if ((counters_ & bit(index)) != 0 && decoded->counter) count(decoded->counter);
  if ((alive_counters_ & bit(index)) != 0 && decoded->alive_counter) count(decoded->alive_counter);
  if ((frame_counters_ & bit(index)) != 0 && decoded->frame_counter) count(decoded->frame_counter);
  if ((clocks_ & bit(index)) != 0 && decoded->time) {
    const std::uint64_t ticks = time_.next(*decoded->time, true);
    sample.time.ns = static_cast<std::int64_t>(ticks * static_cast<std::uint64_t>(layout.time_lsb_ns()));
    set_.measurement.fields |= Measurement::time;
  }
  if (partners_ == 0) end(sink);
  return true;
}

std::size_t FrameStreamDecoder::parse(std::span<const std::byte> held, MeasurementSink& sink) {
  using enum MessageLayout::Match;
  bool is_unfinished = false, has_wrong_check = false, is_malformed = false;
  for (const std::size_t i : order_) {
    const auto [match, size] = known_[i].message.layout->match(held);
    is_unfinished |= match == unfinished;
    has_wrong_check |= match == wrong_check;
    if (match != yes) continue;
    if (accept({i, offset_, held.first(size)}, sink)) {
      offset_ += size;
      return size;
    }
    is_malformed = true;
  }
  if (is_unfinished) return Search::need_more;
  errors_.checksum += has_wrong_check;
  errors_.malformed += is_malformed;
  ++offset_;
  return Search::reject;
}

// Processes a frame without its escapes, which must be one whole message.
void FrameStreamDecoder::take_content(MeasurementSink& sink) {
  const std::span<const std::byte> content = reader_.content();
  bool has_wrong_check = false;
  for (const std::size_t i : order_) {
    const auto [match, size] = known_[i].message.layout->match(content);
    has_wrong_check |= match == MessageLayout::Match::wrong_check;
    if (match == MessageLayout::Match::yes && size == content.size() &&
        accept({i, offset_ - reader_.frame_bytes(), content}, sink))
      return;
  }
  ++(has_wrong_check ? errors_.checksum : errors_.malformed);
  errors_.skipped_bytes += content.size();
}

void FrameStreamDecoder::feed(const Frame& frame, MeasurementSink& sink) {
  if (escape_ == FrameEscape::none) {
    errors_.skipped_bytes +=
        search_.feed(frame.bytes, [&](std::span<const std::byte> held) { return parse(held, sink); });
    return;
  }
  for (const std::byte byte : frame.bytes) {
    ++offset_;
    if (reader_.take(byte)) take_content(sink);
  }
  errors_.skipped_bytes += reader_.take_skipped();
}

void FrameStreamDecoder::finish(MeasurementSink& sink) {
  reader_.finish();
  errors_.skipped_bytes += search_.finish() + reader_.take_skipped();
  end(sink);
}

}  // namespace imud
