#include "emulator/campaign/case_runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "emulator/campaign/cases/case_figures.hpp"
#include "emulator/campaign/cases/case_port.hpp"
#include "emulator/campaign/cases/case_rows.hpp"
#include "emulator/campaign/tested_case.hpp"
#include "emulator/config/scenario.hpp"
#include "emulator/engine/closing.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/record/recorder.hpp"
#include "emulator/record/twin_rows.hpp"
#include "emulator/seeds/seed_checks.hpp"
#include "emulator/truth/capture_check.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

using Row = nlohmann::ordered_json;

// Returns true if both configurations of truth read the same packets from a capture.
bool reads_the_same(const TruthConfig& a, const TruthConfig& b) {
  return a.port == b.port && a.format == b.format && !a.settings.frames() && !b.settings.frames() &&
         a.port_settings.from == b.port_settings.from &&
         std::ranges::all_of(a.format->settings, [&](const Setting& setting) {
           return a.settings.value(setting.key) == b.settings.value(setting.key);
         });
}

bool has_instants_of_the_seed(const ImuConfig& imu) {
  return imu.model.oscillator.phase_random_walk > 0 || imu.model.oscillator.frequency_random_walk > 0;
}

// Returns a row of a case up to its results.
Row begin_of_row(const Campaign& campaign, const CampaignCase& one, std::string identity) {
  Row row = {{"case", one.index}, {"identity", std::move(identity)}, {"axes", Row::object()}, {"seed", one.seed}};
  for (auto& [name, text] : columns_of(campaign, one)) row["axes"][name] = std::move(text);
  return row;
}

// Texts of faults and of files may have bytes that are no UTF-8.
std::string line_of(const Row& row) { return row.dump(-1, ' ', false, Row::error_handler_t::replace); }

// The ports of a case, and the results that they collect.
struct CasePorts {
  const Config& config;
  std::vector<MeasuredSumsOverTime> sums;                  // of each imu; empty: errors are not integrated
  std::vector<CaseRows> rows;                              // of each imu; empty: there are no arrays
  const std::optional<std::size_t> tested = std::nullopt;  // the imu whose line is opened
  std::map<std::string, std::string> digests = {};         // by "IMU" and "IMU.second_port"

  std::unique_ptr<Port> open(const PortUse& use) {
    const bool is_line = use.of == PortUse::Of::line;
    if (use.imu == tested && is_line && use.number == 0) return real_ports(use);
    const bool is_copy = use.imu == tested && use.of == PortUse::Of::copy;  // with the bytes of the open line
    if (!is_line && !is_copy) return std::make_unique<NoPort>();
    const ImuConfig& imu = config.imus[use.imu];
    std::function<void(const Measurement&, DeviceTime)> receive;
    if ((!sums.empty() || !rows.empty()) && use.number == 0)
      receive = [this, at = use.imu](const Measurement& measurement, DeviceTime time) {
        if (!sums.empty()) sums[at].add(measurement, time);
        if (!rows.empty()) rows[at].add(measurement);
      };
    return std::make_unique<CasePort>(
        imu,
        [&digest = digests[use.number == 0 ? imu.name : imu.name + ".second_port"]](std::string sha256) {
          digest = std::move(sha256);
        },
        receive);
  }
};

}  // namespace

const Config& CaseRunner::prepare(const CampaignCase& one) {
  // Decoded truths belong to the identity, even if the file has changed since.
  if (prepared_ && prepared_->at == one.at && prepared_->draw == one.draw &&
      (prepared_->truths || capture_digest(prepared_->truth) == prepared_->capture)) {
    prepared_->config.seed = one.seed;
    return prepared_->config;
  }
  const std::optional<Prepared> last = std::exchange(prepared_, std::nullopt);
  Prepared next;
  next.at = one.at;
  next.draw = one.draw;
  next.repeats = CapturePort(one.capture, campaign_.base).repeats;
  next.config = config_of(campaign_, one);
  Config& config = next.config;
  check_begins_by_host(config, next.repeats);
  check_seed_ports(config, next.repeats, false, true);
  next.truth = config.truth;
  next.capture = capture_digest(next.truth);
  if (last && last->truths && last->capture == next.capture && reads_the_same(last->truth, config.truth))
    next.truths = last->truths;
  else if (auto truths = next.repeats ? std::nullopt : store_truths(config.truth))
    next.truths = std::make_shared<const StoredTruths>(std::move(*truths));
  next.identity = identity_without_seed(campaign_, config);
  if (next.truths) config.truth.format = &next.truths->format();
  if (!next.repeats) config.control.faults = false;  // nobody controls the case
  for (ImuConfig& imu : config.imus) {
    next.line_loads.push_back(imu.load.percent);
    imu.also.clear();
  }
  prepared_ = std::move(next);
  try {
    check_capture_is_same();
  } catch (...) {
    prepared_.reset();
    throw;
  }
  return prepared_->config;
}

void CaseRunner::check_capture_is_same() const {
  if (capture_digest(prepared_->truth) != prepared_->capture)
    throw OpenError(fmt::format("{}: has changed while the case read it", prepared_->truth.port));
}

void CaseRunner::compute_true_sums() {
  const Config& config = prepared_->config;
  if (!prepared_->sums.empty() && std::ranges::none_of(config.imus, has_instants_of_the_seed)) return;
  const TwinRun run = [this](Config twins, const Ports& ports, const auto& awaits_truth) {
    twins.clock = ClockMode::fast;  // the same instants
    const std::atomic<bool> no_stop = false;
    const SeedRun twin{
        .truths = prepared_->truths.get(), .repeats = prepared_->repeats, .limits = {.awaits_truth = awaits_truth}};
    twin.run(twins, ports, no_stop, [](Engine& engine, const std::string&) { commit(engine.channels()); });
    return std::string();
  };
  const RunTruth truth = truth_of_run(config, run, [](std::size_t) { return false; });
  prepared_->sums.clear();
  for (const RunTruth::OfImu& imu : truth.imus)
    prepared_->sums.emplace_back(imu.rows, nanoseconds(campaign_.errors_every_s));
}

std::optional<CaseRunner::Result> CaseRunner::run(std::uint64_t index, const std::atomic<bool>& stop,
                                                  const Shown& shown) {
  const CampaignCase one = case_of(campaign_, index);
  try {
    Config config = prepare(one);
    if (campaign_.integrated_errors) compute_true_sums();
    std::optional<TestedCase> tested;
    if (campaign_.test) tested.emplace(campaign_, one, config, shown.of_test);
    CasePorts ports{.config = config,
                    .sums = {prepared_->sums.begin(), prepared_->sums.end()},
                    .rows = {},
                    .tested = tested ? std::optional(tested->imu()) : std::nullopt};
    for (std::size_t i = 0; campaign_.arrays > 0 && i < config.imus.size(); ++i)
      ports.rows.emplace_back(campaign_.arrays);
    SeedRun replay{.truths = prepared_->truths.get(), .repeats = prepared_->repeats};
    std::optional<Recorder> recorder;
    if (!shown.record.empty()) {
      config.truth.format = prepared_->truth.format;
      replay.truths = nullptr;  // the packets of the capture are recorded
      replay.sink = &recorder.emplace(RecordOptions{.file = shown.record}, true);
    }
    if (tested) replay.readers = std::chrono::seconds(2);
    replay.begin = [&](Engine& engine) {
      if (recorder) recorder->start(false, config.resolved());
      if (tested) tested->begin(engine, stop);
    };
    const HostTime begin = host_now();
    Summary summary;
    const auto end = [&](Engine& engine, const std::string& difference) {
      summary = judge_run(engine,
                          {.config = config,
                           .channels = engine.channels(),
                           .line_loads = prepared_->line_loads,
                           .begin = begin,
                           .is_stopped = stop,
                           .repeats = prepared_->repeats},
                          difference);
      const std::vector<std::string> names = names_of(config.imus);
      const std::vector<FaultLabel> labels = fault_labels(engine.faults().all(), names, engine.faults().log());
      summary.whole->outcome.judge_faults(fault_outcomes(engine.faults().configured(), labels), prepared_->repeats);
      commit(engine.channels());
    };
    replay.run(
        config, [&](const PortUse& use) { return ports.open(use); }, stop, end);
    if (replay.truths == nullptr) check_capture_is_same();
    if (recorder) recorder->finish();
    Outcome& outcome = summary.whole->outcome;
    if (outcome.ended_by == EndedBy::signal) return std::nullopt;
    std::vector<std::string> shortfalls;
    const Row of_test = tested ? tested->end(stop, shortfalls) : Row();
    // The faults of the test come before their consequences, because a run prints the first shortfall.
    outcome.shortfalls.insert(outcome.shortfalls.begin(), shortfalls.begin(), shortfalls.end());
    if (tested && stop) return std::nullopt;  // it may have been killed

    Row row = begin_of_row(campaign_, one, identity_with_seed(prepared_->identity, one.seed));
    row["exit_code"] = outcome.exit_code();
    row["ended_by"] = word(outcome.ended_by);
    row["digest"] = ports.digests;
    row["figures"] = case_figures(summary);
    for (std::size_t i = 0; campaign_.integrated_errors && i < config.imus.size(); ++i)
      for (const auto& [name, value] : integrated_errors(ports.sums[i], prepared_->sums[i]))
        row["figures"][fmt::format("{}.{}", config.imus[i].name, name)] = value;
    for (std::size_t i = 0; i < ports.rows.size(); ++i) {
      row["figures"][config.imus[i].name + ".rows_cut"] = ports.rows[i].cut();
      if (shown.rows) shown.rows(i, ports.rows[i].finish());
    }
    row["expect"] = Row::object();
    for (const Expected& expected : outcome.expected) row["expect"][expected.name] = expected.holds;
    row["shortfalls"] = outcome.shortfalls;
    row["error"] = nullptr;
    if (tested) row["test"] = of_test;
    return Result{line_of(row), outcome.exit_code()};
  } catch (const std::exception& error) {
    if (stop) return std::nullopt;
    return Result{row_of_failure(index, error.what()), 1};
  }
}

std::string CaseRunner::row_of_failure(std::uint64_t index, const std::string& error) const {
  const CampaignCase one = case_of(campaign_, index);
  std::string identity;
  try {
    identity = identity_of(campaign_, one);
  } catch (const std::exception&) {  // `error` may be that the configuration or a file cannot be read
  }
  Row row = begin_of_row(campaign_, one, std::move(identity));
  row["exit_code"] = 1;
  row["ended_by"] = word(EndedBy::failure);
  row["digest"] = Row::object();
  row["figures"] = Row::object();
  row["expect"] = Row::object();
  row["shortfalls"] = Row::array();
  row["error"] = error;
  return line_of(row);
}

}  // namespace imud
