#include "protocols/frames/frame_device.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/attitude.hpp"
#include "core/numbers/number_text.hpp"
#include "protocols/frames/layout/frame_layout.hpp"
#include "protocols/frames/text/text_layout.hpp"

namespace imud {
namespace {

// Sample times are rounded to ns. Therefore a sample at the begin of a period may have a time before the begin.
constexpr Nanoseconds tolerance{1000};

std::shared_ptr<MessageLayout> layout_of(const FrameDescription& description,
                                         const FrameDescription::Message& message) {
  if (message.text) return std::make_shared<TextLayout>(description, message);
  return std::make_shared<FrameLayout>(description, message);
}

}  // namespace

double highest_rate_hz(const FrameDescription& description, const FrameDescription::Message& message) {
  double highest = message.rate_hz;
  for (const FrameHostDescription::Setting& setting : description.host.settings)
    if (setting.name == message.rate_setting) {
      if (setting.is_range) highest = static_cast<double>(setting.highest);
      for (const std::string& value : setting.values)
        highest = std::max(highest, number_in<double>(value).value_or(0));
    }
  return highest;
}

double default_rate_hz(const FrameDescription& description) {
  if (description.rate_hz > 0) return description.rate_hz;
  double highest = 0;
  for (const FrameDescription::Message& message : description.messages) {
    if (message.rate_setting.empty() && message.rate_hz == 0) return 0;
    highest = std::max(highest, highest_rate_hz(description, message));
  }
  return highest <= Grid::max_rate_hz ? highest : 0;
}

std::vector<FrameMessage> frame_messages(const FrameDescription& description) {
  std::vector<FrameMessage> messages;
  std::vector<FrameFault> faults;
  std::size_t bytes = 0;
  const FrameSettings settings(description);
  for (const FrameDescription::Message& message : description.messages) try {
      messages.push_back({message.name,
                          message.line,
                          message.rate_hz > 0 ? nanoseconds(1 / message.rate_hz) : Nanoseconds{},
                          message.divider,
                          message.phases,
                          layout_of(description, message),
                          {}});
      if (settings.faults().empty()) messages.back().by_settings = settings.switch_of(message, faults);
      bytes += longest_escaped(description.escape, messages.back().layout->longest());
    } catch (const FrameFaults& error) {
      faults.insert(faults.end(), error.faults.begin(), error.faults.end());
    }
  if (faults.empty() && (messages.empty() || messages.size() > FrameDescription::most_messages))
    faults.push_back({1, "message", "describe 1 to 64 messages, each as [[message]]"});
  if (description.escape != FrameEscape::none && !description.host.requests.empty())
    faults.push_back({description.host.requests.front().line, "request",
                      "requests that are escaped are not read; leave escape or the requests out"});
  if (faults.empty() && bytes > FrameBuffer::max_bytes)
    faults.push_back({1, "message",
                      "all messages together have " + std::to_string(bytes) + " bytes; with one sample at most " +
                          std::to_string(FrameBuffer::max_bytes) + " can be sent"});
  if (!faults.empty()) throw FrameFaults(description.file, std::move(faults));
  return messages;
}

FrameDevice::FrameDevice(std::vector<FrameMessage> messages, const FrameDescription& description, FrameHost host,
                         const UartSettings& uart)
    : host_(std::move(host)),
      uart_(uart),
      starting_(description.start),
      escape_(description.escape),
      keeps_newest_(host_.requests().needs_samples()) {
  for (FrameMessage& message : messages) {
    scheduled_.push_back({.message = std::move(message)});
    const MessageLayout& layout = *scheduled_.back().message.layout;
    scheduled_.back().carried.resize(layout.carries());
    if (escape_ != FrameEscape::none) content_.resize(std::max(content_.size(), layout.longest()));
  }
  for (const FrameRequest& request : host_.requests().all()) keeps_newest_ |= request.poll.has_value();
  power_on({});
}

void FrameDevice::power_on(DeviceTime now) noexcept {
  host_.power_on();
  newest_ = {};
  newest_.time = now;
  restart(now);
}

// Restarts the unit, so that the next sample starts periods and dividers.
void FrameDevice::restart(DeviceTime now) noexcept {
  powered_ = now;
  start_.reset();
  for (Scheduled& one : scheduled_) one.is_polled = false;
  switch_messages();
}

void FrameDevice::step_clock(Nanoseconds by) noexcept {
  powered_ = powered_ + by;
  if (start_) start_ = *start_ + by;
  newest_.time = newest_.time + by;
  for (Scheduled& one : scheduled_) one.increments.sent = one.increments.sent + by;
  host_.step_clock(by);
}

void FrameDevice::start(DeviceTime now) noexcept {
  start_ = now;
  samples_ = 0;
  frames_ = 0;
  for (Scheduled& one : scheduled_) {
    one.number = -1;
    one.skew = 0;
    one.increments.begin(now);
    std::ranges::fill(one.carried, 0);
  }
}

// Returns the number of the message that was last due, or would have been due with `ahead` samples more.
std::int64_t FrameDevice::number_at(const Scheduled& one, DeviceTime now, std::int64_t ahead) const noexcept {
  if (one.message.period.count() != 0) return (now - *start_ + tolerance) / one.message.period;
  const std::vector<std::uint64_t>& phases = one.message.phases;
  const auto divider = static_cast<std::int64_t>(one.message.divider);
  const std::int64_t samples = samples_ + ahead, phase = (samples % divider + divider) % divider;
  const auto sent = std::ranges::upper_bound(phases, static_cast<std::uint64_t>(phase)) - phases.begin();
  const std::int64_t rounds = (samples - phase) / divider;
  return rounds * static_cast<std::int64_t>(phases.size()) + sent - 1;
}

// Returns by how many messages the counter of the message is wrong if the counter of the samples is.
std::int64_t FrameDevice::messages_ahead(const Scheduled& one, const Sample& sample) const noexcept {
  const auto error = static_cast<std::int64_t>(sample.counter_error);
  return error == 0 ? 0 : number_at(one, sample.time, error) - number_at(one, sample.time);
}

void FrameDevice::sample(const Sample& sample, FrameBuffer& out) noexcept {
  constexpr std::uint64_t longest_gap = 1 << 30;  // samples; more is no gap
  if (sample.time - powered_ < starting_.silent) return;
  if (!start_) {
    start(sample.time);
  } else {
    const std::uint64_t steps = sample.number() - counter_;
    samples_ += steps == 0 || steps > longest_gap ? 1 : static_cast<std::int64_t>(steps);
  }
  counter_ = sample.number();
  if (keeps_newest_)
    copy(sample, newest_);
  else
    newest_.time = sample.time;
  for (Scheduled& one : scheduled_) {
    if (one.message.layout->has_increments()) one.increments.add(sample);
    const std::int64_t number = number_at(one, sample.time);
    const bool is_due = number > one.number;
    if (!is_due && !one.is_polled) continue;
    if (is_due && !one.is_on) one.skew -= number - one.number;
    if (is_due) one.number = number;
    const bool is_streamed = is_due && one.is_on;
    if (!is_streamed && one.is_polled) ++one.skew;
    if (is_streamed || one.is_polled)
      send(one, sample, out);
    else if (one.message.by_settings.is_streamed)
      one.increments.begin(sample.time);
    one.is_polled = false;
  }
}

void FrameDevice::send(Scheduled& one, const Sample& sample, FrameBuffer& out) noexcept {
  const MessageLayout& layout = *one.message.layout;
  const bool is_escaped = escape_ != FrameEscape::none;
  const std::size_t longest = longest_escaped(escape_, layout.longest());
  const std::span<std::byte> room = out.room(longest);
  if (room.size() != longest) return;
  std::int64_t frames_ahead = 0;
  if (sample.counter_error != 0)
    for (const Scheduled& each : scheduled_) frames_ahead += each.is_on ? messages_ahead(each, sample) : 0;
  const MessageLayout::State state{static_cast<std::uint64_t>(one.number + one.skew + messages_ahead(one, sample)),
                                   frames_++ + static_cast<std::uint64_t>(frames_ahead),
                                   sample.time - powered_ < starting_.until};
  const auto [size, saturated] = layout.encode(one.increments.reading(sample, figures_), state, one.carried,
                                               is_escaped ? std::span(content_) : room);
  counts_[0] += saturated;
  out.push(is_escaped ? escape_frame(escape_, std::span(content_).first(size), room) : size);
  one.increments.begin(sample.time);
}

void FrameDevice::receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept {
  host_.receive(from_host.bytes, now, *this, replies);
  publish();
}

void FrameDevice::poll(DeviceTime now, FrameBuffer& out) noexcept {
  host_.poll(now, *this, out);
  publish();
}

void FrameDevice::publish() noexcept {
  counts_[1] = host_.unknown_bytes();
  counts_[2] = host_.lost_answers();
}

UartSettings FrameDevice::uart() const noexcept {
  UartSettings uart = uart_;
  uart.baud = host_.baud().value_or(uart.baud);
  return uart;
}

void FrameDevice::poll_message(std::size_t message, FrameBuffer& out) noexcept {
  Scheduled& one = scheduled_[message];
  if (!one.is_allowed) return;
  if (!start_) {
    one.is_polled = true;
    return;
  }
  ++one.skew;
  send(one, newest_, out);
}

// A changed rate takes effect on the grid of its period since the start.
void FrameDevice::switch_messages() noexcept {
  for (Scheduled& one : scheduled_) {
    const FrameSwitch& by_settings = one.message.by_settings;
    one.is_on = by_settings.is_on(host_.values()) && host_.is_streaming();
    one.is_allowed = all_hold(by_settings.when, host_.values());
    one.is_polled &= one.is_allowed;
    one.message.layout->select(host_.values());
    if (!by_settings.rate) continue;
    const Nanoseconds chosen = by_settings.periods[host_.values()[*by_settings.rate]];
    const Nanoseconds period = chosen == FrameSwitch::each_sample ? Nanoseconds{0} : chosen;
    if (chosen.count() == 0 || period == one.message.period) continue;
    one.message.period = period;
    if (!start_) continue;
    const std::int64_t number = number_at(one, newest_.time);
    one.skew += one.number - number;
    one.number = number;
  }
}

}  // namespace imud
