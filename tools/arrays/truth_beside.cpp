#include "tools/arrays/truth_beside.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <utility>

#include "emulator/config/load_config.hpp"
#include "tools/input/imu_choice.hpp"
#include "tools/replay/replay.hpp"

namespace imud {
namespace {

constexpr std::size_t most_skipped = 65536;

}  // namespace

TruthBeside::TruthBeside(const Options& options, const Protocol& protocol) : options_(options) {
  config_ = load_config(options.config, std::array<std::string, 3>{"truth.port=" + capture_port(options.capture),
                                                                   "clock=fast", "imu.*.pace=none"});
  const std::size_t imu = imu_number(options.config, config_.imus, options.imu, &protocol);
  const std::string& name = config_.imus[imu].name;
  Replay replay(options.config, {}, options.capture);
  const Config& config = replay.config();
  for (const std::string& warning : config.warnings) fmt::print(stderr, "imu-decode: {}\n", warning);
  const bool varies = std::ranges::any_of(
      replay.faults(), [&](const FaultConfig& fault) { return fault.acts_on(name) && changes_rows(fault); });
  RunTruth truth = truth_of_run(config, replay.with_twins(), [&](std::size_t i) { return varies && i == imu; });
  RunTruth::OfImu& of_imu = truth.imus[imu];
  if (of_imu.rows.empty())
    throw std::runtime_error(
        fmt::format("{}: sends no measurement{}{}", name, truth.cause.empty() ? "" : ": ", truth.cause));
  std::optional<RowTruths> by_rows;
  if (varies)
    by_rows.emplace(of_imu.samples, std::move(made_rows(config, replay.with_twins())[imu]));
  else
    truths_ = std::move(of_imu.rows);
  const auto receive = [&](const Measurement& measurement) {
    const MeasurementRow row(measurement);
    measured_.push_back({row.time_ns, row.counter});
    if (by_rows) truths_.push_back(by_rows->of(row));
  };
  const auto ports = [&](const PortUse& use) {
    const bool is_wanted = use.of == PortUse::Of::line && use.imu == imu && use.number == 0;
    return is_wanted ? decoding_port(config.imus[imu], receive) : no_ports(use);
  };
  const std::vector<std::string> remarks = replay.run(config, ports);
  for (const std::string& remark : remarks) fmt::print(stderr, "imu-decode: {}\n", remark);
  measured_.resize(truths_.size());  // a fault of the truth may take measurements away
}

TrueValues TruthBeside::at(const MeasurementRow& row) {
  constexpr std::uint32_t identity = Measurement::time | Measurement::counter;
  const std::size_t end = std::min(measured_.size(), next_ + most_skipped);
  is_by_order_ = (row.fields & identity) == 0;
  for (std::size_t i = next_; i < end; ++i) {
    if (measured_[i] != Identity{row.time_ns, row.counter}) continue;
    next_ = i + 1;
    ++with_;
    return truths_[i].values;
  }
  ++without_;
  return {};
}

std::string TruthBeside::finish() const {
  if (with_ == 0 && without_ > 0)
    throw std::runtime_error(fmt::format(
        "--truth {} {}: no sample is one of a replay of this; give the record of the run that was decoded, or the "
        "configuration and the capture of the `imud replay`",
        options_.config, options_.capture));
  if (without_ > 0) return fmt::format("{} samples have none, of {}", without_, with_ + without_);
  if (is_by_order_ && with_ != measured_.size())
    return fmt::format("by order, as the samples have neither time nor number, but there are {}, and {} in a replay",
                       with_, measured_.size());
  return {};
}

}  // namespace imud
