// imu-decode: decodes any protocol from any port, and reports the quality of the stream.
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <exception>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "protocols/measurement_csv.hpp"
#include "protocols/protocol.hpp"
#include "tools/number_check.hpp"
#include "tools/setting_texts.hpp"
#include "tools/stop_signal.hpp"
#include "tools/stream_report.hpp"
#include "tools/stream_statistics.hpp"
#include "tools/text_output.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/output_path.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr int failed = 1;
constexpr int wrong_command_line = 2;
constexpr int limit_broken = 3;

struct Options {
  std::string protocol;
  std::string port;
  std::vector<std::string> settings;
  std::vector<std::string> limits;
  std::string json_path;
  double for_s = std::numeric_limits<double>::infinity();
  std::uint64_t count = std::numeric_limits<std::uint64_t>::max();
  std::optional<int> ready_fd;
  bool quiet = false;
};

std::string known_protocols() {
  std::string text = "Protocols:\n";
  for (const Protocol* protocol : protocols()) {
    text += fmt::format("  {:<16} {}\n", protocol->name, protocol->summary);
    for (const Setting& setting : protocol->settings)
      text += fmt::format("  {:<16}   --set {}=...: {}\n", "", setting.key, setting.help);
  }
  return text;
}

std::string known_ports() {
  std::string text = "Ports:\n";
  for (const Transport* transport : transports())
    text += fmt::format("  {}\n  {:<16} {}\n", transport->syntax, "", transport->summary);
  return text;
}

const Protocol& protocol_for(const Options& options) {
  const Protocol* protocol = find_protocol(options.protocol);
  if (protocol == nullptr)
    throw std::invalid_argument(fmt::format("there is no protocol '{}'\n{}", options.protocol, known_protocols()));
  const std::string scheme = PortSpec::parse(options.port).scheme;
  const Transport* transport = find_transport(scheme);
  const bool wants_can = protocol->link == Link::can;
  if (transport != nullptr && transport->carries_can != wants_can)
    throw std::invalid_argument(fmt::format("{} needs a {}; {}: carries {}", protocol->name,
                                            wants_can ? "CAN port" : "port for bytes", scheme,
                                            wants_can ? "bytes" : "CAN frames"));
  return *protocol;
}

// Captures have their own time stamps, and no descriptor.
bool is_capture(const Port& port) { return port.descriptor() < 0 && port.state() == PortState::ready; }

// Returns true for a regular file, for which the time of reading has no meaning.
bool is_regular_file(const Port& port) {
  struct stat status {};
  return port.descriptor() >= 0 && ::fstat(port.descriptor(), &status) == 0 && S_ISREG(status.st_mode);
}

// Writes and counts measurements, up to the number wanted.
class Recorder final : public MeasurementSink {
 public:
  Recorder(const Protocol& protocol, const Options& options, TextOutput& csv)
      : statistics_(protocol), csv_(csv), print_(!options.quiet), wanted_(options.count) {
    if (print_) csv_.write(measurement_csv_header);
  }

  void on_measurement(const Measurement& measurement) override {
    if (is_full()) return;
    statistics_.add(measurement, arrival_);
    if (!print_) return;
    std::array<char, measurement_csv_row_max> row;
    csv_.write({row.data(), write_measurement_csv(measurement, row)});
  }

  void set_arrival(std::optional<HostTime> arrival) { arrival_ = arrival; }
  bool is_full() const { return statistics_.samples() >= wanted_; }
  StreamStatistics& statistics() { return statistics_; }

 private:
  StreamStatistics statistics_;
  TextOutput& csv_;
  const bool print_;
  const std::uint64_t wanted_;
  std::optional<HostTime> arrival_;
};

// Waits for input, for a limited time. Some descriptors are always ready without input (such as those of an interface
// that is down); they are read every 10 ms.
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
  explicit LossNotice(std::string port) : port_(std::move(port)) {}
  void update(const Port& port) {
    const bool lost = port.state() == PortState::lost;
    if (lost != lost_) fmt::print(stderr, "imu-decode: {} is {}\n", port_, lost ? "lost; waiting for it" : "back");
    lost_ = lost;
  }

 private:
  std::string port_;
  bool lost_ = false;
};

std::string_view receive_all(Port& port, Decoder& decoder, Recorder& recorder, TextOutput& csv,
                             const Options& options) {
  const bool is_live = !is_capture(port) && !is_regular_file(port);
  bool arrival_counts =
      is_capture(port);  // frames that are in a live port before the first receive() arrived earlier
  const HostTime start = host_now();
  const auto elapsed_s = [&] { return seconds(host_now() - start); };
  Waiting waiting;
  LossNotice loss(options.port);
  constexpr Nanoseconds longest_rest = std::chrono::seconds(30);
  std::optional<HostTime> stopped;
  while (true) {
    // After a signal, what has arrived at a live port is still decoded.
    if (stop_requested() && !stopped) stopped = host_now();
    if (stopped && (!is_live || stop_requested_again() || host_now() - *stopped > longest_rest)) return "signal";
    if (!csv.is_open()) return "closed output";
    if (recorder.is_full()) return "count";
    const double left_s = options.for_s - elapsed_s();
    if (left_s <= 0) return "time";

    if (const auto received = port.receive()) {
      waiting.received();
      recorder.set_arrival(arrival_counts ? std::optional(received->time) : std::nullopt);
      decoder.feed(received->frame, recorder);
      continue;
    }
    if (port.at_end()) {
      decoder.finish(recorder);
      return "end of input";
    }
    if (stopped) return "signal";
    if (is_capture(port)) continue;  // packets to other ports are skipped
    loss.update(port);
    csv.flush();
    arrival_counts = arrival_counts || is_live;
    waiting.until_ready(port, Nanoseconds(static_cast<std::int64_t>(std::min(left_s, 1.0) * 1e9)));
  }
}

int decode(const Options& options, bool& running) {
  const Protocol& protocol = protocol_for(options);
  std::vector<Requirement> required;
  for (const std::string& limits : options.limits)
    for (Requirement& limit : parse_requirements(limits)) required.push_back(std::move(limit));
  for (const Requirement& limit : required)
    StreamReport{protocol, {}, StreamStatistics(protocol), {}, {}, {}, {}, {}}.seen(limit);
  const auto decoder = protocol.make_decoder(settings_from(protocol.settings, options.settings));
  const auto port = open_port(options.port, Role::listener);
  if (options.ready_fd) {
    const FileDescriptor ready(*options.ready_fd);
    if (::write(ready.get(), "ready\n", 6) < 0)
      throw std::runtime_error(fmt::format("--ready-fd {}: {}", *options.ready_fd, std::strerror(errno)));
  }
  if (const std::string chosen = port->chosen_port(); !chosen.empty())
    fmt::print(stderr, "imu-decode: receives at {}\n", chosen);
  TextOutput csv("-");
  std::optional<TextOutput> json;
  const std::string address = options.port.substr(options.port.find(':') + 1);
  if (is_same_file(address.substr(0, address.find('?')), options.json_path))
    throw std::runtime_error(options.json_path + ": is the input; give another file");
  if (!options.json_path.empty()) json.emplace(options.json_path);

  running = true;
  Recorder recorder(protocol, options, csv);
  const std::string_view ended_by = receive_all(*port, *decoder, recorder, csv, options);
  const DecodeErrors errors = decoder->errors();
  csv.flush();
  recorder.statistics().finish();

  const StreamReport report{protocol,
                            options.port,
                            recorder.statistics(),
                            errors,
                            port->counters(),
                            std::string(port->end_warning()),
                            std::string(ended_by),
                            std::move(required)};
  std::fputs(report.text().c_str(), stderr);
  if (json) {
    json->write(report.json());
    json->flush();
    if (!json->is_open()) throw std::runtime_error(options.json_path + ": " + std::strerror(json->error()));
  }
  if (!csv.is_open() && csv.error() != EPIPE)
    throw std::runtime_error(std::string("standard output: ") + std::strerror(csv.error()));
  if (recorder.statistics().samples() == 0) {
    fmt::print(stderr, "imu-decode: no sample was decoded; does {} use this protocol ({})?\n", options.port,
               protocol.name);
    return failed;
  }
  return report.keeps_all_limits() ? 0 : limit_broken;
}

int execute(int argc, char** argv) {
  CLI::App app(
      "Decodes any protocol from any port: prints measurement CSV, and at the end rate, jitter, gaps and\n"
      "checksum failures on standard error.",
      "imu-decode");
  app.set_version_flag("--version", "imu-decode " IMUD_VERSION);
  Options options;
  app.add_option("PROTOCOL", options.protocol, "protocol of the device, see below")->required()->type_name("");
  app.add_option("PORT", options.port, "port to receive from, see below; - is standard input")
      ->required()
      ->type_name("");
  app.add_option("--set", options.settings, "a setting of the protocol; may be repeated")
      ->allow_extra_args(false)
      ->type_name("KEY=VALUE");
  app.add_option("--require", options.limits,
                 "exits with 3 if a figure of the report breaks this limit, such as gaps=0 or jitter_p99_us<500;\n"
                 "several with commas; may be repeated")
      ->allow_extra_args(false)
      ->type_name("LIMIT");
  app.add_option("--ready-fd", options.ready_fd,
                 "writes a line to this file descriptor, and closes it, when the port is open")
      ->check(number_check(1, 1023))
      ->type_name("N");
  app.add_flag("--quiet", options.quiet, "no CSV, only the report");
  app.add_option("--json", options.json_path, "also writes the report as JSON; - is standard output")
      ->type_name("FILE");
  app.add_option("--for", options.for_s, "ends after this time of the host's clock")
      ->check(number_check(0, 1e9))
      ->type_name("SECONDS");
  app.add_option("--count", options.count, "ends after this number of samples")
      ->check(number_check(1, 1e18))
      ->type_name("N");
  app.footer(fmt::format(
      "\n{}\n{}\nExit codes: 0 done, 1 failed while running or no sample decoded, 2 the command line is wrong or "
      "the port cannot be opened, 3 a limit of --require is broken.\n"
      "Example: imu-decode native pty:imu1 --for 60 > imu1.csv",
      known_protocols(), known_ports()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : wrong_command_line;
  }

  catch_stop_signals();
  const Protocol* protocol = find_protocol(options.protocol);
  const bool is_can = protocol != nullptr && protocol->link == Link::can;
  if (options.port == "-") options.port = standard_input_port(is_can, is_can);
  bool running = false;
  try {
    return decode(options, running);
  } catch (const std::exception& error) {
    fmt::print(stderr, "imu-decode: {}\n", error.what());
    return running ? failed : wrong_command_line;
  }
}

}  // namespace
}  // namespace imud

int main(int argc, char** argv) {
  const int exit_code = imud::execute(argc, argv);
  const int error = imud::flush_standard_output();
  if (error == 0) return exit_code;
  fmt::print(stderr, "imu-decode: standard output: {}\n", std::strerror(error));
  return exit_code == 0 ? imud::failed : exit_code;
}
