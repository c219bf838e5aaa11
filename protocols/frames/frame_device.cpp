#include "protocols/frames/frame_device.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/attitude.hpp"
#include "protocols/frames/frame_layout.hpp"
#include "protocols/frames/text_layout.hpp"

namespace imud {
namespace {

// Sample times are rounded to ns, so that a sample at the begin of a period may seem to precede it.
constexpr Nanoseconds tolerance{1000};

std::shared_ptr<const MessageLayout> layout_of(const FrameDescription& description,
                                               const FrameDescription::Message& message) {
  if (message.text) return std::make_shared<TextLayout>(description, message);
  return std::make_shared<FrameLayout>(description, message);
}

}  // namespace

std::vector<FrameMessage> frame_messages(const FrameDescription& description) {
  std::vector<FrameMessage> messages;
  std::vector<FrameFault> faults;
  std::size_t bytes = 0;
  for (const FrameDescription::Message& message : description.messages) try {
      messages.push_back({message.name, message.line,
                          message.rate_hz > 0 ? nanoseconds(1 / message.rate_hz) : Nanoseconds{}, message.divider,
                          message.phases, layout_of(description, message)});
      bytes += longest_escaped(description.escape, messages.back().layout->longest());
    } catch (const FrameFaults& error) {
      faults.insert(faults.end(), error.faults.begin(), error.faults.end());
    }
  if (faults.empty() && (messages.empty() || messages.size() > FrameDescription::most_messages))
    faults.push_back({1, "message", "describe 1 to 64 messages, each as [[message]]"});
  if (faults.empty() && bytes > FrameBuffer::max_bytes)
    faults.push_back({1, "message",
                      "all messages together have " + std::to_string(bytes) + " bytes; with one sample at most " +
                          std::to_string(FrameBuffer::max_bytes) + " can be sent"});
  if (!faults.empty()) throw FrameFaults(description.file, std::move(faults));
  return messages;
}

FrameDevice::FrameDevice(std::vector<FrameMessage> messages, const FrameDescription& description,
                         const UartSettings& uart)
    : uart_(uart), starting_(description.start), escape_(description.escape) {
  for (FrameMessage& message : messages) {
    scheduled_.push_back({.message = std::move(message)});
    const MessageLayout& layout = *scheduled_.back().message.layout;
    scheduled_.back().carried.resize(layout.carries());
    if (escape_ != FrameEscape::none) content_.resize(std::max(content_.size(), layout.longest()));
  }
}

void FrameDevice::power_on(DeviceTime now) noexcept {
  powered_ = now;
  start_.reset();
}

void FrameDevice::step_clock(Nanoseconds by) noexcept {
  powered_ = powered_ + by;
  if (start_) start_ = *start_ + by;
  for (Scheduled& one : scheduled_) one.sent = one.sent + by;
}

void FrameDevice::restart(DeviceTime now) noexcept {
  start_ = now;
  samples_ = 0;
  frames_ = 0;
  for (Scheduled& one : scheduled_) {
    one.number = -1;
    one.sent = now;
    one.delta_angle.setZero();
    one.delta_velocity.setZero();
    one.rotation.setIdentity();
    std::ranges::fill(one.carried, 0);
  }
}

// Returns the number of the message that was due last.
std::int64_t FrameDevice::number_at(const Scheduled& one, DeviceTime now) const noexcept {
  if (one.message.period.count() != 0) return (now - *start_ + tolerance) / one.message.period;
  const std::vector<std::uint64_t>& phases = one.message.phases;
  const auto samples = static_cast<std::uint64_t>(samples_);
  const auto sent = std::ranges::upper_bound(phases, samples % one.message.divider) - phases.begin();
  const auto rounds = static_cast<std::int64_t>(samples / one.message.divider);
  return rounds * static_cast<std::int64_t>(phases.size()) + sent - 1;
}

void FrameDevice::sample(const Sample& sample, FrameBuffer& out) noexcept {
  constexpr double largest_turn = 1e4;            // rad; sine and cosine of larger angles are not defined
  constexpr std::uint64_t longest_gap = 1 << 30;  // samples; more is no gap
  if (sample.time - powered_ < starting_.silent) return;
  if (!start_) {
    restart(sample.time);
  } else {
    const std::uint64_t steps = sample.counter - counter_;
    samples_ += steps == 0 || steps > longest_gap ? 1 : static_cast<std::int64_t>(steps);
  }
  counter_ = sample.counter;
  for (Scheduled& one : scheduled_) {
    if (one.message.layout->has_increments()) {
      one.delta_angle += sample.delta_angle;
      one.delta_velocity += sample.delta_velocity;
      const Vector3 turn = sample.delta_angle.cwiseMax(-largest_turn).cwiseMin(largest_turn);
      one.rotation = (one.rotation * exp(turn)).normalized();
    }
    const std::int64_t number = number_at(one, sample.time);
    if (number <= one.number) continue;
    one.number = number;
    send(one, sample, out);
  }
}

void FrameDevice::send(Scheduled& one, const Sample& sample, FrameBuffer& out) noexcept {
  const MessageLayout& layout = *one.message.layout;
  const bool is_escaped = escape_ != FrameEscape::none;
  const std::size_t longest = longest_escaped(escape_, layout.longest());
  const std::span<std::byte> room = out.room(longest);
  if (room.size() != longest) return;
  const MessageLayout::State state{static_cast<std::uint64_t>(one.number), frames_++,
                                   sample.time - powered_ < starting_.until};
  const auto [size, saturated] =
      layout.encode({sample, one.delta_angle, one.delta_velocity, one.rotation, seconds(sample.time - one.sent)},
                    state, one.carried, is_escaped ? std::span(content_) : room);
  saturated_ += saturated;
  out.push(is_escaped ? escape_frame(escape_, std::span(content_).first(size), room) : size);
  one.sent = sample.time;
  one.delta_angle.setZero();
  one.delta_velocity.setZero();
  one.rotation.setIdentity();
}

}  // namespace imud
