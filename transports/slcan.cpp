// A CAN adapter on a serial line that speaks the text of LAWICEL (CAN232 manual, CANUSB), and the frames of CAN FD
// that the firmware of CANable 2.0 adds. The driver slcan of Linux sends the same text; this port needs no driver.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "transports/can/can_bus.hpp"
#include "transports/can/can_dlc.hpp"
#include "transports/can/can_filters.hpp"
#include "transports/can/slcan_text.hpp"
#include "transports/port.hpp"
#include "transports/uart/uart_options.hpp"

namespace imud {

extern const Transport serial_transport;

namespace {

// The bit rates for which adapters have a command. On some adapters S7 is 750 kbit/s.
constexpr PortOption adapter_bitrate_option = {
    .key = "bitrate",
    .help = "bit rate of the bus, bit/s; without it the adapter keeps its own",
    .choices = "10000 20000 50000 83300 100000 125000 250000 500000 750000 800000 1000000"};
constexpr std::string_view bitrate_commands[] = {"S0", "S1", "S2", "S9", "S3", "S4", "S5", "S6", "S7", "S7", "S8"};
constexpr PortOption adapter_data_bitrate_option = {.key = "data_bitrate",
                                                    .help = "bit rate of the data phase, bit/s; without it no CAN FD",
                                                    .choices = "1000000 2000000 3000000 4000000 5000000"};
constexpr std::string_view data_bitrate_commands[] = {"Y1", "Y2", "Y3", "Y4", "Y5"};
constexpr PortOption slcan_options[] = {baud_option, adapter_bitrate_option, adapter_data_bitrate_option};

// Returns the command for the option's bit rate, which is one of the option's choices; empty if the option is
// absent.
std::string command(const PortSpec& spec, const PortOption& option, std::span<const std::string_view> commands) {
  const auto wanted = spec.text(option.key);
  if (!wanted) return {};
  std::size_t i = 0;
  for (std::string_view left = option.choices; left.substr(0, left.find(' ')) != *wanted; ++i)
    left.remove_prefix(left.find(' ') + 1);
  return fmt::format("{}\r", commands[i]);
}

// Returns the commands that open the channel: empty lines end a partial line in the adapter, and a channel that is
// open already has to be closed before its bit rate can be set.
std::string opening(const PortSpec& spec) {
  return "\r\r\rC\r" + command(spec, adapter_bitrate_option, bitrate_commands) +
         command(spec, adapter_data_bitrate_option, data_bitrate_commands) + "O\r";
}

void check(const PortSpec& spec, const PortSettings& settings) {
  if (settings.sends_fd && !spec.text(adapter_data_bitrate_option.key))
    throw spec.error("the device sends frames of CAN FD; give their bit rate, such as data_bitrate=2000000");
}

std::unique_ptr<Port> open_line(const PortSpec& spec, const PortSettings& settings) {
  PortSpec line = spec;
  line.options.clear();
  if (const auto baud = spec.text(baud_option.key)) line.options[std::string(baud_option.key)] = *baud;
  return serial_transport.open(line, settings.role);
}

// The serial line handles the device, its loss and its return. All frames of one send() are one frame of the line,
// so that they leave whole or not at all.
class SlcanPort final : public Port {
 public:
  SlcanPort(const PortSpec& spec, const PortSettings& settings)
      : carries_fd_(spec.text(data_bitrate_option.key).has_value()),
        opening_(opening(spec)),
        line_(open_line(spec, settings)) {
    open_channel();
  }
  ~SlcanPort() override { pass("C\r", 0); }

  void send(std::span<const Frame> frames) noexcept override {
    std::size_t size = 0, count = 0;
    for (const Frame& frame : frames) {
      const std::size_t room = std::min(text_.size() - size, max_slcan_line);
      const std::size_t written = room < max_slcan_line || (frame.can.fd && !carries_fd_)
                                      ? 0
                                      : write_slcan(frame, std::span<char, max_slcan_line>(&text_[size], room));
      if (written == 0) {
        ++counters_.dropped;
        continue;
      }
      size += written;
      ++count;
    }
    if (count == 0) return;
    if (open_channel())
      pass({text_.data(), size}, count);
    else
      counters_.dropped += count;
  }

  std::optional<Received> receive() noexcept override {
    while (true) {
      while (!chunk_.empty()) {
        const char byte = chunk_.front();
        chunk_.remove_prefix(1);
        const SlcanReader::Result result = reader_.feed(byte);
        if (const auto received = take(result)) return received;
      }
      const PortCounters before = line_->counters();
      const auto chunk = line_->receive();
      account(before, false, 0);
      open_channel();
      if (!chunk) return std::nullopt;
      arrival_ = chunk->time;
      chunk_ = {reinterpret_cast<const char*>(chunk->frame.bytes.data()), chunk->frame.bytes.size()};
    }
  }

  void flush() noexcept override {
    const PortCounters before = line_->counters();
    line_->flush();
    account(before, false, 0);
  }
  void discard_pending() noexcept override {
    const PortCounters before = line_->counters();
    line_->discard_pending();
    account(before, false, 0);
  }
  bool wants_output() const noexcept override { return line_->wants_output(); }
  bool is_drained() noexcept override {
    flush();
    return !line_->wants_output();
  }
  int descriptor() const noexcept override { return line_->descriptor(); }
  void set_filters(std::span<const CanFilter> filters) noexcept override { filters_.set(filters); }

 private:
  std::optional<Received> take(SlcanReader::Result result) noexcept {
    switch (result) {
      case SlcanReader::Result::frame:
        if (!filters_.pass(reader_.frame().can)) break;
        ++counters_.received;
        return Received{reader_.frame(), arrival_};
      case SlcanReader::Result::refusal:
        if (counters_.sent > 0) ++counters_.refused;  // adapters refuse to close a channel that is not open
        break;
      case SlcanReader::Result::malformed:
        ++counters_.not_ours;
        break;
      case SlcanReader::Result::nothing:
        break;
    }
    return std::nullopt;
  }

  // Opens the adapter's channel if the line is new. Returns false if it is not open.
  bool open_channel() noexcept {
    if (line_->state() == PortState::lost) line_->send({});  // which tries to open the line
    if (std::exchange(losses_, line_->counters().lost_count) != line_->counters().lost_count) {
      ++counters_.lost_count;
      is_open_ = false;
      chunk_ = {};
      reader_ = {};
    }
    state_ = line_->state();
    if (state_ != PortState::lost && !is_open_) is_open_ = pass(opening_, 0);
    return is_open_ && state_ != PortState::lost;
  }

  // Passes the text of `frames` frames to the line. Returns false if the text was dropped.
  bool pass(std::string_view text, std::size_t frames) noexcept {
    const PortCounters before = line_->counters();
    const Frame frame{std::as_bytes(std::span(text))};
    line_->send({&frame, 1});
    return account(before, true, frames);
  }

  // Counts the frames of the text that the line has kept in part as sent or dropped, and, if `passed`, also the
  // `frames` frames whose text was passed to the line afterwards. Returns false if the latter text was dropped.
  bool account(const PortCounters& before, bool passed, std::size_t frames) noexcept {
    std::uint64_t sent = line_->counters().sent - before.sent, dropped = line_->counters().dropped - before.dropped;
    if (is_kept_ && (sent > 0 || dropped > (passed ? 1U : 0U))) {
      is_kept_ = false;
      if (sent > 0)
        counters_.count_sent(kept_is_reply_, kept_);
      else
        counters_.dropped += kept_;
      --(sent > 0 ? sent : dropped);
    }
    if (!passed) return true;
    if (sent > 0) {
      counters_.count_sent(is_reply_, frames);
    } else if (dropped > 0) {
      counters_.dropped += frames;
    } else {
      is_kept_ = true;
      kept_ = frames;
      kept_is_reply_ = is_reply_;
    }
    return dropped == 0;
  }

  const bool carries_fd_;
  const std::string opening_;
  const std::unique_ptr<Port> line_;
  std::uint64_t losses_ = 0;  // of the line, at the last call
  bool is_open_ = false;      // the commands that open the channel were sent
  bool is_kept_ = false;      // the line has taken a text in part
  std::size_t kept_ = 0;      // the number of frames in this text
  bool kept_is_reply_ = false;
  std::string_view chunk_;  // received, and not parsed yet; the line's
  HostTime arrival_;        // of the chunk
  SlcanReader reader_;
  CanFilters filters_;
  std::vector<char> text_ = std::vector<char>(FrameBuffer::max_frames * max_slcan_line);
};

}  // namespace

extern constexpr Transport slcan_transport = {
    .name = "slcan",
    .summary = "a CAN adapter on a serial line (LAWICEL, CANable); reopened automatically after it was unplugged",
    .syntax = "slcan:/dev/ttyACM0?bitrate=500000&baud=115200&data_bitrate=2000000",
    .example = "slcan:/dev/ttyACM0?bitrate=500000",
    .document = "LAWICEL CAN232 manual; FD: CANable 2.0",
    .options = slcan_options,
    .carries_can = true,
    .keeps_datagrams = true,
    .has_path = true,
    .check = check,
    .open = open_as<SlcanPort>,
    .wire_time = can_wire_time,
};

}  // namespace imud
