#include "tools/replay/replay.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <stdexcept>
#include <utility>

#include "emulator/config/scenario.hpp"
#include "emulator/drive/assembly.hpp"
#include "emulator/drive/begun_faults.hpp"
#include "emulator/engine/closing.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/truth/remark_text.hpp"
#include "tools/stop_signal.hpp"

namespace imud {

namespace {

std::vector<std::string> all_remarks(Assembly& assembly, bool repeats) {
  Engine& engine = assembly.engine();
  std::vector<std::string> all = remarks(engine.intake().counters());
  if (std::string end = engine.intake().end_warning(); !end.empty()) all.push_back(std::move(end));
  for (std::string& remark : all) remark.insert(0, "truth: ");
  if (std::string difference = assembly.difference(); !difference.empty()) all.push_back(std::move(difference));
  if (repeats) return all;
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

std::vector<FaultConfig> Replay::faults() const {
  std::vector<FaultConfig> all = replay_.config.faults;
  if (!replay_.repeats) return all;
  for (FaultConfig& begun : begun_faults(replay_.config)) all.push_back(std::move(begun));
  return all;
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
  Assembly assembly(all, with_truth, {.repeats = replay_.repeats});
  MonotonicHost host;
  assembly.run(host, stop_flag(), {.awaits_truth = awaits_truth});
  drain(assembly.engine(), std::chrono::milliseconds(50));
  assembly.engine().finish_faults();
  if (stop_requested()) throw std::runtime_error("a signal has ended the replay");
  commit(assembly.engine().channels());
  return all_remarks(assembly, replay_.repeats);
}

TwinRun Replay::with_twins() {
  return [this](const Config& config, const Ports& ports, const auto& awaits_truth) {
    return fmt::format("{}", fmt::join(run(config, ports, awaits_truth), "; "));
  };
}

}  // namespace imud
