#include "tools/input/measurement_input.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "core/numbers/nearest.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/plan/number_check.hpp"
#include "tools/input/log_formats.hpp"
#include "tools/program.hpp"
#include "tools/stop_signal.hpp"
#include "transports/host_clock.hpp"
#include "transports/port_spec.hpp"

namespace imud {

void DecodeOptions::resolve_port() {
  const Protocol* found = find_input_format(protocol);
  const bool is_can = found != nullptr && found->link == Link::can;
  const std::string input = standard_input_port(is_can, is_can);
  if (port == "-") port = input;
  std::error_code error;
  if (found == nullptr || port.find_first_of(":?") != port.npos || !std::filesystem::is_regular_file(port, error))
    return;
  const std::string chosen = capture_port(port);
  const Transport* transport = transport_of(chosen);
  const bool carries = transport != nullptr && (transport->carries_any || transport->carries_can == is_can);
  port = is_can && !carries ? input.substr(0, input.find(':') + 1) + port : chosen;
}

void add_input_options(CLI::App& app, DecodeOptions& options) {
  add(app, "PORT", options.port, "", "port to receive from, see below, or a file; - is standard input")->required();
  add(app, "--set", options.settings, "KEY=VALUE", "a setting of the protocol; may be repeated")
      ->allow_extra_args(false);
  app.add_option_function<std::string>(
         "--frame-file", [&options](const std::string& file) { options.settings.push_back("frame_file=" + file); },
         "protocol frame: the file that describes the frames")
      ->type_name("FILE");
  add(app, "--for", options.for_s, "SECONDS", "ends after this time of the host's clock")
      ->check(number_check(0, 1e9));
  add(app, "--count", options.count, "N", "ends after this number of samples")->check(number_check(1, 1e18));
}

void add_input_files(const DecodeOptions& options, FilesInUse& files) {
  files.add_input(options.port, "the input");
  for (const std::string& setting : options.settings) {
    const std::size_t equals = setting.find('=');
    const std::string key = setting.substr(0, equals);
    if (equals != setting.npos && key.ends_with("_file"))
      files.add(regular_file(setting.substr(equals + 1)), "the file of " + key);
  }
}

void add_model_file(const std::string& model, const std::string& option, FilesInUse& files) {
  if (model.ends_with(".toml")) files.add(regular_file(model), "the file of " + option);
}

std::string known_protocols() {
  std::string text;
  const auto list = [&](std::string_view title, std::span<const Protocol* const> all) {
    text += title;
    for (const Protocol* protocol : all) {
      text += fmt::format("  {:<16} {}\n", protocol->name, protocol->summary);
      for (const Setting& setting : protocol->settings)
        text += fmt::format("  {:<16}   --set {}=...: {}\n", "", setting.key, setting.help);
    }
  };
  list("Protocols:\n", protocols());
  text += "Protocols by a shipped description, with the settings of frame but for frame_file:\n";
  for (const DescribedTitle& title : described_titles())
    text += fmt::format("  {:<16} {}\n", title.name, title.summary);
  list("Logs, in place of a protocol:\n", log_formats());
  return text;
}

std::string known_ports() {
  std::string text = "Ports:\n";
  for (const Transport* transport : transports())
    text += fmt::format("  {}\n  {:<16} {}\n", transport->syntax, "", transport->summary);
  return text;
}

const Protocol& protocol_for(const DecodeOptions& options) {
  const Protocol* protocol = find_input_format(options.protocol);
  if (protocol == nullptr) {
    std::vector<std::string> names = protocol_names();
    for (const Protocol* one : log_formats()) names.emplace_back(one->name);
    for (const Protocol* one : protocols())
      for (const Setting& setting : one->settings)
        if (setting.key == "model" && std::ranges::find(setting.choices, options.protocol) != setting.choices.end())
          throw std::invalid_argument(
              fmt::format("{0} is a product of the protocol {1}; give {1} {2} --set model={0}", options.protocol,
                          one->name, options.port.empty() ? "PORT" : options.port));
    const std::string meant = nearest(options.protocol, names);
    throw std::invalid_argument(fmt::format("there is no protocol '{}'; {}--help lists all", options.protocol,
                                            meant.empty() ? "" : fmt::format("did you mean '{}'? ", meant)));
  }
  if (std::ranges::any_of(options.settings,
                          [](const std::string& text) { return text.starts_with("frame_file="); })) {
    if (is_described(*protocol)) throw std::invalid_argument("frame_file: " + frame_file_refusal(*protocol));
    if (std::ranges::none_of(protocol->settings, [](const Setting& one) { return one.key == "frame_file"; }))
      throw std::invalid_argument(
          fmt::format("--frame-file is for protocol frame: {} has no description", protocol->name));
  }
  const std::string scheme = PortSpec::parse(options.port).scheme;
  const Transport* transport = find_transport(scheme);
  const bool wants_can = protocol->link == Link::can;
  if (transport != nullptr && !transport->carries_any && transport->carries_can != wants_can)
    throw std::invalid_argument(fmt::format("{} needs a {}; {}: carries {}", protocol->name,
                                            wants_can ? "CAN port" : "port for bytes", scheme,
                                            wants_can ? "bytes" : "CAN frames"));
  return *protocol;
}

namespace {

// Captures have their own time stamps, and no descriptor.
bool is_capture(const Port& port) { return port.descriptor() < 0 && port.state() == PortState::ready; }

// Returns true for a regular file, for which the time of reading has no meaning.
bool is_regular_file(const Port& port) {
  struct stat status {};
  return port.descriptor() >= 0 && ::fstat(port.descriptor(), &status) == 0 && S_ISREG(status.st_mode);
}

// Waits for input, for a limited time. Some descriptors are always ready without input, as for an interface that is
// down; they are read every 10 ms.
class Waiting {
 public:
  void until_ready(const Port& port, Nanoseconds longest) {
    using namespace std::chrono_literals;
    const Nanoseconds pause =
        ready_without_input_ ? std::min<Nanoseconds>(longest, 10ms) : std::min<Nanoseconds>(longest, 100ms);
    const auto ms = static_cast<int>((pause + 999'999ns) / 1ms);
    pollfd descriptor{ready_without_input_ ? -1 : port.descriptor(), POLLIN, 0};
    ready_without_input_ = ::poll(&descriptor, 1, ms) > 0;
  }
  void received() { ready_without_input_ = false; }

 private:
  bool ready_without_input_ = false;
};

// Reports when a device is lost and when it is back.
class LossNotice {
 public:
  explicit LossNotice(const DecodeOptions& options) : program_(options.program), port_(options.port) {}
  void update(const Port& port) {
    const bool lost = port.state() == PortState::lost;
    if (lost != lost_) fmt::print(stderr, "{}: {} is {}\n", program_, port_, lost ? "lost; waiting for it" : "back");
    lost_ = lost;
  }

 private:
  std::string program_;
  std::string port_;
  bool lost_ = false;
};

}  // namespace

std::string_view receive_all(Port& port, Decoder& decoder, MeasurementReceiver& receiver,
                             const DecodeOptions& options) {
  const bool is_live = !is_capture(port) && !is_regular_file(port);
  bool arrival_counts =
      is_capture(port);  // frames that are in a live port before the first receive() arrived earlier
  const HostTime start = host_now();
  const auto elapsed_s = [&] { return seconds(host_now() - start); };
  Waiting waiting;
  LossNotice loss(options);
  ProgressLine progress(!is_live);
  constexpr Nanoseconds longest_rest = std::chrono::seconds(30);
  std::optional<HostTime> stopped;
  while (true) {
    // After a signal, the input waiting at a live port is still decoded.
    if (stop_requested() && !stopped) stopped = host_now();
    if (stopped && (!is_live || stop_requested_again() || host_now() - *stopped > longest_rest)) return "signal";
    if (!receiver.is_open()) return "closed output";
    if (receiver.is_full()) return "count";
    const double left_s = options.for_s - elapsed_s();
    if (left_s <= 0) return "time";

    if (const auto received = port.receive()) {
      waiting.received();
      if (progress.is_due()) progress.show(port.progress().value_or(0), options.port);
      receiver.set_arrival(arrival_counts ? std::optional(received->time) : std::nullopt);
      decoder.feed(received->frame, receiver);
      continue;
    }
    if (port.at_end()) {
      decoder.finish(receiver);
      return "end of input";
    }
    if (stopped) return "signal";
    if (is_capture(port)) continue;  // packets to other ports are skipped
    loss.update(port);
    receiver.flush();
    arrival_counts = arrival_counts || is_live;
    waiting.until_ready(port, Nanoseconds(static_cast<std::int64_t>(std::min(left_s, 1.0) * 1e9)));
  }
}

}  // namespace imud
