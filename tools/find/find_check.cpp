#include "tools/find/find_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "protocols/protocol.hpp"
#include "tools/find/capture_kind.hpp"
#include "tools/find/field_search.hpp"
#include "tools/find/found_description.hpp"
#include "tools/input/measurement_input.hpp"
#include "tools/program.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr std::size_t most_bytes = 4 * 1024 * 1024;  // of a capture

// Keeps the bytes of a port.
class ByteCollector final : public Decoder {
 public:
  explicit ByteCollector(std::size_t most) : most_(most) {}
  void feed(const Frame& frame, MeasurementSink&) override {
    const std::size_t taken = std::min(frame.bytes.size(), most_ - bytes_.size());
    bytes_.insert(bytes_.end(), frame.bytes.begin(), frame.bytes.begin() + static_cast<std::ptrdiff_t>(taken));
  }
  void finish(MeasurementSink&) override {}
  bool is_full() const { return bytes_.size() == most_; }
  std::vector<std::byte>& bytes() { return bytes_; }

 private:
  std::size_t most_;
  std::vector<std::byte> bytes_;
};

class UntilFull final : public MeasurementReceiver {
 public:
  explicit UntilFull(const ByteCollector& collector) : collector_(collector) {}
  void on_measurement(const Measurement&) override {}
  void set_arrival(std::optional<HostTime>) override {}
  bool is_full() const override { return collector_.is_full(); }

 private:
  const ByteCollector& collector_;
};

}  // namespace

void add_find_options(CLI::App& app, FindOptions& options) {
  add(app, "--find-check", options.capture, "FILE",
      "in place of PROTOCOL and PORT: finds frames, checks, lengths and counters in the bytes of an unknown sensor, "
      "and\n"
      "prints the beginning of its description for protocol frame; FILE may be a port");
  add(app, "--turned", options.turned, "FILE",
      "with --find-check FILE, which is at rest: a second capture of the sensor while it is turned by hand about "
      "all\n"
      "axes; finds specific forces and rates by gravity")
      ->needs("--find-check");
}

std::vector<std::byte> read_capture(const std::string& capture, double for_s, std::size_t most) {
  const std::string text = capture == "-"                     ? standard_input_port(false)
                           : transport_of(capture) != nullptr ? capture
                                                              : capture_port(capture);
  const Transport* transport = transport_of(text);
  if (transport != nullptr && transport->carries_can && !transport->carries_any)
    throw std::invalid_argument(fmt::format("--find-check {}: needs a port for bytes, not for CAN frames", capture));
  const auto port = open_port(text, Role::listener);
  ByteCollector collector(most);
  UntilFull receiver(collector);
  DecodeOptions options{.program = "imu-decode"};
  options.port = text;
  options.for_s = for_s;
  receive_all(*port, collector, receiver, options);
  if (!port->end_warning().empty()) fmt::print(stderr, "imu-decode: {}: {}\n", capture, port->end_warning());
  if (const std::string other = port->other_content().empty() ? "" : std::string(port->other_content());
      !other.empty())
    fmt::print(stderr, "imu-decode: {}: {}\n", capture, other);
  return std::move(collector.bytes());
}

int find_check(const FindOptions& options, double for_s, double rate_hz, bool& running) {
  // The capture in motion comes first: most of its bytes vary, and frames are found by the bytes that do not vary.
  std::vector<std::byte> stream, rest = read_capture(options.capture, for_s, most_bytes);
  if (!options.turned.empty()) stream = read_capture(options.turned, for_s, most_bytes);
  const std::string lines = describe_lines(rest, options.capture);
  running = true;
  if (!lines.empty()) {
    std::fputs(lines.c_str(), stdout);
    return 0;
  }
  const std::optional<FrameEscape> escape = find_escape(stream.empty() ? rest : stream);
  if (escape) {
    stream = without_escape(stream, *escape);
    rest = without_escape(rest, *escape);
  }
  const std::size_t turned_bytes = stream.size();
  stream.insert(stream.end(), rest.begin(), rest.end());
  auto found = find_frames(stream, turned_bytes);
  if (!found) {
    fmt::print(
        stderr,
        "imu-decode: {}: no frame repeats in {} bytes; frames have 5 to 1024 bytes, and at least 8 of a length "
        "are needed. Was it captured at the sensor's bit rate?\n",
        options.capture, stream.size());
    return failed;
  }
  DescriptionText text{options.capture, rate_hz};
  if (escape) text.escape = *escape;
  if (!options.turned.empty()) text.source += " and " + options.turned;
  if (!(rate_hz > 0)) {
    text.rate_hz = suggested_rate(*found);
    if (text.rate_hz > 0)
      text.remarks.push_back(fmt::format(
          "A rate of {} Hz is assumed: then a clock has a usual unit. Give --rate-hz to decide it.", text.rate_hz));
  }
  if (!options.turned.empty())
    for (std::string& line : find_fields(*found, stream, turned_bytes, text.rate_hz))
      text.remarks.push_back(std::move(line));
  std::fputs(describe_frames(*found, stream, text).c_str(), stdout);
  return 0;
}

}  // namespace imud
