#include "emulator/report/outcome.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "emulator/ground/plural.hpp"
#include "emulator/report/summary.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

bool is_of_others(Refusal refusal) { return refusal == Refusal::other_stream || refusal == Refusal::foreign_sender; }

// Truths of other vehicles and senders do not belong to this run. A truth that the network has repeated is in the
// run already.
std::uint64_t refused_truths(const Summary::Truth& truth) {
  std::uint64_t refused = 0;
  for (std::size_t i = 0; i < truth.refused.counts.size(); ++i)
    if (!is_of_others(static_cast<Refusal>(i))) refused += truth.refused.counts[i];
  return refused - truth.counters[&TruthCounters::repeated];
}

std::string causes(const Summary::Truth& truth) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < truth.refused.counts.size(); ++i) {
    const auto refusal = static_cast<Refusal>(i);
    std::uint64_t n = truth.refused.counts[i];
    if (refusal == Refusal::duplicate) n -= truth.counters[&TruthCounters::repeated];
    if (n > 0 && !is_of_others(refusal)) all.push_back(fmt::format("{} {}", n, cause(refusal)));
  }
  return fmt::format("{}", fmt::join(all, ", "));
}

void judge_end(EndedBy ended_by, std::vector<std::string>& shortfalls) {
  if (ended_by == EndedBy::control) shortfalls.emplace_back("a command ended it before the capture's end");
  if (ended_by == EndedBy::signal) shortfalls.emplace_back("a signal ended it before the capture's end");
  if (ended_by == EndedBy::duration) shortfalls.emplace_back("--for ended it before the capture's end");
}

// `gaps_allowed`: a requirement limits the gaps. `is_faulty`: faults of truth are configured.
void judge_capture(const Summary::Truth& truth, bool gaps_allowed, bool is_faulty,
                   std::vector<std::string>& shortfalls) {
  const auto no_numbers = is_faulty ? truth.refused.counts[static_cast<std::size_t>(Refusal::not_finite)] : 0;
  if (refused_truths(truth) > no_numbers)
    shortfalls.push_back(fmt::format("{} refused ({})", plural(refused_truths(truth), "truth"), causes(truth)));
  if (const auto n = truth.counters[&TruthCounters::lost]; n > 0 && !is_faulty)
    shortfalls.push_back(fmt::format("{} missing by the sequence numbers", plural(n, "truth")));
  if (const auto n = truth.counters[&TruthCounters::gaps]; n > 0 && !gaps_allowed && !is_faulty)
    shortfalls.push_back(
        fmt::format("{} in the truth's time, of up to {:.3f} s", plural(n, "gap"), truth.longest_gap_s));
  if (!truth.warning.empty())
    shortfalls.push_back(fmt::format("the capture is {}", truth.warning));
  else if (const auto n = truth.counters[&TruthCounters::truncated]; n > 0)
    shortfalls.push_back(fmt::format("{} cut short", plural(n, "record")));
}

// Returns true if a pty is the line of the imu: unread frames are discarded, as on a real line.
bool is_emulated_line(const ImuConfig& imu) {
  const auto is_emulated = [](const std::string& port) {
    const Transport* transport = transport_of(port);
    return transport != nullptr && transport->uart == Uart::emulated;
  };
  return is_emulated(imu.port) && (imu.second_port.empty() || is_emulated(imu.second_port));
}

// Returns the count that is 100 % for a figure.
std::uint64_t whole(const Summary& summary, std::string_view figure) {
  if (figure.starts_with("truth.")) return summary.truth.counters[&TruthCounters::received];
  const std::size_t dot = figure.rfind('.');
  const std::string samples = dot == figure.npos ? "samples" : fmt::format("{}.samples", figure.substr(0, dot));
  return find_count(summary, samples).value_or(0);
}

}  // namespace

std::string_view word(EndedBy ended_by) noexcept {
  switch (ended_by) {
    case EndedBy::end_of_capture:
      return "end_of_capture";
    case EndedBy::duration:
      return "for";
    case EndedBy::signal:
      return "signal";
    case EndedBy::control:
      return "control";
    case EndedBy::failure:
      break;
  }
  return "failure";
}

std::string Outcome::Required::seen_text() const { return seen ? std::to_string(*seen) : "not known"; }

int Outcome::exit_code() const noexcept {
  if (ended_by == EndedBy::failure) return 1;
  bool good = is_complete();
  for (const Required& limit : required) good = good && limit.holds;
  for (const Expected& one : expected) good = good && one.holds;
  return good ? 0 : 3;
}

void Outcome::judge_faults(std::vector<FaultOutcome> all, bool is_repeated) {
  faults = std::move(all);
  if (is_repeated || (ended_by != EndedBy::end_of_capture && ended_by != EndedBy::duration)) return;
  for (const FaultOutcome& fault : faults)
    if (std::string text = fault.shortfall(); !text.empty()) shortfalls.push_back(std::move(text));
}

void check_figures(std::span<const Requirement> requirements, const Config& config) {
  if (requirements.empty()) return;
  Summary names;
  const Epoch epoch = epoch_of(config);
  if (epoch != Epoch::none) names.clock.emplace();
  if (epoch == Epoch::tai || epoch == Epoch::utc) names.clock->state.emplace();
  for (const ImuConfig& imu : config.imus)
    names.imus.push_back({imu.name, {}, device_counts(DeviceCounters(imu.protocol->counters)), 0, {}});
  for (const Requirement& requirement : requirements) {
    if (find_count(names, requirement.figure)) continue;
    if (epoch == Epoch::monotonic &&
        std::ranges::find(clock_count_names, requirement.figure) != clock_count_names.end())
      throw RequirementError(
          fmt::format("\"{}\": realtime.epoch = \"monotonic\" is this host's own clock, which nothing synchronises, "
                      "so there is no figure {}; leave it out, or use epoch = \"tai\" or \"utc\"",
                      requirement.text, requirement.figure));
    throw RequirementError(fmt::format("\"{}\": there is no figure {}; there are {}", requirement.text,
                                       requirement.figure, fmt::join(count_names(names), ", ")));
  }
}

Outcome judge(const Summary& summary, const Config& config, EndedBy ended_by,
              std::span<const Requirement> requirements, bool is_repeated) {
  Outcome outcome{ended_by, {}, {}, {}, {}};
  std::vector<std::string>& shortfalls = outcome.shortfalls;
  const bool capture = is_capture(config.truth.port);
  const bool gaps_allowed = std::any_of(requirements.begin(), requirements.end(),
                                        [](const Requirement& limit) { return limit.figure == "truth.gaps"; });
  const bool is_faulty = std::any_of(config.faults.begin(), config.faults.end(),
                                     [](const FaultConfig& f) { return f.acts_on(fault_of_truth); });
  if (capture) judge_end(ended_by, shortfalls);
  if (capture && !is_repeated) judge_capture(summary.truth, gaps_allowed, is_faulty, shortfalls);
  if (is_repeated && !summary.truth.warning.empty())
    shortfalls.push_back(fmt::format("the record is {}", summary.truth.warning));
  for (std::size_t i = 0; i < summary.imus.size(); ++i) {
    const Summary::Imu& imu = summary.imus[i];
    const std::uint64_t dropped = imu.counters[&ImuCounters::dropped], failed = imu.counters[&ImuCounters::failed];
    if (failed > 0)
      shortfalls.push_back(fmt::format("{}: {} lost to errors of the file", imu.name, plural(failed, "frame")));
    if (const auto n = imu.counters[&ImuCounters::skipped]; capture && !is_repeated && n > 0)
      shortfalls.push_back(fmt::format("{}: {} skipped", imu.name, plural(n, "sample")));
    const bool may_be_unread = config.clock == ClockMode::realtime && is_emulated_line(config.imus[i]);
    if (capture && !may_be_unread && dropped > failed)
      shortfalls.push_back(fmt::format("{}: {} dropped", imu.name, plural(dropped - failed, "frame")));
  }
  if (const auto n = summary.record[&RecordCounters::lost]; n > 0)
    shortfalls.push_back(fmt::format("{} missing in the record", plural(n, "packet")));
  if (capture && !is_repeated && ended_by == EndedBy::end_of_capture &&
      summary.truth.counters[&TruthCounters::accepted] == 0) {
    outcome.ended_by = EndedBy::failure;
    if (refused_truths(summary.truth) == 0)
      shortfalls.push_back(fmt::format("there is no truth of the format {}", config.truth.format->name));
  }
  for (const Requirement& requirement : requirements) {
    const std::optional<std::uint64_t> seen = find_count(summary, requirement.figure);
    const bool holds = seen && requirement.holds(static_cast<double>(*seen),
                                                 static_cast<double>(whole(summary, requirement.figure)));
    outcome.required.push_back({requirement, seen, holds});
  }
  return outcome;
}

}  // namespace imud
