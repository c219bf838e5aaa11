#include "emulator/run.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <fstream>
#include <functional>
#include <memory>
#include <thread>
#include <utility>  // Boost 1.74's Asio needs it first

#include "emulator/loop.hpp"
#include "emulator/realtime_thread.hpp"

namespace imud {

namespace {

namespace asio = boost::asio;

// Calls Monitor::update() ten times a second.
class Ticker {
 public:
  Ticker(asio::io_context& io, Monitor& monitor) : timer_(io), monitor_(monitor) { tick(); }

 private:
  void tick() {
    monitor_.update();
    timer_.expires_after(std::chrono::milliseconds(100));
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) tick();
    });
  }
  asio::steady_timer timer_;
  Monitor& monitor_;
};

// The work of the sampling thread.
void drive(Session& session, const Config& config, const RunOptions& options, const std::atomic<bool>& stop) {
  MonotonicHost host;
  const bool realtime = config.clock == ClockMode::realtime, capture = is_capture(config.truth.port);
  if (realtime)
    for (const std::string& shortfall : make_thread_realtime(config.realtime)) spdlog::warn("{}", shortfall);
  LoopOptions loop;
  if (realtime) loop.spin = config.realtime.spin;
  if (capture && options.duration_s) loop.limit = nanoseconds(*options.duration_s);
  const std::unique_ptr<Pacer> pacer = make_pacer(config, session.quality());
  Loop(session, host, *pacer, loop, stop).run();
  session.drain();
}

RunCounters counters_of(const Session& session) {
  RunCounters counters{&session.intake().counters(), &session.quality(), {}};
  for (const auto& channel : session.channels()) counters.imus.emplace_back(channel->name(), &channel->counters());
  return counters;
}

bool writes_to_stdout(const Config& config) {
  return std::any_of(config.imus.begin(), config.imus.end(), [](const ImuConfig& imu) {
    const Transport* transport = transport_of(imu.port);
    return transport != nullptr && transport->is_standard_output != nullptr &&
           transport->is_standard_output(PortSpec::parse(imu.port));
  });
}

}  // namespace

int run(const Config& config, const RunOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  asio::io_context io;
  std::atomic<bool> stop = false;
  asio::signal_set signals(io, SIGINT, SIGTERM);
  signals.async_wait([&](const boost::system::error_code& error, int) {
    if (!error) stop = true;
  });
  asio::signal_set power(io, SIGUSR1);
  std::ofstream summary_file;
  if (!options.summary_file.empty()) {
    summary_file.open(options.summary_file);
    if (!summary_file) throw std::runtime_error(fmt::format("{}: cannot be written", options.summary_file));
  }

  std::optional<RealtimeProcess> process;
  if (config.clock == ClockMode::realtime) {
    process.emplace(config.realtime);
  }
  Session session(config);
  const std::function<void()> wait_for_power = [&] {
    power.async_wait([&](const boost::system::error_code& error, int) {
      if (error) return;
      session.request_power_cycle();
      spdlog::info("SIGUSR1: power off and on for every imu");
      wait_for_power();
    });
  };
  wait_for_power();
  Monitor monitor(counters_of(session), config, options.monitor);
  Ticker ticker(io, monitor);
  asio::steady_timer end(io);
  if (options.duration_s && !is_capture(config.truth.port)) {
    end.expires_after(nanoseconds(*options.duration_s));
    end.async_wait([&](const boost::system::error_code& error) {
      if (!error) stop = true;
    });
  }

  std::exception_ptr failure;
  std::thread worker([&] {
    try {
      drive(session, config, options, stop);
    } catch (...) {
      failure = std::current_exception();
    }
    asio::post(io, [&io] { io.stop(); });
  });
  io.run();
  worker.join();
  if (failure) std::rethrow_exception(failure);

  const Summary summary = monitor.finish(session.intake().end_warning());
  if (!summary.truth.warning.empty()) spdlog::warn("{}: {}", config.truth.port, summary.truth.warning);
  const std::string printed = text(summary);
  std::fputs(printed.c_str(), writes_to_stdout(config) ? stderr : stdout);
  std::fflush(stdout);
  if (summary_file.is_open()) {
    summary_file << json(summary, JsonLayout::indented);
    summary_file.flush();
    if (!summary_file) throw std::runtime_error(fmt::format("{}: cannot be written", options.summary_file));
  }
  if (summary.truth.counters[&TruthCounters::accepted] == 0 && is_capture(config.truth.port) && !stop) {
    spdlog::error("{}: it contains no truth of the format {}", config.truth.port, config.truth.format->name);
    return 1;
  }
  return 0;
}

}  // namespace imud
