#include "emulator/report/monitor.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "emulator/faults/fault_book.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/report/log.hpp"

namespace imud {
namespace {
std::string names(const std::vector<std::string_view>& all) {
  return all.empty() ? "none" : fmt::format("{}", fmt::join(all, ", "));
}
// Returns "42 % of the capture, 80 s left; ", or an empty text if the progress is not known.
std::string progress_text(const Summary& all) {
  const double progress = all.truth.progress.value_or(0);
  if (progress <= 0 || progress >= 1) return {};
  return fmt::format("{:.0f} % of the capture, {} left; ", 100 * progress, time_left(all.duration_s, progress));
}
std::vector<const Remark*> remarks_of(const RunCounters& counters) {
  const auto of_truth = counters.truth->remarks.all();
  std::vector<const Remark*> all(of_truth.begin(), of_truth.end());
  all.push_back(&counters.quality->stamps);
  return all;
}
std::string times(std::uint64_t n) { return n == 1 ? std::string() : fmt::format(" ({} times)", n); }
}  // namespace

Monitor::Monitor(RunCounters counters, const Config& config, const Options& options, TextFile quality)
    : counters_(std::move(counters)),
      config_(config),
      options_(options),
      quality_(std::move(quality)),
      imu_names_(names_of(config.imus)),
      remarks_(remarks_of(counters_).size()),
      refusals_(counters_.truth->refused.counters.size()),
      edges_refused_(config.imus.size()),
      device_reported_(config.imus.size()),
      ports_(config.imus.size()),
      second_ports_(config.imus.size()),
      clock_(config.realtime, counters_.clock) {
  update_loads();
  last_quality_ = last_log_ = now();
}

void Monitor::update_loads() {
  line_loads_.clear();
  for (const ImuConfig& imu : config_.imus) line_loads_.push_back(imu.load.percent);
  pty_readers_.watch(config_);
}

Summary Monitor::now() const {
  const HostTime now = host_now();
  Summary all = summarize(counters_, seconds(now - begin_), line_loads_);
  all.clock = clock_.figures();
  if (!is_capture(config_.truth.port) && all.truth.counters[&TruthCounters::accepted] > 0)
    all.truth.since_newest_s = std::max(0.0, seconds(now - HostTime{counters_.truth->newest_ns}));
  return all;
}

void Monitor::report_news() {
  report_connection();
  report_remarks();
  report_delay();
  report_refusals();
  report_interruptions();
  report_imus();
  report_skipped();
  report_record();
  report_faults();
  clock_.update(host_now());
}

void Monitor::update() {
  report_first_truth();
  report_news();
  pty_readers_.update(host_now());
  const double now_s = seconds(host_now() - begin_);
  if (quality_.is_open() && now_s - last_quality_.duration_s >= 1.0) {
    Summary all = now();
    write_quality(all);
    last_quality_ = std::move(all);
  }
  if (options_.log_every_s > 0 && now_s - last_log_.duration_s >= options_.log_every_s) {
    Summary all = now();
    spdlog::info("{}{}", progress_text(all), line(all.since(last_log_)));
    last_log_ = std::move(all);
  }
}

Summary Monitor::finish(std::string capture_warning) {
  report_news();
  report_extrapolation(true);
  Summary all = now();
  all.truth.warning = std::move(capture_warning);
  for (const Remark* remark : remarks_of(counters_))
    if (remark->is_set()) all.truth.remarks.emplace_back(remark->text());
  for (std::size_t i = 0; i < refusals_.size(); ++i)
    if (const Remark& first = counters_.truth->refused.first[i]; first.is_set())
      all.truth.remarks.push_back(fmt::format("refused: {}: {}", cause(static_cast<Refusal>(i)), first.text()));
  if (all.truth.has_fit) spdlog::info("truth: {}", fit_text(all.truth.fit));
  if (all.truth.warning.empty() && all.truth.counters[&TruthCounters::accepted] == 0 &&
      !is_capture(config_.truth.port))
    all.truth.warning = "no truth was accepted";
  if (quality_.is_open()) write_quality(all);
  return all;
}

// After a failure, as of a full disk, the next line is tried as usual: the disk may have room again.
void Monitor::write_quality(const Summary& all) {
  if (!quality_.has_room()) {  // the thread that waits for signals must not wait for a reader
    quality_error_ = fmt::format("{}: its reader is too slow; lines of figures are missing", options_.quality_file);
    return;
  }
  try {
    quality_.append(json(all.since(last_quality_), JsonLayout::line) + "\n");
    if (std::exchange(quality_fails_, false)) spdlog::info("{}: takes figures again", options_.quality_file);
  } catch (const std::runtime_error& error) {
    quality_error_ = error.what();
    if (!std::exchange(quality_fails_, true)) spdlog::error("{}; tried again each second", quality_error_);
  }
}

void Monitor::reopen() {
  if (options_.quality_file.empty() || options_.quality_file == "-") return;
  try {
    quality_.reopen();
    spdlog::info("SIGHUP: the file of the figures is opened again");
  } catch (const std::runtime_error& error) {
    spdlog::error("{}", error.what());
  }
}

void Monitor::report_first_truth() {
  if (has_truth_) return;
  has_truth_ = counters_.truth->runs > 0;
  if (has_truth_ && no_truth_reported_) spdlog::info("the first truth has come");
  if (has_truth_ || no_truth_reported_ || seconds(host_now() - begin_) < options_.first_truth_s) return;
  no_truth_reported_ = true;
  std::vector<std::string_view> at_rest, silent;
  for (const ImuConfig& imu : config_.imus)
    (imu.before_first == BeforeFirst::rest ? at_rest : silent).push_back(imu.name);
  spdlog::info("no truth from {} yet; sampling a vehicle at rest: {}; silent: {}", config_.truth.port, names(at_rest),
               names(silent));
}

void Monitor::report_connection() {
  const TruthCounters& truth = *counters_.truth;
  if (is_capture(config_.truth.port)) return;
  const PortState state = truth.port_state.load(std::memory_order_acquire);
  if (const std::uint64_t n = disconnections_.of(truth.disconnections); n > 0) {
    const LogFields fields({}, "truth.disconnections");
    spdlog::warn("truth: {} is disconnected{}", config_.truth.port, times(n));
    truth_port_ = PortState::lost;
  }
  if (const PortState before = std::exchange(truth_port_, state); before != state && state == PortState::ready)
    spdlog::info("truth: {} is connected", config_.truth.port);
  else if (before == PortState::ready && state != PortState::ready)
    spdlog::info("truth: nobody is connected to {} yet", config_.truth.port);
  if (refused_peer_reported_ || truth.connections_refused == 0) return;
  refused_peer_reported_ = true;
  const LogFields fields({}, "truth.connections_refused");
  spdlog::warn("truth: {} has refused a second connection (counted; reported once)", config_.truth.port);
}

void Monitor::report_refusals() {
  for (std::size_t i = 0; i < refusals_.size(); ++i) {
    if (refusals_[i] || counters_.truth->refused[i] == 0) continue;
    refusals_[i] = true;
    const LogFields fields({}, "truth.refused");
    const auto refusal = static_cast<Refusal>(i);
    const std::string_view first = counters_.truth->refused.first[i].text();
    spdlog::warn("truth refused: {}: {}{}{} (counted; reported once)", cause(refusal), remedy(refusal),
                 first.empty() ? "" : "; the first: ", first);
  }
}

void Monitor::report_remarks() {
  const auto all = remarks_of(counters_);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (!remarks_[i] && all[i]->is_set()) {
      remarks_[i] = true;
      spdlog::warn("truth: {} (reported once)", all[i]->text());
    }
}

void Monitor::report_interruptions() {
  if (runs_.of(counters_.truth->runs) > 0)
    if (const std::uint64_t runs = counters_.truth->runs; runs > 1)
      spdlog::info("a new run of simulation time begins: run {}", runs);

  const TruthQuality& quality = *counters_.quality;
  if (const std::uint64_t n = stops_.of(quality.stops); n > 0) {
    const LogFields fields({}, "truth.stops");
    described_ = 0;
    constexpr std::array<std::string_view, 3> reactions = {
        "motion is held", "motion is held and flagged as not valid", "the sensors are silent"};
    spdlog::warn("no truth for {:.0f} ms: {}{}", 1e3 * seconds(config_.truth.limits.extrapolate),
                 reactions[static_cast<std::size_t>(config_.truth.when_stopped)], times(n));
  }
  if (const std::uint64_t n = pauses_.of(quality.pauses); n > 0) {
    described_ += n;
    const double behind_s = 1e-9 * static_cast<double>(quality.last_behind_ns);
    spdlog::warn("no truth for {:.2f} s: held {:.2f} s, then {}{}",
                 1e-9 * static_cast<double>(quality.last_missing_ns),
                 1e-9 * static_cast<double>(quality.last_held_ns),
                 behind_s == 0 ? "caught up" : fmt::format("went on {:.2f} s behind", behind_s), times(n));
  }
  if (const std::uint64_t n = leaps_.of(quality.leaps); n > 0)
    spdlog::warn("the simulator's time has leapt ahead by {:.3f} s: what lies between is passed over{}",
                 1e-9 * static_cast<double>(quality.last_leap_ns), times(n));
  const std::uint64_t returns = returns_.of(quality.returns);
  const std::uint64_t n = returns - std::min(returns, described_);
  described_ -= returns - n;
  if (n > 0) spdlog::info("truth has resumed{}", times(n));
}

void Monitor::report_delay() {
  const TruthQuality& quality = *counters_.quality;
  const double settled_s = quality.settled.delay_s.load(std::memory_order_acquire);
  if (settled_s >= 0 && !std::exchange(delay_reported_, true))
    spdlog::info(
        "truth.delay_ms is \"auto\": the sensors sample {:.1f} ms behind the truth, which is added latency: its "
        "interval is {:.1f} ms and its jitter {:.1f} ms, measured for {:.2f} s; closed loops want truth.delay_ms = 0",
        1e3 * settled_s, 1e3 * quality.settled.interval_s, 1e3 * quality.settled.jitter_s,
        quality.settled.duration_s.load());
  if (const std::uint64_t n = delay_raises_.of(quality.delay_raises); n > 0)
    spdlog::info("truth is later than before: the automatic delay is raised to {:.1f} ms{}", 1e3 * quality.delay_s,
                 times(n));
  report_extrapolation(false);
}

// Logs the errors once when they are noticeable, and at the end.
void Monitor::report_extrapolation(bool at_end) {
  const auto& error = counters_.quality->extrapolation_error;
  constexpr std::uint64_t enough = 1000;  // samples, so that the first reported figures are not unusually small
  if (!is_noticeable(error.rate_rad_per_s, error.specific_force_m_per_s2) ||
      (!at_end && (extrapolation_reported_ || error.samples < enough)))
    return;
  extrapolation_reported_ = true;
  const bool is_automatic = config_.truth.clock.automatic_percent > 0;
  spdlog::log(is_automatic ? spdlog::level::info : spdlog::level::warn, "motion was {}{}",
              extrapolation_text(error.ahead_s, error.rate_rad_per_s, error.specific_force_m_per_s2),
              is_automatic ? ", where truth was later than the automatic delay allows for"
                           : "; truth.delay_ms = \"auto\", or a longer one, avoids it");
}

void Monitor::report_imus() {
  for (std::size_t i = 0; i < ports_.size(); ++i) {
    const ImuConfig& imu = config_.imus[i];
    const ImuCounters& counters = *counters_.imus[i].second;
    report_port(ports_[i], imu.name, imu.port, {counters.port_state, counters.speeds, counters.port_error});
    if (!imu.second_port.empty())
      report_port(second_ports_[i], imu.name, imu.second_port,
                  {counters.second_port_state, counters.second_speeds, counters.second_port_error});
    const std::span<const DeviceCounter> declared = counters.device.declared();
    device_reported_[i].resize(declared.size());
    for (std::size_t k = 0; k < declared.size(); ++k) {
      if (device_reported_[i][k] || declared[k].warning.empty() || counters.device.count(k) == 0) continue;
      device_reported_[i][k] = true;
      const LogFields fields(imu.name, declared[k].key);
      spdlog::warn("{}: {} (counted; reported once)", imu.name, declared[k].warning);
    }
    if (edges_refused_[i] || counters_.imus[i].second->edges_refused == 0) continue;
    edges_refused_[i] = true;
    const LogFields fields(imu.name, "edges_refused");
    spdlog::warn(
        "{}: edges refused: more than 10 s ahead of the sample, or more than 64 waiting (counted; reported once)",
        counters_.imus[i].first);
  }
}

void Monitor::report_skipped() {
  if (skipped_reported_) return;
  std::uint64_t skipped = 0;
  for (const auto& [name, imu] : counters_.imus) skipped += imu->skipped;
  if (skipped == 0) return;
  skipped_reported_ = true;
  const LogFields fields({}, "skipped");
  spdlog::warn(
      "{} samples are skipped, because they are more than {:g} ms late (realtime.skip_after_ms): this process or its "
      "machine was stopped, or is too slow (counted; reported once)",
      skipped, 1e3 * seconds(config_.realtime.skip_after));
}

void Monitor::report_record() {
  if (counters_.record == nullptr || record_reported_) return;
  const int error = counters_.record->error;
  const std::uint64_t lost = counters_.record->lost;
  record_reported_ = error != 0 || lost > 0;
  const LogFields fields({}, "record.lost");
  if (error != 0)
    spdlog::error("the record: {}; packets are lost until it can be written again (counted; reported once)",
                  strerrordesc_np(error));
  else if (lost > 0)
    spdlog::warn("the record lacks {} packets, because the disk is too slow (counted; reported once)", lost);
}

void Monitor::report_faults() {
  if (counters_.faults == nullptr) return;
  constexpr std::size_t most = 1000;  // more are in the labels only
  for (; faults_reported_ < std::min(most, counters_.faults->log().size()); ++faults_reported_) {
    const FaultEvent& event = counters_.faults->log()[faults_reported_];
    const LogFields fields(imu_of(event, imu_names_));
    spdlog::info("{}", event_text(counters_.faults->all()[event.fault], imu_of(event, imu_names_), event));
    if (faults_reported_ + 1 == most) spdlog::info("further begins and ends of faults are not logged");
  }
  if (counters_.faults->log().lost() > 0 && !std::exchange(are_faults_lost_, true))
    spdlog::warn("the log of faults is full: further occurrences are counted, but have no labels");
}

void Monitor::report_port(ReportedPort& reported, const std::string& imu, const std::string& port,
                          const PortFigures& now) const {
  if (reported.port != port) reported = {.port = port, .state = PortState::ready, .wrong_speeds = 0, .mismatch = {}};
  constexpr int most = 10;  // reports; a client may try wrong speeds for ever
  const PortState state = now.state;
  const Port::Speeds speeds = now.speeds;
  if (state != PortState::wrong_speed)
    reported.mismatch.end();
  else if (reported.wrong_speeds == most ||
           !reported.mismatch.lasts(speeds, host_now(), nanoseconds(options_.wrong_speed_s)))
    return;
  if (std::exchange(reported.state, state) == state) return;
  const LogFields fields(imu);
  switch (state) {
    case PortState::ready:
      spdlog::info("{}: {} takes frames", imu, port);
      break;
    case PortState::no_reader:
      reported.wrong_speeds = 0;
      spdlog::info("{}: nobody has {} open; frames are discarded", imu, port);
      break;
    case PortState::wrong_speed:
      spdlog::warn("{}: {}: the line has {} baud and the client {}: both read garbage{}", imu, port, speeds.line,
                   speeds.client, ++reported.wrong_speeds == most ? " (reported for the last time)" : "");
      break;
    case PortState::error_warning:
      spdlog::warn("{}: {}: error warning: the bus has errors, 96 or more counted by the controller", imu, port);
      break;
    case PortState::error_passive:
      spdlog::warn(
          "{}: {}: error passive: frames are not acknowledged, or damaged; is another node on the bus, at "
          "the same bit rate?",
          imu, port);
      break;
    case PortState::lost:
      if (const int error = now.error; error != 0)
        spdlog::error("{}: {}: {}; frames are lost until it can be written again", imu, port, strerrordesc_np(error));
      else
        spdlog::warn("{}: {} is lost; frames are dropped until it is back", imu, port);
      break;
  }
}

}  // namespace imud
