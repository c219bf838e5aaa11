#include "emulator/seeds/seed_run.hpp"

#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>

#include "emulator/engine/closing.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/truth/remark_text.hpp"
#include "transports/host_clock.hpp"

namespace imud {

std::optional<StoredTruths> store_truths(const TruthConfig& config) {
  constexpr std::size_t most = 500'000;
  const std::string path = config.port.substr(config.port.find(':') + 1);
  std::error_code error;
  const bool can_read_again = std::filesystem::is_regular_file(path.substr(0, path.find('?')), error);
  return StoredTruths::read(config, can_read_again ? most : std::numeric_limits<std::size_t>::max());
}

void SeedRun::run(const Config& config, const Ports& ports, const std::atomic<bool>& stop,
                  const std::function<void(Engine& engine, const std::string& difference)>& end) const {
  const Ports with_truth = [&](const PortUse& use) {
    return use.of != PortUse::Of::truth ? ports(use) : truths != nullptr ? truths->open() : real_ports(use);
  };
  Assembly assembly(config, with_truth, {.repeats = repeats, .sink = *sink});
  if (begin) begin(assembly.engine());
  MonotonicHost host;
  assembly.run(host, stop, limits);
  drain(assembly.engine(), readers);
  assembly.engine().finish_faults();
  end(assembly.engine(), assembly.difference());
}

Summary judge_run(Engine& engine, const SeedJudgement& run, const std::string& difference) {
  RunCounters counters{&engine.intake().counters(), &engine.quality(), {}};
  for (const auto& channel : run.channels) counters.imus.emplace_back(channel->name, &channel->counters);
  Summary summary =
      summarize(counters, seconds(host_now() - run.begin), {run.line_loads.begin(), run.line_loads.end()});
  summary.truth.warning = engine.intake().end_warning();
  summary.truth.remarks = remarks(*counters.truth);
  const EndedBy ended_by = engine.intake().at_end() ? EndedBy::end_of_capture
                           : run.is_stopped         ? EndedBy::signal
                                                    : EndedBy::duration;
  Outcome outcome = judge(summary, run.config, ended_by, run.required, run.repeats);
  if (!difference.empty()) outcome.shortfalls.push_back(difference);
  outcome.expected = expected(run.channels);
  summary.whole = {std::move(outcome), run.config.seed, run.config.sha256, {}};
  for (std::size_t i = 0; i < run.config.imus.size(); ++i)
    summary.imus[i].drawn = drawn_terms(run.config.imus[i].model, run.config.seed, run.config.imus[i].name);
  return summary;
}

}  // namespace imud
