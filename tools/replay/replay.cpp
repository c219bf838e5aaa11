#include "tools/replay/replay.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <stdexcept>
#include <utility>

#include "emulator/config/scenario.hpp"
#include "emulator/drive/loop.hpp"
#include "emulator/drive/recorded_run.hpp"
#include "emulator/engine/closing.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/truth/remark_text.hpp"
#include "tools/stop_signal.hpp"

namespace imud {

namespace {

std::vector<std::string> all_remarks(Engine& engine, const RecordedRun* repeated) {
  std::vector<std::string> all = remarks(engine.intake().counters());
  if (std::string end = engine.intake().end_warning(); !end.empty()) all.push_back(std::move(end));
  for (std::string& remark : all) remark.insert(0, "truth: ");
  if (repeated != nullptr) {
    if (std::string difference = repeated->difference(); !difference.empty()) all.push_back(std::move(difference));
    return all;
  }
  std::vector<std::string> names;
  for (const auto& channel : engine.channels()) names.push_back(channel->name);
  const auto labels = fault_labels(engine.faults().all(), names, engine.faults().log());
  for (const FaultOutcome& fault : fault_outcomes(engine.faults().configured(), labels))
    if (std::string text = fault.shortfall(); !text.empty()) all.push_back(std::move(text));
  return all;
}

}  // namespace

Replay::Replay(const std::string& config, std::vector<std::string> overrides, const std::string& capture) {
  overrides.insert(overrides.end(), {"imu.*.pace=none", "clock=fast"});
  replay_ = load_replay(config, overrides, capture);
  check_begins_by_host(replay_.config, replay_.repeats);
  if (!replay_.repeats) replay_.config.control.faults = false;  // nobody controls these runs
}

std::vector<std::string> Replay::run(const Config& config, const Ports& ports,
                                     const std::function<void(std::size_t imu)>& awaits_truth) {
  constexpr std::size_t most_records = 500'000;
  if (!replay_.repeats && !std::exchange(is_read_, true))
    truths_ = StoredTruths::read(replay_.config.truth, most_records);
  Config all = config;
  if (truths_) all.truth.format = &truths_->format();
  const Ports with_truth = [&](const PortUse& use) {
    return use.of != PortUse::Of::truth ? ports(use) : truths_ ? truths_->open() : real_ports(use);
  };
  std::optional<RecordedRun> repeated;
  if (replay_.repeats) repeated.emplace(PortSpec::parse(all.truth.port), all);
  Engine engine(repeated ? repeated->adapted(all) : all, repeated ? repeated->ports(with_truth) : with_truth);
  MonotonicHost host;
  if (repeated)
    repeated->run(engine, host, {.awaits_truth = awaits_truth}, stop_flag());
  else
    Loop(engine, host, *make_pacer(all, engine.quality()), {}, stop_flag()).run();
  drain(engine, std::chrono::milliseconds(50));
  engine.finish_faults();
  if (stop_requested()) throw std::runtime_error("a signal has ended the replay");
  commit(engine.channels());
  return all_remarks(engine, repeated ? &*repeated : nullptr);
}

TwinRun Replay::with_twins() {
  return [this](const Config& config, const Ports& ports, const auto& awaits_truth) {
    return fmt::format("{}", fmt::join(run(config, ports, awaits_truth), "; "));
  };
}

}  // namespace imud
