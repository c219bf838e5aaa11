#include "protocols/signals/signal_device.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/attitude.hpp"

namespace imud {
namespace {

// Sample times are rounded to ns. Therefore a sample at the begin of a period may have a time before the begin.
constexpr Nanoseconds tolerance{1000};

}  // namespace

double rate_of(const SignalMessage& message, double rate_hz) noexcept {
  return message.period.count() == 0 ? rate_hz : std::min(rate_hz, 1.0 / seconds(message.period));
}

SignalDevice::SignalDevice(std::vector<SignalMessage> messages) {
  if (messages.size() > FrameBuffer::max_frames)
    throw std::invalid_argument("more than " + std::to_string(FrameBuffer::max_frames) + " messages");
  for (SignalMessage& message : messages) {
    scheduled_.push_back({.message = std::move(message)});
    scheduled_.back().has_increments = scheduled_.back().message.codec.has_increments();
  }
}

void SignalDevice::power_on(DeviceTime) noexcept { start_.reset(); }

void SignalDevice::step_clock(Nanoseconds by) noexcept {
  if (start_) start_ = *start_ + by;
  for (Scheduled& one : scheduled_) one.increments.sent = one.increments.sent + by;
}

bool SignalDevice::is_due(Scheduled& one, DeviceTime now, std::uint64_t steps) const noexcept {
  if (one.message.period.count() == 0) {
    one.count += steps;
    return true;
  }
  const std::int64_t period = (now - *start_ + tolerance) / one.message.period;
  if (period <= one.period) return false;
  // If samples were skipped, the counter has a gap, as if their messages were lost.
  one.count += steps > 1 ? static_cast<std::uint64_t>(period - one.period) : 1;
  one.period = period;
  return true;
}

void SignalDevice::sample(const Sample& sample, FrameBuffer& out) noexcept {
  const bool is_first = !start_;
  if (is_first) start_ = sample.time;
  const std::uint64_t steps = sample.number() - counter_;
  counter_ = sample.number();
  for (Scheduled& one : scheduled_) {
    if (is_first) {
      one.count = 0;
      one.period = 0;
      one.increments.begin(sample.time);
    }
    if (one.has_increments) one.increments.add(sample);
    if (is_first || is_due(one, sample.time, steps)) send(one, sample, out);
  }
}

void SignalDevice::send(Scheduled& one, const Sample& sample, FrameBuffer& out) noexcept {
  const CanSignalCodec& codec = one.message.codec;
  const std::span<std::byte> room = out.room(codec.size());
  if (room.size() != codec.size()) return;
  const std::uint64_t ahead = one.message.period.count() == 0 ? sample.counter_error : 0;
  saturated_ += codec.encode(one.increments.reading(sample, figures_), one.count, room, ahead);
  out.push(codec.size(), one.message.can);
  if (one.has_increments) one.increments.begin(sample.time);
}

std::unique_ptr<FrameSeal> seal_of(std::vector<SignalMessage> messages) {
  class Seal final : public FrameSeal {
   public:
    explicit Seal(std::vector<SignalMessage> sent) : messages_(std::move(sent)) {}
    std::span<std::byte> reseal(std::span<std::byte> frame, const CanHeader& can) noexcept override {
      for (const auto& [header, period, codec] : messages_) {
        if (header != can || codec.size() != frame.size() || !codec.has_checksum()) continue;
        ReadBack read;
        codec.write_checksum(frame);
        return codec.has_good_checksum(frame) && codec.decode(frame, read) ? frame : std::span<std::byte>();
      }
      return {};
    }

   private:
    std::vector<SignalMessage> messages_;
  };
  if (std::ranges::none_of(messages, [](const SignalMessage& message) { return message.codec.has_checksum(); }))
    return nullptr;
  return std::make_unique<Seal>(std::move(messages));
}

SignalDecoder::SignalDecoder(std::vector<SignalMessage> messages) : messages_(std::move(messages)) {
  if (messages_.empty()) return;
  shortest_ = std::ranges::min(messages_, {}, &SignalMessage::period).period;
  for (const SignalMessage& message : messages_) {
    components_ |= message.codec.components();
    needed_ += message.period == shortest_;
    is_multiplexed_ |= message.codec.is_multiplexed();
  }
}

void SignalDecoder::begin() noexcept {
  next_ = found_ = 0;
  counter_ = {};
  if (!is_multiplexed_) set_ = {};
}

void SignalDecoder::end(MeasurementSink& sink) {
  if (next_ == 0) return;
  if (found_ < needed_) {
    ++errors_.incomplete;
    return begin();
  }
  set_.complete_vectors(components_);
  if (set_.measurement.fields != 0) sink.on_measurement(set_.measurement);
  begin();
}

bool SignalDecoder::agrees(const CanSignalCodec::LowBits& counter) const noexcept {
  const unsigned bits = std::min(counter.bits, counter_.bits);
  return bits == 0 || ((counter.value ^ counter_.value) << (64 - bits)) == 0;
}

// Unwraps the time: takes the time with these low bits that is nearest to the previous time. The first time is taken
// unchanged.
void SignalDecoder::unwrap(const CanSignalCodec::Decoded& decoded) noexcept {
  const unsigned unused = 64 - decoded.time.bits;
  if (!ticks_) ticks_ = decoded.time.value;
  const auto step = static_cast<std::int64_t>((decoded.time.value - *ticks_) << unused) >> unused;
  ticks_ = *ticks_ + static_cast<std::uint64_t>(step);
  set_.measurement.sample.time.ns =
      static_cast<std::int64_t>(*ticks_ * static_cast<std::uint64_t>(decoded.time_lsb_ns));
  set_.measurement.fields |= Measurement::time;
}

void SignalDecoder::feed(const Frame& frame, MeasurementSink& sink) {
  const CanHeader& can = frame.can;
  const auto message = std::ranges::find_if(messages_, [&](const SignalMessage& one) {
    return one.can.id == can.id && one.can.extended == can.extended && one.can.fd == can.fd;
  });
  if (message == messages_.end() || can.remote || can.error) return;
  if (frame.bytes.size() != message->codec.size()) {
    ++errors_.malformed;
    return;
  }
  if (!message->codec.has_good_checksum(frame.bytes)) {
    ++errors_.checksum;
    return;
  }
  const auto index = static_cast<std::size_t>(message - messages_.begin());
  if (index < next_) end(sink);
  const ReadBack before = set_;
  const auto decoded = message->codec.decode(frame.bytes, set_);
  if (!decoded) {
    set_ = before;
    ++errors_.malformed;
    return;
  }
  if (!agrees(decoded->counter)) {
    ++errors_.incomplete;
    begin();
    if (!is_multiplexed_) static_cast<void>(message->codec.decode(frame.bytes, set_));
  }
  next_ = index + 1;
  found_ += message->period == shortest_;
  if (decoded->counter.bits > 0) {
    if (decoded->counter.bits > counter_.bits) counter_ = decoded->counter;
    set_.measurement.sample.counter = counter_.value;
    set_.measurement.fields |= Measurement::counter;
  }
  if (decoded->time.bits > 0) unwrap(*decoded);
  if (next_ == messages_.size()) end(sink);
}

void SignalDecoder::finish(MeasurementSink& sink) { end(sink); }

}  // namespace imud
