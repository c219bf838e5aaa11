#include "emulator/run/run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <csignal>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>
#include <thread>
#include <utility>  // Boost 1.74's Asio needs it first

#include "emulator/config/load_config.hpp"
#include "emulator/config/scenario.hpp"
#include "emulator/control/control_api.hpp"
#include "emulator/control/control_server.hpp"
#include "emulator/drive/assembly.hpp"
#include "emulator/drive/realtime_thread.hpp"
#include "emulator/engine/closing.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/record/record_pieces.hpp"
#include "emulator/record/recorder.hpp"
#include "emulator/report/log.hpp"
#include "emulator/run/readiness.hpp"
#include "emulator/run/watchdog.hpp"
#include "emulator/web/metrics.hpp"
#include "emulator/web/web_server.hpp"
#include "transports/file/output_path.hpp"

namespace imud {

namespace {

namespace asio = boost::asio;

// Calls `work` ten times a second.
class Ticker {
 public:
  Ticker(asio::io_context& io, std::function<void()> work) : timer_(io), work_(std::move(work)) { tick(); }

 private:
  void tick() {
    work_();
    timer_.expires_after(std::chrono::milliseconds(100));
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) tick();
    });
  }
  asio::steady_timer timer_;
  const std::function<void()> work_;
};

// Does the work of the sampling thread. Returns false if a reader has not read everything.
bool drive(Assembly& assembly, const Config& config, const RunOptions& options, const std::atomic<bool>& stop,
           std::atomic<std::uint64_t>& host_uses) {
  CountingHost host(host_uses);
  const bool realtime = config.clock == ClockMode::realtime;
  if (realtime)
    for (const std::string& shortfall : make_thread_realtime(config.realtime)) spdlog::warn("{}", shortfall);
  Assembly::Limits limits;
  if (is_capture(config.truth.port) && options.duration_s) limits.duration = nanoseconds(*options.duration_s);
  assembly.run(host, stop, limits);
  using namespace std::chrono_literals;
  return drain(assembly.engine(), realtime || stop ? 50ms : 2000ms);
}

RunCounters counters_of(Assembly& assembly, const Config& config, const RunControl& control,
                        const Recorder* recorder) {
  Engine& engine = assembly.engine();
  RunCounters counters{&engine.intake().counters(), &engine.quality(), {}, nullptr};
  if (engine.faults().capacity() > 0) counters.faults = &engine.faults();
  if (recorder != nullptr) counters.record = &recorder->counters();
  for (const auto& channel : engine.channels()) counters.imus.emplace_back(channel->name, &channel->counters);
  counters.control = &control.counters;
  if (epoch_of(config) != Epoch::none) counters.clock = &assembly.clock();
  return counters;
}

bool writes_to_stdout(const Config& config) {
  return std::any_of(config.imus.begin(), config.imus.end(), [](const ImuConfig& imu) {
    const auto is_stdout = [](const std::string& port) {
      const Transport* transport = transport_of(port);
      return transport != nullptr && transport->is_standard_output != nullptr &&
             transport->is_standard_output(PortSpec::parse(port));
    };
    return is_stdout(imu.port) || is_stdout(imu.second_port) ||
           std::any_of(imu.also.begin(), imu.also.end(), is_stdout);
  });
}

void log_details(const Config& config) {
  spdlog::debug("imud {}, process {}, clock {}, seed {}, configuration {}", IMUD_VERSION, ::getpid(),
                word_of(clock_words, config.clock), config.seed, config.sha256);
  spdlog::debug("truth: {} from {}", config.truth.format->name, config.truth.port);
  for (const ImuConfig& imu : config.imus)
    spdlog::debug("{}: {} at {} Hz to {}{}{}", imu.name, imu.protocol->name, imu.rate_hz, imu.port,
                  imu.second_port.empty() ? "" : " and ", imu.second_port);
  for (const ImuConfig& imu : config.imus) {
    const LogFields fields(imu.name);
    spdlog::info("{}: errors of the model {}", imu.name, imu.errors_model);
  }
}

// Returns true if standard output carries frames or JSON: then the text of the summary must not be printed there.
bool has_data_on_stdout(const Config& config, const RunOptions& options) {
  return writes_to_stdout(config) ||
         std::ranges::any_of(options.outputs, [](const RunOptions::Output& output) { return output.path == "-"; });
}

// Logs the shortfalls.
void report(const Outcome& outcome, const Summary& summary, const Config& config) {
  if (!summary.truth.warning.empty()) spdlog::warn("{}: {}", config.truth.port, summary.truth.warning);
  if (!outcome.is_complete()) spdlog::error("incomplete: {}", fmt::join(outcome.shortfalls, "; "));
  for (const Outcome::Required& limit : outcome.required)
    if (!limit.holds)
      spdlog::error("required {}, but {} is {}", limit.requirement.text, limit.requirement.figure, limit.seen_text());
  for (const Expected& one : outcome.expected)
    if (!one.holds) spdlog::error("expected {}: {}; {}", one.name, one.text, one.seen);
}

// Throws OpenError if a file of figures would overwrite another file of the run.
void check_outputs(const Config& config, const RunOptions& options) {
  FilesInUse files = config.files;
  if (writes_to_stdout(config)) files.add("-", "the port of an imu");
  for (const auto& [option, path] : options.outputs)
    if (const std::string fault = files.claim(path, "the file of " + option); !fault.empty()) throw OpenError(fault);
  for (const std::string& piece : pieces_of(options.record))
    if (const std::string fault = files.claim(piece, "a file of --record"); !fault.empty()) throw OpenError(fault);
}

std::vector<FaultLabel> labels(Engine& engine, const Config& config) {
  std::vector<std::string> imus;
  for (const ImuConfig& imu : config.imus) imus.push_back(imu.name);
  return fault_labels(engine.faults().all(), imus, engine.faults().log());
}

// Returns the labels of the engine's faults in the format that the name of their file selects.
std::string labels(Engine& engine, const Config& config, std::string_view file) {
  std::vector<FaultLabel> all = labels(engine, config);
  add_never_begun(engine.faults().configured(), all);
  const std::vector<DrawnLabel> drawn = drawn_labels(config.imus, config.seed);
  return file.ends_with(".json") ? labels_json(all, drawn) : labels_csv(all, drawn);
}

}  // namespace

int run(const Config& config, const RunOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond the limit of file sizes then fails, as on a full disk
  asio::io_context io;
  std::atomic<bool> stop = false;
  EndedBy stopped_by = EndedBy::signal;
  asio::signal_set signals(io, SIGINT, SIGTERM);
  signals.async_wait([&](const boost::system::error_code& error, int) {
    if (!error) stop = true;
  });
  for (const std::string& warning : config.warnings) spdlog::warn("{}", warning);
  check_figures(options.required, config);
  check_begins_by_host(config, options.repeats);
  check_outputs(config, options);
  if (epoch_of(config) != Epoch::none)
    if (const std::string fault = epoch_fault(config.realtime, read_clock_state()); !fault.empty())
      throw OpenError(fault);
  asio::signal_set others(io, SIGUSR1, SIGUSR2, SIGHUP);
  TextFile summary_file(options.summary_file), labels_file(options.labels_file), junit_file(options.junit_file);
  TextFile quality_file(options.monitor.quality_file);

  std::optional<RealtimeProcess> process;
  if (config.clock == ClockMode::realtime) {
    process.emplace(config.realtime);
  }
  std::optional<Recorder> recorder;
  if (!options.record.file.empty()) recorder.emplace(options.record, config.clock != ClockMode::realtime);
  RunControl control(config.imus.size());
  Assembly assembly(config, real_ports,
                    {.repeats = options.repeats,
                     .sink = recorder ? *recorder : StepSink::none(),
                     .control = &control,
                     .threads = options.threads.value_or(usable_processors() > 1 ? 3 : 1)});
  Engine& engine = assembly.engine();
  log_details(config);
  if (const unsigned threads = assembly.threads(); threads > 1)
    spdlog::info("the replay is computed by {} threads", threads);
  const std::string instance = config.control.name.empty() ? fmt::to_string(::getpid()) : config.control.name;
  std::optional<ControlServer> server(std::in_place, io, config.control, instance);
  std::optional<WebServer> web;
  if (!config.web.listen.empty()) web.emplace(io, config.web);
  const auto chosen_ports = [&] {
    ChosenPorts all = imud::chosen_ports(engine);
    if (web && web->address() != config.web.listen) all.emplace_back("web.listen", web->address());
    return all;
  };
  const ChosenPorts chosen = chosen_ports();
  // All is open. A run that cannot begin leaves the results of the run before as they are.
  if (recorder) recorder->start(!is_capture(config.truth.port), config.resolved());
  empty_files(engine.channels());
  // The file of a killed run must not look like the file of a whole run.
  if (summary_file.is_regular()) summary_file.replace("{\"complete\": false, \"ended_by\": null}\n");
  for (TextFile* file : {&labels_file, &junit_file, &quality_file}) file->replace("");
  std::atomic<std::uint64_t> host_uses = 0;
  report_ready(chosen, options.ready_fd);
  const bool is_unpaced = config.clock != ClockMode::realtime && is_capture(config.truth.port);
  const Watchdog watchdog(io, host_uses, is_unpaced);
  if (options.wait_for_reader) wait_for_readers(engine, config, io, [&] { return stop.load(); });
  Config named = config;  // as the log shall name its ports
  for (const auto& [key, port] : chosen)
    if (key == "truth.port") named.truth.port = port;
  const RunCounters counters = counters_of(assembly, config, control, recorder ? &*recorder : nullptr);
  Monitor monitor(counters, named, options.monitor, std::move(quality_file));
  bool has_data = has_data_on_stdout(config, options);
  const auto read = [&] {
    Config next = options.read_config();
    check_outputs(next, options);
    check_new_ports(named, next);
    return next;
  };
  Reloader reloader(engine, config, named, options.read_config ? read : std::function<Config()>(), [&] {
    monitor.update_loads();
    has_data = has_data || has_data_on_stdout(named, options);
  });
  std::function<void()> reload = [] {};  // before the api there is no sample
  const std::function<void()> wait_for_others = [&] {
    others.async_wait([&](const boost::system::error_code& error, int signal) {
      if (error) return;
      if (signal == SIGUSR1) {
        engine.power_cycle.make();
        spdlog::info("SIGUSR1: power off and on for every imu");
      } else if (signal == SIGHUP) {
        monitor.reopen();
        reload();
      } else {
        spdlog::warn("SIGUSR2 is ignored");
      }
      wait_for_others();
    });
  };
  wait_for_others();
  const auto quit = [&] {
    if (stop) return;
    stopped_by = EndedBy::control;
    stop = true;
  };
  const auto clients = [&] {
    return ControlApi::Run::Clients{server ? server->clients() : 0, web ? web->connections() : 0};
  };
  ControlApi api(io, {instance, named, control, monitor, counters, quit, engine.faults(), reloader, options.repeats,
                      options.config_file.empty() || options.config_file == "-"
                          ? options.config_file
                          : std::filesystem::absolute(options.config_file).lexically_normal().string(),
                      clients, report_reloading, report_reloaded});
  reload = [&api] { api.reload(); };
  server->start(api);
  if (web) {
    const auto call = [&api](std::string_view request, std::function<void(std::string)> answer,
                             const std::shared_ptr<Subscriber>& client) {
      api.call(request, std::move(answer), client);
    };
    web->serve(
        call, [&monitor](MetricsFormat format) { return metrics(monitor.now(), format); }, control.counters);
  }
  const auto report_events = [&] {
    for (RunEvent event; control.events.pop(event);) api.report(event);
    api.report_faults();
  };
  ProgressLine progress(config.clock == ClockMode::fast && is_capture(config.truth.port) &&
                        spdlog::should_log(spdlog::level::info));
  Ticker ticker(io, [&] {
    monitor.update();
    if (const double read = counters.truth->progress; read > 0) progress.show(read, "the capture");
    report_events();
    reloader.update();
  });
  asio::steady_timer end(io);
  if (options.duration_s && !is_capture(config.truth.port)) {
    end.expires_after(nanoseconds(*options.duration_s));
    end.async_wait([&](const boost::system::error_code& error) {
      if (error || stop) return;
      stopped_by = EndedBy::duration;
      stop = true;
    });
  }

  std::exception_ptr failure;
  bool all_read = true;
  std::thread worker([&] {
    try {
      all_read = drive(assembly, config, options, stop, host_uses);
    } catch (...) {
      failure = std::current_exception();
    }
    asio::post(io, [&io] { io.stop(); });
  });
  io.run();
  progress.clear();
  report_stopping();
  worker.join();
  engine.finish_faults();
  report_events();
  api.finish();
  reloader.close_ports();
  for (const auto& channel : engine.channels()) channel->publish();
  server.reset();
  if (recorder) recorder->finish();
  if (failure) std::rethrow_exception(failure);

  EndedBy ended_by = stopped_by;
  if (is_capture(config.truth.port))
    ended_by = engine.intake().at_end() ? EndedBy::end_of_capture : stop ? stopped_by : EndedBy::duration;
  Summary summary = monitor.finish(engine.intake().end_warning());
  summary.whole = {judge(summary, config, ended_by, options.required, options.repeats), config.seed, config.sha256,
                   chosen_ports()};
  for (std::size_t i = 0; i < config.imus.size(); ++i)
    summary.imus[i].drawn =
        drawn_terms(config.imus[i].model, config.imus[i].seed.value_or(config.seed), config.imus[i].name);
  Outcome& outcome = summary.whole->outcome;
  outcome.expected = expected(engine.channels());
  const std::vector<FaultLabel> all_labels = labels(engine, config);
  outcome.judge_faults(fault_outcomes(engine.faults().configured(), all_labels), options.repeats);
  if (std::string lost = lost_text(all_labels); !lost.empty() && !options.labels_file.empty())
    outcome.shortfalls.push_back(std::move(lost));
  if (!all_read && is_capture(config.truth.port) && config.clock != ClockMode::realtime)
    outcome.shortfalls.emplace_back("a reader has not read all that was sent to it");
  if (std::string difference = assembly.difference(); !difference.empty())
    outcome.shortfalls.push_back(std::move(difference));
  if (!monitor.quality_error().empty()) outcome.shortfalls.push_back(monitor.quality_error());
  report(outcome, summary, named);
  // A result that cannot be written is a failure of the run, but the other results are written.
  const auto attempt = [&](const auto& write) {
    try {
      write();
    } catch (const std::exception& error) {
      if (!failure) failure = std::current_exception();
      outcome.ended_by = EndedBy::failure;
      outcome.shortfalls.emplace_back(error.what());
    }
  };
  if (outcome.ended_by != EndedBy::failure) attempt([&] { commit(engine.channels()); });
  if (!options.labels_file.empty())
    attempt([&] { labels_file.replace(labels(engine, config, options.labels_file)); });
  if (!options.junit_file.empty()) attempt([&] { junit_file.replace(junit_xml(outcome.expected, "imud")); });
  TextFile printed = has_data ? TextFile::standard_error() : TextFile("-");
  attempt([&] { printed.write(text(summary)); });
  // Last: it says that the run is complete.
  attempt([&] { summary_file.replace(json(summary, JsonLayout::indented)); });
  if (failure) std::rethrow_exception(failure);
  return outcome.exit_code();
}

}  // namespace imud
