#include "emulator/run.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <utility>  // Boost 1.74's Asio needs it first

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <fstream>
#include <thread>

#include "emulator/clock.hpp"
#include "emulator/session.hpp"
#include "emulator/summary.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

namespace asio = boost::asio;

// Says once what the thread that samples may not say itself.
class Monitor {
 public:
  Monitor(asio::io_context& io, const Session& session, const Config& config)
      : timer_(io), session_(session), config_(config), states_(config.imus.size(), PortState::ready) {
    look();
  }

  // Also once more at the end.
  void report() {
    const TruthCounters& truth = session_.intake().counters();
    for (std::size_t i = 0; i < truth.refused.size(); ++i)
      if (!named_[i] && truth.refused[i] > 0) {
        named_[i] = true;
        const auto refusal = static_cast<Refusal>(i);
        spdlog::warn("truth refused: {}: {} (counted; said once)", cause(refusal), remedy(refusal));
      }
    if (const std::uint64_t runs = truth.runs; runs > runs_) {
      if (runs > 1) spdlog::info("the truth's time began anew: run {}", runs);
      runs_ = runs;
    }
    if (truth.resumed > 0 && !std::exchange(resumed_named_, true))
      spdlog::warn("the truth paused, runs slow or jumped: a new run begins (counted; said once)");
    for (std::size_t i = 0; i < states_.size(); ++i) {
      const PortState state = session_.imu_counters(i).port_state;
      if (std::exchange(states_[i], state) == state) continue;
      const ImuConfig& imu = config_.imus[i];
      switch (state) {
        case PortState::ready: spdlog::info("{}: {} takes frames", imu.name, imu.port); break;
        case PortState::no_reader: spdlog::info("{}: nobody has {} open; frames are discarded", imu.name, imu.port); break;
        case PortState::lost: spdlog::warn("{}: {} is lost; frames are dropped until it is back", imu.name, imu.port); break;
      }
    }
  }

 private:
  void look() {
    report();
    timer_.expires_after(std::chrono::milliseconds(100));
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) look();
    });
  }

  asio::steady_timer timer_;
  const Session& session_;
  const Config& config_;
  std::vector<PortState> states_;  // as last said
  std::array<bool, static_cast<std::size_t>(Refusal::count)> named_ = {};
  std::uint64_t runs_ = 0;
  bool resumed_named_ = false;
};

void drive(Session& session, const Config& config, const RunOptions& options, const std::atomic<bool>& stop) {
  if (is_capture(config.truth.port)) {
    std::optional<Nanoseconds> limit;
    if (options.duration_s) limit = Nanoseconds{static_cast<std::int64_t>(*options.duration_s * 1e9 + 0.5)};
    run_capture(session, config.clock == ClockMode::realtime, limit, stop);
  } else if (config.clock == ClockMode::lockstep) {
    run_lockstep(session, stop);
  } else {
    run_realtime(session, config.truth.delay, config.truth.limits.extrapolate, stop);
  }
}

bool writes_to_stdout(const Config& config) {
  for (const ImuConfig& imu : config.imus)
    for (const char* name : {"file:-", "file:/dev/stdout", "file:/dev/fd/1", "file:/proc/self/fd/1"})
      if (imu.port == name) return true;
  return false;
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
  std::ofstream summary_file;
  if (!options.summary_file.empty()) {
    summary_file.open(options.summary_file);
    if (!summary_file) throw std::runtime_error(fmt::format("{}: cannot be written", options.summary_file));
  }

  Session session(config, stop);
  Monitor monitor(io, session, config);
  asio::steady_timer end(io);
  if (options.duration_s && !is_capture(config.truth.port)) {
    end.expires_after(std::chrono::nanoseconds(static_cast<std::int64_t>(*options.duration_s * 1e9)));
    end.async_wait([&](const boost::system::error_code& error) {
      if (!error) stop = true;
    });
  }

  const HostTime begin = host_now();
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

  monitor.report();
  const Summary summary = summarize(session, seconds(host_now() - begin));
  if (!summary.truth.warning.empty()) spdlog::warn("{}: {}", config.truth.port, summary.truth.warning);
  const std::string printed = text(summary);
  std::fputs(printed.c_str(), writes_to_stdout(config) ? stderr : stdout);
  std::fflush(stdout);
  if (summary_file.is_open()) {
    summary_file << json(summary);
    summary_file.flush();
    if (!summary_file) throw std::runtime_error(fmt::format("{}: cannot be written", options.summary_file));
  }
  if (summary.truth.accepted == 0 && is_capture(config.truth.port) && !stop) {
    spdlog::error("{}: no truth in it for the format {}", config.truth.port, config.truth.format->name);
    return 1;
  }
  return 0;
}

}  // namespace imud
