#include "emulator/outcome.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>

#include "emulator/summary.hpp"

namespace imud {

namespace {

std::string plural(std::uint64_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

// Truths of other vehicles are no truths of this run.
std::uint64_t refused_truths(const Summary::Truth& truth) {
  return truth.refused.total() - truth.refused.counts[static_cast<std::size_t>(Refusal::other_stream)];
}

std::string causes(const Summary::Truth& truth) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < truth.refused.counts.size(); ++i)
    if (const auto n = truth.refused.counts[i]; n > 0 && static_cast<Refusal>(i) != Refusal::other_stream)
      all.push_back(fmt::format("{} {}", n, cause(static_cast<Refusal>(i))));
  return fmt::format("{}", fmt::join(all, ", "));
}

void judge_capture(const Summary::Truth& truth, EndedBy ended_by, std::vector<std::string>& shortfalls) {
  if (ended_by == EndedBy::signal) shortfalls.emplace_back("a signal ended it before the capture's end");
  if (ended_by == EndedBy::duration) shortfalls.emplace_back("--for ended it before the capture's end");
  if (const auto n = refused_truths(truth); n > 0)
    shortfalls.push_back(fmt::format("{} refused ({})", plural(n, "truth"), causes(truth)));
  if (const auto n = truth.counters[&TruthCounters::lost]; n > 0)
    shortfalls.push_back(fmt::format("{} missing by the sequence numbers", plural(n, "truth")));
  if (const auto n = truth.counters[&TruthCounters::gaps]; n > 0)
    shortfalls.push_back(
        fmt::format("{} in the truth's time, of up to {:.3f} s", plural(n, "gap"), truth.longest_gap_s));
  if (const auto n = truth.counters[&TruthCounters::truncated]; n > 0 || !truth.warning.empty())
    shortfalls.push_back(fmt::format("{} cut short{}{}", plural(n, "record"),
                                     truth.warning.empty() ? "" : ": capture ", truth.warning));
}

// Returns what 100 % is for a figure.
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
    case EndedBy::failure:
      break;
  }
  return "failure";
}

int Outcome::exit_code() const noexcept {
  if (ended_by == EndedBy::failure) return 1;
  bool good = is_complete();
  for (const Required& limit : required) good = good && limit.holds;
  return good ? 0 : 3;
}

void check_figures(std::span<const Requirement> requirements, const Config& config) {
  Summary names;
  for (const ImuConfig& imu : config.imus) names.imus.push_back({imu.name, {}, 0});
  for (const Requirement& requirement : requirements)
    if (!find_count(names, requirement.figure))
      throw std::invalid_argument(fmt::format("\"{}\": there is no figure {}; there are {}", requirement.text,
                                              requirement.figure, fmt::join(count_names(names), ", ")));
}

Outcome judge(const Summary& summary, const Config& config, EndedBy ended_by,
              std::span<const Requirement> requirements) {
  Outcome outcome{ended_by, {}, {}};
  const bool capture = is_capture(config.truth.port);
  if (capture) judge_capture(summary.truth, ended_by, outcome.shortfalls);
  for (const Summary::Imu& imu : summary.imus) {
    const std::uint64_t dropped = imu.counters[&ImuCounters::dropped], failed = imu.counters[&ImuCounters::failed];
    if (failed > 0)
      outcome.shortfalls.push_back(
          fmt::format("{}: {} lost to errors of the file", imu.name, plural(failed, "frame")));
    if (capture && config.clock != ClockMode::realtime && dropped > failed)
      outcome.shortfalls.push_back(fmt::format("{}: {} dropped", imu.name, plural(dropped - failed, "frame")));
  }
  if (capture && ended_by == EndedBy::end_of_capture && summary.truth.counters[&TruthCounters::accepted] == 0) {
    outcome.ended_by = EndedBy::failure;
    outcome.shortfalls.push_back(fmt::format("there is no truth of the format {}", config.truth.format->name));
  }
  for (const Requirement& requirement : requirements) {
    const std::uint64_t seen = find_count(summary, requirement.figure).value_or(0);
    const bool holds =
        requirement.holds(static_cast<double>(seen), static_cast<double>(whole(summary, requirement.figure)));
    outcome.required.push_back({requirement, seen, holds});
  }
  return outcome;
}

}  // namespace imud
