#include "emulator/monitor.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "emulator/line_load.hpp"

namespace imud {

Monitor::Monitor(const Session& session, const Config& config, const Options& options)
    : session_(session),
      config_(config),
      options_(options),
      states_(config.imus.size(), PortState::ready),
      wrong_speeds_(config.imus.size()) {
  for (const ImuConfig& imu : config.imus) line_loads_.push_back(line_load(imu).percent);
  if (!options.quality_file.empty()) {
    quality_.open(options.quality_file);
    if (!quality_) throw std::runtime_error(fmt::format("{}: cannot be written", options.quality_file));
  }
  last_quality_ = last_log_ = now();
}

Summary Monitor::now() const { return summarize(session_, seconds(host_now() - begin_), line_loads_); }

void Monitor::look() {
  say_truth();
  say_ports();
  const double now_s = seconds(host_now() - begin_);
  if (quality_.is_open() && now_s - last_quality_.duration_s >= 1.0) {
    Summary all = now();
    quality_ << json(all.since(last_quality_), JsonLayout::line) << std::endl;
    last_quality_ = std::move(all);
  }
  if (options_.log_every_s > 0 && now_s - last_log_.duration_s >= options_.log_every_s) {
    Summary all = now();
    spdlog::info("{}", line(all.since(last_log_)));
    last_log_ = std::move(all);
  }
}

Summary Monitor::finish() {
  say_truth();
  say_ports();
  Summary all = now();
  all.truth.warning = session_.intake().end_warning();
  if (quality_.is_open()) {
    quality_ << json(all.since(last_quality_), JsonLayout::line) << std::endl;
    if (!quality_) spdlog::error("{}: cannot be written", options_.quality_file);
  }
  return all;
}

void Monitor::say_truth() {
  const TruthCounters& truth = session_.intake().counters();
  for (std::size_t i = 0; i < named_.size(); ++i)
    if (!named_[i] && truth.refused[i] > 0) {
      named_[i] = true;
      const auto refusal = static_cast<Refusal>(i);
      spdlog::warn("truth refused: {}: {} (counted; said once)", cause(refusal), remedy(refusal));
    }
  if (const std::uint64_t runs = truth.runs; std::exchange(runs_, runs) < runs && runs > 1)
    spdlog::info("the truth's time began anew: run {}", runs);

  const TruthQuality& quality = session_.quality();
  const auto times = [](std::uint64_t n) { return n == 1 ? std::string() : fmt::format(" ({} times)", n); };
  const std::uint64_t stops = quality.stops, returns = quality.returns, resumed = quality.resumed;
  if (const std::uint64_t n = stops - std::exchange(stops_, stops); n > 0) {
    constexpr std::array<std::string_view, 3> reactions = {
        "motion is held", "motion is held and flagged as not valid", "the sensors are silent"};
    spdlog::warn("no truth for {:.0f} ms: {}{}", 1e3 * seconds(config_.truth.limits.extrapolate),
                 reactions[static_cast<std::size_t>(config_.truth.when_stopped)], times(n));
  }
  if (const std::uint64_t n = returns - std::exchange(returns_, returns); n > 0)
    spdlog::info("the truth is back{}", times(n));
  if (const std::uint64_t n = resumed - std::exchange(resumed_, resumed); n > 0)
    spdlog::warn("the truth had paused or jumped: a new run begins{}", times(n));
}

void Monitor::say_ports() {
  constexpr int often = 10;  // a client may look for the right speed for ever
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const PortState state = session_.imu_counters(i).port_state;
    if (state == PortState::wrong_speed && wrong_speeds_[i] == often) continue;
    if (std::exchange(states_[i], state) == state) continue;
    const ImuConfig& imu = config_.imus[i];
    const Port::Speeds speeds = session_.imu_counters(i).speeds;
    switch (state) {
      case PortState::ready:
        spdlog::info("{}: {} takes frames", imu.name, imu.port);
        break;
      case PortState::no_reader:
        wrong_speeds_[i] = 0;
        spdlog::info("{}: nobody has {} open; frames are discarded", imu.name, imu.port);
        break;
      case PortState::wrong_speed:
        spdlog::warn("{}: {}: the line has {} baud and the client {}: both read garbage{}", imu.name, imu.port,
                     speeds.line, speeds.client, ++wrong_speeds_[i] == often ? " (said for the last time)" : "");
        break;
      case PortState::lost:
        spdlog::warn("{}: {} is lost; frames are dropped until it is back", imu.name, imu.port);
        break;
    }
  }
}

}  // namespace imud
