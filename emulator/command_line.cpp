#include "emulator/command_line.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/igrf.hpp"
#include "emulator/config.hpp"
#include "emulator/line_load.hpp"
#include "emulator/run.hpp"
#include "emulator/selftest.hpp"
#include "transports/port.hpp"
#include "transports/pty_keeper.hpp"

namespace imud {

namespace {

struct Arguments {
  std::string config;
  std::string capture;
  std::string name;
  bool fast = false;
  std::vector<std::string> overrides;
  std::vector<std::string> limits;  // as on the command line
  RunOptions run;
};

std::string clock_word(ClockMode clock) {
  return clock == ClockMode::realtime ? "realtime" : clock == ClockMode::lockstep ? "lockstep" : "fast";
}

int check(const Arguments& arguments) {
  const Config config = load_config(arguments.config, arguments.overrides);
  fmt::print("{}: good\n", arguments.config);
  fmt::print("{:<8} seed {}, clock {}\n", "run", config.seed, clock_word(config.clock));
  fmt::print("{:<8} {} from {}\n", "truth", config.truth.format->name, config.truth.port);
  const EarthModel& earth = config.imus.front().model.earth;  // the same for all
  if (earth.frame != EarthModel::Frame::none && decimal_year(earth.start_gps_ns) > igrf14_end)
    fmt::print("{:<8} warning: IGRF-14 ends in {}; the magnetic field at `start` is extrapolated\n", "earth",
               igrf14_end);
  for (const ImuConfig& imu : config.imus) {
    const LineLoad load = line_load(imu);
    fmt::print("{:<8} {} at {} Hz to {}: {}\n", imu.name, imu.protocol->name, imu.rate_hz, imu.port, load.text());
    if (!imu.second_port.empty())
      fmt::print("{:<8} second port {}: {}\n", "", imu.second_port, line_load(imu, 1).text());
    if (load.percent > 70.0 && imu.protocol->link == Link::can)
      fmt::print("{:<8} warning: above 70 % a CAN bus delays frames of low priority\n", "");
    if (imu.before_first == BeforeFirst::rest) fmt::print("{:<8} samples a vehicle at rest until truth comes\n", "");
  }
  return 0;
}

template <class Table>
void list_table(const char* title, const Table& table) {
  fmt::print("{}\n", title);
  for (const auto* entry : table) fmt::print("  {:<12} {} [{}]\n", entry->name, entry->summary, entry->document);
}

// Prints the keys of [imu.device] or [truth] that only this entry has.
template <class Entry>
void list_settings(const Entry& entry) {
  fmt::print("{}: {}\n", entry.name, entry.summary);
  if (entry.settings.empty()) fmt::print("  no settings of its own\n");
  for (const Setting& setting : entry.settings) {
    std::string initial = std::visit(
        [](const auto& value) -> std::string {
          using Value = std::decay_t<decltype(value)>;
          if constexpr (std::is_same_v<Value, std::string_view>)
            return fmt::format("\"{}\"", value);
          else if constexpr (std::is_same_v<Value, std::span<const std::string_view>>)
            return fmt::format("[{}]", fmt::join(value, ", "));
          else
            return fmt::format("{}", value);
        },
        setting.initial);
    if (!setting.choices.empty()) initial += fmt::format("; one of {}", fmt::join(setting.choices, ", "));
    if (setting.min != setting.max) initial += fmt::format("; {} to {}", setting.min, setting.max);
    fmt::print("  {:<24} {} ({})\n", setting.key, setting.help, initial);
  }
}

int list(const std::string& name) {
  if (!name.empty()) {
    const Protocol* protocol = find_protocol(name);
    const TruthFormat* format = find_truth_format(name);
    if (protocol == nullptr && format == nullptr) {
      fmt::print(stderr, "there is no protocol and no truth format \"{}\"; see imud list\n", name);
      return 2;
    }
    if (protocol != nullptr) list_settings(*protocol);
    if (format != nullptr) list_settings(*format);
    return 0;
  }
  list_table("protocols", protocols());
  list_table("truth formats", truth_formats());
  fmt::print("transports\n");
  for (const Transport* transport : transports())
    fmt::print("  {:<12} {}; {} [{}]\n", transport->name, transport->summary, transport->syntax, transport->document);
  return 0;
}

// Holds ptys until SIGINT, SIGTERM or SIGHUP. In the background the calling process returns when they are ready.
int keep_ptys(const std::vector<std::string>& links, bool background) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
  sigprocmask(SIG_BLOCK, &signals, nullptr);
  const FileDescriptor stop(::signalfd(-1, &signals, SFD_CLOEXEC));
  std::vector<std::unique_ptr<PtyKeeper>> keepers;
  for (const std::string& link : links) {
    keepers.push_back(std::make_unique<PtyKeeper>(link));
    fmt::print("{} is held, as {}\n", link, keepers.back()->slave());
  }
  std::fflush(stdout);
  if (background && ::daemon(1, 0) != 0)
    throw std::runtime_error(fmt::format("cannot go to the background: {}", std::strerror(errno)));
  PtyKeeper::serve(keepers, stop.get());
  return 0;
}

int replay(const Arguments& arguments) {
  std::vector<std::string> overrides = arguments.overrides;
  if (arguments.fast) overrides.emplace_back("clock=fast");
  return run(load_config(arguments.config, overrides, capture_port(arguments.capture)), arguments.run);
}

}  // namespace

int command_line(int argc, const char* const* argv) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("imud"));
  spdlog::set_pattern("%H:%M:%S.%e %^%l%$ %v");
  if (std::getenv("NO_COLOR") != nullptr)
    std::static_pointer_cast<spdlog::sinks::stderr_color_sink_mt>(spdlog::default_logger()->sinks().at(0))
        ->set_color_mode(spdlog::color_mode::never);

  CLI::App app("Hardware-in-the-loop IMU emulator: truth in by UDP, IMU packets out on a serial line or a CAN bus.");
  app.name("imud");
  app.set_version_flag("--version", std::string("imud ") + IMUD_VERSION);
  app.require_subcommand(1);
  Arguments arguments;

  const auto with_set = [&](CLI::App* command) {
    command
        ->add_option("--set", arguments.overrides,
                     "Override a key, such as imu.0.rate_hz=400, or a list, such as "
                     "'imu.0.device.sensor_fields=[\"rate\", \"acceleration\"]'; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    command->set_version_flag("--version", std::string("imud ") + IMUD_VERSION);
  };
  const auto with_config = [&](CLI::App* command) {
    command->add_option("CONFIG", arguments.config, "Configuration, TOML")->required();
    with_set(command);
  };
  const auto with_run = [&](CLI::App* command) {
    with_config(command);
    command->add_option("--for", arguments.run.duration_s, "End after this many seconds")
        ->type_name("SECONDS")
        ->check([](const std::string& text) {
          double value = 0;
          const bool good = CLI::detail::lexical_cast(text, value) && value >= 1e-3 && value <= 1e9;
          return good ? std::string() : "give seconds from 0.001 to 1e9";
        });
    command->add_option("--summary", arguments.run.summary_file, "Also write the closing summary as JSON")
        ->type_name("FILE");
    command
        ->add_option("--require", arguments.limits,
                     "Exit with 3 if a figure of the summary breaks this limit, such as imu1.samples>=1000 or "
                     "truth.refused<=1%; several with commas; repeatable")
        ->type_name("LIMIT")
        ->allow_extra_args(false);
    command
        ->add_option("--log-every", arguments.run.monitor.log_every_s,
                     "Interval of the figures in the log; 0: none (10)")
        ->type_name("SECONDS")
        ->check(CLI::Range(0.0, 1e9));
    command
        ->add_option("--quality", arguments.run.monitor.quality_file,
                     "Write the figures each second as a line of JSON")
        ->type_name("FILE");
  };
  auto* run_command = app.add_subcommand("run", "Emulate until SIGINT or SIGTERM");
  with_run(run_command);
  auto* replay_command = app.add_subcommand("replay", "Emulate from a captured truth stream, to its end");
  with_run(replay_command);
  replay_command->add_option("CAPTURE", arguments.capture, "X.pcap, X.pcap?port=N, or X.csv")->required();
  replay_command->add_flag("--fast", arguments.fast, "As fast as the processor can, not in real time");
  auto* check_command = app.add_subcommand("check", "List every fault of a configuration, or show what it would run");
  with_config(check_command);
  auto* selftest_command = app.add_subcommand("selftest", "Measure the timing that this machine allows");
  bool timing = false;
  double measure_s = 2;
  selftest_command
      ->add_flag("--timing", timing,
                 "Measure wake-ups and writes to the ports (frames are sent), and list improvements")
      ->required();
  selftest_command->add_option("CONFIG", arguments.config,
                               "Configuration, TOML; without it one imu at 1 kHz to a pty");
  with_set(selftest_command);
  selftest_command->add_option("--for", measure_s, "Duration of each measurement (2)")
      ->type_name("SECONDS")
      ->check(CLI::Range(0.1, 3600.0));
  auto* list_command =
      app.add_subcommand("list", "Show protocols, truth formats and transports, or the settings of NAME");
  list_command->add_option("NAME", arguments.name, "A protocol or truth format");
  auto* pty_command = app.add_subcommand(
      "pty", "Hold pseudo-terminals, so that their clients are not hung up while imud restarts; until SIGTERM");
  std::vector<std::string> links;
  pty_command->add_option("LINK", links, "As in port = \"pty:LINK\" of the configuration")->required();
  bool background = false;
  pty_command->add_flag("--background", background, "Return as soon as the pseudo-terminals are held");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    for (const std::string& limits : arguments.limits)
      for (Requirement& limit : parse_requirements(limits)) arguments.run.required.push_back(std::move(limit));
    if (list_command->parsed()) return list(arguments.name);
    if (check_command->parsed()) return check(arguments);
    if (pty_command->parsed()) return keep_ptys(links, background);
    if (selftest_command->parsed()) {
      const Config config =
          arguments.config.empty() ? selftest_config() : load_config(arguments.config, arguments.overrides);
      return selftest_timing(config, {measure_s});
    }
    if (replay_command->parsed()) return replay(arguments);
    return run(load_config(arguments.config, arguments.overrides), arguments.run);
  } catch (const ConfigError& error) {
    fmt::print(stderr, "{}\n", error.what());
    fmt::print(stderr, "{} fault{}\n", error.faults.size(), error.faults.size() == 1 ? "" : "s");
    return 2;
  } catch (const PortError& error) {
    fmt::print(stderr, "{}: {}\n", arguments.config.empty() ? "imud" : arguments.config, error.what());
    return 2;
  } catch (const std::invalid_argument& error) {
    fmt::print(stderr, "imud: --require {}\n", error.what());
    return 2;
  } catch (const OpenError& error) {
    fmt::print(stderr, "imud: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "imud: {}\n", error.what());
    return 1;
  }
}

}  // namespace imud
