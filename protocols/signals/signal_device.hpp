// SignalDevice and SignalDecoder: a product that sends CAN messages described by tables, and the decoder of its
// messages.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "protocols/measurements/collecting_decoder.hpp"
#include "protocols/measurements/message_increments.hpp"
#include "protocols/protocol.hpp"
#include "protocols/signals/can_signals.hpp"

namespace imud {

// A message and its schedule.
struct SignalMessage {
  CanHeader can;
  Nanoseconds period = {};  // 0: with every sample; otherwise with the first sample of each period
  CanSignalCodec codec;
};

// Returns the rate of a message, Hz, where `rate_hz` is the sample rate.
double rate_of(const SignalMessage& message, double rate_hz) noexcept;

// Sends the messages that are due with each sample, in the order of the table. A message's increments are the sums
// since that message was last sent. The first sample after power on sends every message, and starts the periods.
class SignalDevice final : public Device {
 public:
  // Throws std::invalid_argument if there are more messages than FrameBuffer::max_frames.
  explicit SignalDevice(std::vector<SignalMessage> messages);

  void power_on(DeviceTime now) noexcept override;
  void sample(const Sample& sample, FrameBuffer& out) noexcept override;
  void step_clock(Nanoseconds by) noexcept override;
  void set_figures(const OwnFigures& figures) noexcept override { figures_ = figures; }
  std::span<const std::uint64_t> counts() const noexcept override { return {&saturated_, 1}; }

 private:
  struct Scheduled {
    SignalMessage message;
    bool has_increments = false;
    std::uint64_t count = 0;  // number of the message, which determines alive counter and multiplexors
    std::int64_t period = 0;  // the number of the period in which it was last sent
    MessageIncrements increments = {};
  };
  // Returns true if the message is due, and counts it.
  bool is_due(Scheduled& one, DeviceTime now, std::uint64_t steps) const noexcept;
  void send(Scheduled& one, const Sample& sample, FrameBuffer& out) noexcept;

  std::vector<Scheduled> scheduled_;
  std::optional<DeviceTime> start_;  // time of the first sample since power on
  std::uint64_t counter_ = 0;        // Sample::number() of the last sample
  std::uint64_t saturated_ = 0;      // signals, in all messages
  OwnFigures figures_;
};

// Returns the seal of the messages, which lets all bytes of a message change; nullptr if no message has a
// checksum.
std::unique_ptr<FrameSeal> seal_of(std::vector<SignalMessage> messages);

// Combines the messages of a sample into a measurement. All messages that are sent with every sample must be
// present, in the order of the table, and their sample counters must agree; other messages may be missing. The
// measurement is complete with the last message of the table, or when the next sample begins. The bit of a vector
// in Measurement::fields is set if all components that the messages carry are present; the components
// that no message carries are NaN then. Multiplexed signals keep their value until their next message.
class SignalDecoder final : public Decoder, public CollectingDecoder {
 public:
  explicit SignalDecoder(std::vector<SignalMessage> messages);

  void feed(const Frame& frame, MeasurementSink& sink) override;
  void finish(MeasurementSink& sink) override;
  bool holds_measurement() const noexcept override { return next_ != 0; }

 private:
  void begin() noexcept;
  void end(MeasurementSink& sink);  // of a sample: passes on its measurement, or counts it as incomplete
  bool agrees(const CanSignalCodec::LowBits& counter) const noexcept;
  void unwrap(const CanSignalCodec::Decoded& decoded) noexcept;

  std::vector<SignalMessage> messages_;
  std::uint32_t components_ = 0;  // carried by all messages together
  std::size_t needed_ = 0;        // messages that come with every sample
  Nanoseconds shortest_ = {};     // the shortest period of the messages
  bool is_multiplexed_ = false;

  ReadBack set_;
  std::size_t next_ = 0;   // the messages of the set so far precede this one in the table; 0: no set has begun
  std::size_t found_ = 0;  // how many of the needed messages the set has
  CanSignalCodec::LowBits counter_;
  std::optional<std::uint64_t> ticks_;  // the unwrapped clock, in its LSB, modulo 2^64
};

}  // namespace imud
