#include "emulator/commands/command_line.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/campaign/campaign_commands.hpp"
#include "emulator/commands/check.hpp"
#include "emulator/commands/command_words.hpp"
#include "emulator/commands/demo.hpp"
#include "emulator/commands/found_config.hpp"
#include "emulator/commands/help_topics.hpp"
#include "emulator/commands/keep_ptys.hpp"
#include "emulator/commands/list.hpp"
#include "emulator/commands/selftest.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/ground/plural.hpp"
#include "emulator/init/example.hpp"
#include "emulator/init/init.hpp"
#include "emulator/plan/config.hpp"
#include "emulator/plan/number_check.hpp"
#include "emulator/rack/rack_commands.hpp"
#include "emulator/report/log.hpp"
#include "emulator/run/run.hpp"
#include "emulator/seeds/seed_checks.hpp"
#include "emulator/seeds/seeds.hpp"
#include "emulator/truth/capture_check.hpp"
#include "emulator/watch/run_commands.hpp"
#include "transports/file/output_path.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

struct Arguments {
  std::string config;
  std::string capture;
  std::string name;
  bool fast = false;
  bool quiet = false, verbose = false;
  std::vector<std::string> overrides;
  std::vector<std::string> scenarios;
  std::vector<std::string> limits;  // as on the command line
  RunOptions run;
  SeedsOptions seeds;
  // The options of each command that name a file to be written.
  struct Output {
    const CLI::App* command;
    std::string option;
    std::string* path;
  };
  std::vector<Output> outputs;
};

// Adds an option, whose value is called `unit` in the help.
template <class Value>
CLI::Option* add(CLI::App& command, const std::string& name, Value& value, const std::string& unit,
                 const std::string& help) {
  return command.add_option(name, value, help)->type_name(unit);
}

// Collects the files that the command writes.
void collect_outputs(Arguments& arguments) {
  for (const Arguments::Output& output : arguments.outputs) {
    if (!output.command->parsed() || output.path->empty()) continue;
    if (is_standard_output(*output.path)) *output.path = "-";
    arguments.run.outputs.push_back({output.option, *output.path});
  }
}

int replay(const Arguments& arguments) {
  std::vector<std::string> overrides = arguments.overrides;
  const bool has_workers = arguments.seeds.seeds || arguments.seeds.jobs > 0 || !arguments.seeds.npy.empty();
  if (has_workers) refuse_single_run_options(arguments.run);
  if (arguments.fast || has_workers) overrides.emplace_back("clock=fast");
  RunOptions options = arguments.run;
  options.repeats = CapturePort(arguments.capture, arguments.config).repeats;
  if (options.repeats && !options.record.file.empty())
    throw PortError("--record: a repeated run has the record that it is repeated from; omit --record");
  const Config config = load_replay(arguments.config, overrides, arguments.capture, arguments.scenarios).config;
  return has_workers ? replay_seeds(config, options, arguments.seeds) : run(config, options);
}

// Prints a fault. If the cause is too many open files, also prints how to permit more.
void print_fault(std::string_view text) {
  std::fputs(fmt::format("{}\n", text).c_str(), stderr);  // fmt::print would throw
  rlimit files{};
  if (text.find(std::strerror(EMFILE)) == text.npos || ::getrlimit(RLIMIT_NOFILE, &files) != 0) return;
  std::fputs(
      fmt::format("imud may have {0} files open (ulimit -n); permit more by `ulimit -n {1}` or, in a systemd unit, "
                  "LimitNOFILE={1}\n",
                  files.rlim_cur, 4 * files.rlim_cur)
          .c_str(),
      stderr);
}

int execute(int argc, const char* const* argv) {
  set_up_log();
  CLI::App app("Hardware-in-the-loop IMU emulator: truth in by UDP, IMU packets out on a serial line or a CAN bus.");
  app.name("imud");
  app.set_version_flag("--version", std::string("imud ") + IMUD_VERSION);
  app.require_subcommand(1);
  Arguments arguments;
  std::uint64_t record_max_mb = 0;
  if (std::find(argv, argv + argc, std::string_view("--version")) != argv + argc) {  // of any command
    fmt::print("imud {}\n", IMUD_VERSION);
    return 0;
  }
  // Commands with many options have them only if their names are given, or `help` may look for a word in them: to
  // make them takes a tenth of a start.
  const std::vector<std::string> given = command_words(argc, argv);
  const bool is_help = argc > 1 && std::string_view(argv[1]) == "help";
  const auto has_options = [&](const char* command) {
    return is_help || std::ranges::find(given, command) != given.end();
  };

  const auto is_given = [](const std::string& text) { return text.empty() ? "give a file" : std::string(); };
  const auto with_set = [&](CLI::App* command) {
    add(*command, "--set", arguments.overrides, "KEY=VALUE",
        "Override a key, such as imu.0.rate_hz=400, or a list, such as "
        "'imu.0.device.sensor_fields=[\"rate\", \"acceleration\"]'; repeatable")
        ->allow_extra_args(false);
  };
  const auto with_config = [&](CLI::App* command, bool is_found) {
    std::string help = "Configuration, TOML, or a record, for that of its run";
    if (is_found) help += " (./imud.toml, $XDG_CONFIG_HOME/imud/imud.toml or /etc/imud/imud.toml)";
    command->add_option("CONFIG", arguments.config, help)->required(!is_found)->check(is_given);
    with_set(command);
  };
  const auto with_scenario = [&](CLI::App* command) {
    add(*command, "--scenario", arguments.scenarios, "FILE",
        "Also take the [[fault]] and [[expect]] of this file; repeatable")
        ->allow_extra_args(false);
  };
  const auto with_require = [&](CLI::App* command) {
    add(*command, "--require", arguments.limits, "LIMIT",
        "Exit with 3 if a figure of the summary breaks this limit, such as imu1.samples>=1000 or "
        "truth.refused<=1%; several with commas; repeatable")
        ->allow_extra_args(false);
  };
  const auto with_output = [&](CLI::App* command, const std::string& option, std::string& path,
                               const std::string& help) {
    add(*command, option, path, "FILE", help)->check(is_given);
    arguments.outputs.push_back({command, option, &path});
  };
  const auto with_run = [&](CLI::App* command, bool is_found) {
    with_config(command, is_found);
    add(*command, "--for", arguments.run.duration_s, "SECONDS",
        "End after this many seconds; with --wait-for-reader, after the readers have come")
        ->check(number_check(1e-3, 1e9));
    with_output(command, "--summary", arguments.run.summary_file, "Also write the closing summary as JSON");
    with_require(command);
    with_scenario(command);
    with_output(command, "--labels", arguments.run.labels_file,
                "Write what failed, and on which samples: as CSV, or as JSON if the name ends with .json");
    with_output(command, "--junit", arguments.run.junit_file, "Write whether each [[expect]] holds as JUnit XML");
    add(*command, "--log-every", arguments.run.monitor.log_every_s, "SECONDS",
        "Interval of the figures in the log; 0: none (10)")
        ->check(number_check(0, 1e9));
    with_output(command, "--quality", arguments.run.monitor.quality_file,
                "Write the figures each second as a line of JSON");
    add(*command, "--ready-fd", arguments.run.ready_fd, "N",
        "Write \"ready\" and a line feed to this open descriptor when the ports are open, and close it")
        ->check([](const std::string& text) {
          int value = 0;
          constexpr int first = 3;  // after the standard streams
          const bool good = CLI::detail::lexical_cast(text, value) && value >= first && ::fcntl(value, F_GETFD) != -1;
          return good ? std::string() : "give a descriptor from 3 that is open";
        });
    command->add_flag("--wait-for-reader", arguments.run.wait_for_reader,
                      "Begin when the pty of each imu has a reader");
    with_output(command, "--record", arguments.run.record.file,
                "Record truth, frames and the hosts' bytes as pcapng, which Wireshark opens and replay repeats");
    add(*command, "--record-max-mb", record_max_mb, "N",
        "Begin another file of the record, FILE-00001.pcapng and so on, after this many MB")
        ->check(CLI::Range(1, 1'000'000));
    add(*command, "--record-files", arguments.run.record.max_files, "N",
        "Keep only the last N files of the record; needs --record-max-mb")
        ->check(CLI::Range(1, 1'000'000));
    auto* quiet = command->add_flag("-q,--quiet", arguments.quiet, "Log warnings and errors only");
    command->add_flag("-v,--verbose", arguments.verbose, "Log details, too")->excludes(quiet);
  };
  const auto with_replay = [&](CLI::App* command) {
    with_run(command, false);
    command
        ->add_option("CAPTURE", arguments.capture,
                     "X.pcap, X.pcap?port=N, or a file of any name with records of truth.format, X.csv; each may be "
                     "compressed, X.pcap.gz or X.csv.zst; - is standard input; or a record, whose run is repeated "
                     "(its truth alone as record:X.pcapng)")
        ->required()
        ->check(is_given);
    command->add_flag("--fast", arguments.fast, "As fast as the processor can, not in real time");
    command
        ->add_option_function<std::string>(
            "--seeds", [&](const std::string& text) { arguments.seeds.seeds = SeedRange::parse(text); },
            "Replay --fast once for each seed, in processes that share the cores; the imus' ports have {seed} in "
            "their names, such as file:imu1_{seed}.bin")
        ->type_name("FIRST..LAST")
        ->check([](const std::string& text) {
          return SeedRange::parse(text) ? std::string()
                                        : "give a seed or a range of at most ten million, such as 1..1000";
        });
    add(*command, "--threads", arguments.run.threads, "N",
        "Threads of one replay with --fast: with 2 the frames are made, with 3 the capture is decoded beside the "
        "model, too; the bytes are the same (3; on one processor 1)")
        ->check(CLI::Range(1U, 3U));
    add(*command, "--jobs", arguments.seeds.jobs, "N",
        "Processes for the seeds and, if they are more than those, for the imus (the processors)")
        ->check(CLI::Range(1, 1024));
    add(*command, "--npy", arguments.seeds.npy, "FILE",
        "Open no port, and write the measurements as an array of (seeds, measurements), and the truth at "
        "them; {imu} in the name is the imu's")
        ->check(is_given);
  };
  auto* run_command = app.add_subcommand("run", "Emulate until SIGINT or SIGTERM");
  if (has_options("run")) with_run(run_command, true);
  auto* replay_command = app.add_subcommand("replay", "Emulate from a captured truth stream, to its end");
  if (has_options("replay")) with_replay(replay_command);
  auto* check_command = app.add_subcommand("check", "List every fault of a configuration, or show what it would run");
  with_config(check_command, true);
  check_command
      ->add_option("CAPTURE", arguments.capture,
                   "Check the replay of this capture: also whether it has truth, and whether each fault begins "
                   "before it ends")
      ->check(is_given);
  with_require(check_command);
  with_scenario(check_command);
  CheckLayout layout = CheckLayout::text;
  check_command->add_flag_callback(
      "--toml", [&] { layout = CheckLayout::toml; }, "Print only the configuration, with the value of every key");
  check_command->add_flag_callback(
      "--json", [&] { layout = CheckLayout::json; }, "Print configuration, loads, warnings and faults as JSON");
  auto* selftest_command = app.add_subcommand("selftest", "Measure the timing that this machine allows");
  bool timing = false;
  double measure_s = 2;
  selftest_command->add_flag("--timing", timing,
                             "Measure wake-ups and writes to the ports (frames are sent), and list improvements: "
                             "also without this option");
  selftest_command->add_option("CONFIG", arguments.config,
                               "Configuration, TOML; without it one imu at 1 kHz to a pty");
  with_set(selftest_command);
  add(*selftest_command, "--for", measure_s, "SECONDS", "Duration of each measurement (2)")
      ->check(number_check(0.1, 3600));
  auto* list_command = app.add_subcommand("list",
                                          "Show protocols, truth formats, transports and presets, or what NAME has; "
                                          "faults: kinds of faults; checks: checks of frames");
  list_command->add_option("NAME", arguments.name, "A protocol, truth format, transport or preset");
  bool json = false;
  list_command->add_flag("--json", json, "As JSON");
  auto* example_command = app.add_subcommand("example", "Print a commented configuration with NAME");
  example_command->add_option("NAME", arguments.name, "A protocol, truth format, transport or preset")->required();
  bool only_model = false;
  example_command->add_flag("--model", only_model, "Print only the errors of the preset NAME, to be copied");
  auto* pty_command = app.add_subcommand(
      "pty", "Hold pseudo-terminals, so that their clients are not hung up while imud restarts; until SIGTERM");
  std::vector<std::string> links;
  pty_command
      ->add_option("LINK", links, "As in port = \"pty:LINK\" of the configuration; or pty:LINK?mode=0660&group=NAME")
      ->required();
  bool background = false;
  pty_command->add_flag("--background", background, "Return as soon as the pseudo-terminals are held");

  DemoOptions demo_options;
  const CLI::App* demo_command = add_demo_command(app, demo_options);
  InitOptions init_options;
  const CLI::App* init_command = add_init_command(app, init_options);

  RunCommands run_commands(app);
  CampaignCommands campaign_commands(app, has_options("campaign"));
  RackCommands rack_commands(app, has_options("rack"));

  app.add_subcommand("help", "Show the help of imud, that of a command, or what is known of a key or a word")
      ->add_option("TOPIC",
                   "A command, a key of the configuration, a name that `imud list` shows, or any word; "
                   "without it the help of imud is shown");
  app.footer(
      "Example: imud check imu.toml && imud run imu.toml --for 10\n"
      "Every key: imud.toml(5), or emulator/CONFIGURATION.md in the source and, installed, in share/imud");

  if (given.size() == 2 && is_help && is_topic(app, argv[2])) return help_topic(app, argv[2]);
  if (const std::string fault = unknown_command(app, given); !fault.empty()) {
    fmt::print(stderr, "imud: {}\n", fault);
    return 2;
  }
  try {
    app.parse(std::vector<std::string>(given.rbegin(), given.rend()));  // as CLI11 takes a vector
  } catch (const CLI::ParseError& error) {
    const auto code = static_cast<CLI::ExitCodes>(error.get_exit_code());
    if (const std::string fault = unknown_option(app, given);
        !fault.empty() && (code == CLI::ExitCodes::ExtrasError || code == CLI::ExitCodes::RequiredError)) {
      fmt::print(stderr, "imud: {}\n", fault);
      return 2;
    }
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (arguments.quiet || arguments.verbose) set_up_log(arguments.quiet ? LogLevel::quiet : LogLevel::verbose);
  try {
    for (const std::string& limits : arguments.limits)
      for (Requirement& limit : parse_requirements(limits)) arguments.run.required.push_back(std::move(limit));
    collect_outputs(arguments);
    if (arguments.config.empty() && (run_command->parsed() || check_command->parsed()))
      arguments.config = found_config();
    arguments.run.config_file = arguments.config;
    arguments.run.record.max_bytes = 1'000'000 * record_max_mb;
    if (arguments.run.record.file == "-" && record_max_mb > 0)
      throw OpenError("--record-max-mb: standard output is one file; give --record FILE");
    if (arguments.run.record.file.empty() && record_max_mb > 0)
      throw OpenError("--record-max-mb: needs --record FILE");
    if (record_max_mb == 0 && arguments.run.record.max_files > 0)
      throw OpenError("--record-files: needs --record-max-mb");
    if (list_command->parsed()) return list(arguments.name, json);
    if (example_command->parsed()) return only_model ? example_model(arguments.name) : example(arguments.name);
    if (check_command->parsed()) {
      const CapturePort capture(arguments.capture, arguments.config);
      return check(arguments.config, arguments.overrides,
                   {layout, arguments.run.required, arguments.scenarios, capture.port, capture.repeats});
    }
    if (demo_command->parsed()) return demo(demo_options);
    if (init_command->parsed()) return init(init_options);
    if (const std::optional<int> exit_code = run_commands.execute()) return *exit_code;
    if (const std::optional<int> exit_code = campaign_commands.execute()) return *exit_code;
    if (const std::optional<int> exit_code = rack_commands.execute()) return *exit_code;
    if (pty_command->parsed()) return keep_ptys(links, background);
    if (selftest_command->parsed()) {
      const Config config =
          arguments.config.empty() ? selftest_config() : load_config(arguments.config, arguments.overrides);
      return selftest_timing(config, {measure_s});
    }
    arguments.seeds.quiet = arguments.quiet;
    if (replay_command->parsed()) return replay(arguments);
    const auto read = [&arguments] {
      Config config = load_config(arguments.config, arguments.overrides, {}, arguments.scenarios);
      refuse_late_faults(config);
      return config;
    };
    if (arguments.config != "-") arguments.run.read_config = read;
    return run(read(), arguments.run);
  } catch (const ConfigError& error) {
    print_fault(error.what());
    print_fault(plural(error.faults.size(), "fault"));
    return 2;
  } catch (const PortError& error) {
    print_fault(fmt::format("{}: {}", arguments.config.empty() ? "imud" : arguments.config, error.what()));
    return 2;
  } catch (const RequirementError& error) {
    print_fault(fmt::format("imud: --require {}", error.what()));
    return 2;
  } catch (const OpenError& error) {
    print_fault(fmt::format("imud: {}", error.what()));
    return 2;
  } catch (const std::exception& error) {
    print_fault(fmt::format("imud: {}", error.what()));
    return 1;
  }
}

}  // namespace

int command_line(int argc, const char* const* argv) {
  open_closed_streams();
  int exit_code = 1;
  try {
    exit_code = execute(argc, argv);
  } catch (const std::exception& error) {  // of what comes before the command: help to a full disk
    print_fault(fmt::format("imud: {}", error.what()));
  }
  const int error = flush_standard_output();
  if (error == 0) return exit_code;
  print_fault(fmt::format("imud: standard output: {}", std::strerror(error)));
  return exit_code == 0 ? 1 : exit_code;
}

}  // namespace imud
