// FrameDevice and FrameStreamDecoder: a sensor that sends the messages of a description, and the decoder of its
// stream.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocols/frames/host/frame_host.hpp"
#include "protocols/frames/layout/frame_description.hpp"
#include "protocols/frames/layout/frame_escape.hpp"
#include "protocols/frames/layout/frame_fields.hpp"
#include "protocols/frames/layout/message_layout.hpp"
#include "protocols/measurements/collecting_decoder.hpp"
#include "protocols/measurements/message_increments.hpp"
#include "protocols/protocol.hpp"
#include "protocols/wire/frame_search.hpp"

namespace imud {

// A message and its schedule.
struct FrameMessage {
  std::string name;
  std::uint32_t line = 0;     // in the file
  Nanoseconds period = {};    // sent with the first sample of each period; 0: by the divider
  std::uint64_t divider = 1;  // sent with the samples phase + k * divider, counted from the start
  std::vector<std::uint64_t> phases = {0};
  std::shared_ptr<MessageLayout> layout;  // each unit, decoder and seal selects its own optional elements
  FrameSwitch by_settings;
};

// Returns true if both messages may be sent with the same sample.
bool may_coincide(const FrameMessage& a, const FrameMessage& b);

// Returns the highest rate at which a message may be sent, Hz; 0: the divider determines the rate.
double highest_rate_hz(const FrameDescription& description, const FrameDescription::Message& message);
// Returns the rate of the samples, Hz, for a configuration that has none: the description's rate or, if it has none,
// the highest rate of its messages if each has a rate. Returns 0 if there is no such rate.
double default_rate_hz(const FrameDescription& description);

// Returns the compiled messages. Throws FrameFaults with every fault.
std::vector<FrameMessage> frame_messages(const FrameDescription& description);

// Sends the messages that are due with each sample, in the order of the file. A message's increments are the sums
// since this message was last sent. The first sample after power on starts periods and dividers. A message may be
// switched off, by the stream or by a setting. Then it is not counted, and its increments restart whenever it is due.
class FrameDevice final : public Device, private FrameHost::Unit {
 public:
  FrameDevice(std::vector<FrameMessage> messages, const FrameDescription& description, FrameHost host,
              const UartSettings& uart);

  void power_on(DeviceTime now) noexcept override;
  void sample(const Sample& sample, FrameBuffer& out) noexcept override;
  void receive(const Frame& from_host, DeviceTime now, FrameBuffer& replies) noexcept override;
  std::optional<DeviceTime> deadline() const noexcept override { return host_.deadline(); }
  void poll(DeviceTime now, FrameBuffer& out) noexcept override;
  void step_clock(Nanoseconds by) noexcept override;
  void set_figures(const OwnFigures& figures) noexcept override { figures_ = figures; }
  UartSettings uart() const noexcept override;
  std::span<const std::uint64_t> counts() const noexcept override { return counts_; }

 private:
  struct Scheduled {
    FrameMessage message;
    std::int64_t number = -1;  // of the message that was last due
    std::int64_t skew = 0;     // alive_counter less `number`: polls, less messages that were due while switched off
    bool is_on = true;
    bool is_allowed = true;  // by its settings: a poll sends the message
    bool is_polled = false;  // polled before the first sample
    MessageIncrements increments = {};
    std::vector<double> carried = {};
  };
  Reading newest() const noexcept override { return {.sample = newest_, .figures = &figures_}; }
  void poll_message(std::size_t message, FrameBuffer& out) noexcept override;
  void switch_messages() noexcept override;
  void restart(DeviceTime now) noexcept override;

  void start(DeviceTime now) noexcept;
  void publish() noexcept;
  std::int64_t number_at(const Scheduled& one, DeviceTime now, std::int64_t ahead = 0) const noexcept;
  std::int64_t messages_ahead(const Scheduled& one, const Sample& sample) const noexcept;
  void send(Scheduled& one, const Sample& sample, FrameBuffer& out) noexcept;

  std::vector<Scheduled> scheduled_;
  FrameHost host_;
  UartSettings uart_;
  FrameDescription::Start starting_;
  FrameEscape escape_;
  std::vector<std::byte> content_;   // of a frame, before the escapes are added
  DeviceTime powered_ = {};          // power on, or the last reset
  std::optional<DeviceTime> start_;  // time of the first sample since power on
  std::uint64_t counter_ = 0;        // Sample::number() of the last sample
  std::int64_t samples_ = 0;         // since the start
  std::uint64_t frames_ = 0;         // sent since the start
  bool keeps_newest_ = false;        // requests need it
  Sample newest_;                    // if keeps_newest_ is false, only its time is set
  // Fields that saturated, in all messages, and FrameHost's counts.
  std::array<std::uint64_t, 3> counts_ = {};
  OwnFigures figures_;
};

// Finds the frames by their constants and checks, and combines the messages of a sample into a measurement. All
// messages with the highest rate must be present, in the order of the file. Other messages may be missing, and so
// may messages that settings switch, or whose phases exclude a message that is present. The measurement is
// complete when no other message can belong to it, or when the next sample begins. The bit of a vector in
// Measurement::fields is set if all components that the messages carry are present; the components
// that no message carries are NaN then. Clocks and counters are unwrapped. If the stream has no counter of samples,
// the measurement has the counter of a message. If it has no clock either, and all messages are sent with each
// sample, the measurement has the counter of all messages.
class FrameStreamDecoder final : public Decoder, public CollectingDecoder {
 public:
  // `values`: the probable values of the unit's settings. Messages that are sent with these values are tried
  // first, because other messages may have the same constants.
  FrameStreamDecoder(std::vector<FrameMessage> messages, FrameEscape escape, std::span<const FrameValue> values = {});

  void feed(const Frame& frame, MeasurementSink& sink) override;
  void finish(MeasurementSink& sink) override;
  bool holds_measurement() const noexcept override { return found_ != 0; }
  std::span<const FrameKind> frame_kinds() const noexcept { return kinds_; }
  // Passes each frame that is decoded from now on to `receiver`, even if other frames of the same sample are
  // missing; nullptr: passes no frames. Requires that `receiver` exists as long as the decoder is called.
  void pass_frames_to(FrameReceiver* receiver) noexcept { receiver_ = receiver; }
  // Reads the fields of a frame during FrameReceiver::on_frame(). `values`: one element for each name of the
  // frame's kind.
  void read_fields(const DecodedFrame& frame, std::span<FieldValue> values) const noexcept {
    known_[frame.kind].message.layout->read_fields(frame.bytes, values);
  }

 private:
  using Search = FrameSearch<FrameDescription::longest_frame>;
  using Wrapping = MessageLayout::Wrapping;
  // Unwraps a clock or a counter.
  class Continued {
   public:
    // Returns the unwrapped number that is nearest to the last number. Unless `may_go_back`, as for a short counter,
    // returns the next number that is not less than the last one.
    std::uint64_t next(const Wrapping& read, bool may_go_back) noexcept;

   private:
    std::optional<std::uint64_t> last_;
  };
  struct Known {
    FrameMessage message;
    bool is_needed = false;
    std::uint64_t partners = 0;  // bits of the messages that may be sent with the same sample
  };

  std::size_t parse(std::span<const std::byte> held, MeasurementSink& sink);
  void take_content(MeasurementSink& sink);
  bool accept(const DecodedFrame& frame, MeasurementSink& sink);
  void begin() noexcept;
  void end(MeasurementSink& sink);
  void choose_clocks();

  std::vector<Known> known_;
  std::vector<FrameKind> kinds_;  // in the order of known_
  FrameReceiver* receiver_ = nullptr;
  std::vector<std::size_t> order_;  // the messages in the order in which they are tried
  std::uint32_t components_ = 0;    // carried by all messages together
  // Bits of the messages whose clock, counter of samples, own counter, and counter of all messages are read.
  std::uint64_t clocks_ = 0, counters_ = 0, alive_counters_ = 0, frame_counters_ = 0;
  Continued time_, count_;

  Search search_;
  FrameEscape escape_;
  EscapeReader reader_;
  std::uint64_t offset_ = 0;    // bytes before the held bytes; of escaped frames: bytes that were read
  ReadBack set_;                // the sample that is being collected
  std::uint64_t found_ = 0;     // bits of the sample's messages so far
  std::uint64_t partners_ = 0;  // bits of the messages that may still belong to the sample
};

}  // namespace imud
