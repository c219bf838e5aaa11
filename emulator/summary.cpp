#include "emulator/summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

namespace imud {

Summary summarize(const Session& session, double duration_s) {
  Summary summary;
  summary.duration_s = duration_s;
  const TruthCounters& truth = session.intake().counters();
  summary.truth.received = truth.received;
  summary.truth.accepted = truth.accepted;
  summary.truth.no_state = truth.no_state;
  summary.truth.runs = truth.runs;
  summary.truth.resumed = truth.resumed;
  summary.truth.truncated = truth.truncated;
  summary.truth.warning = session.intake().end_warning();
  for (std::size_t i = 0; i < truth.refused.size(); ++i)
    if (const std::uint64_t n = truth.refused[i]; n > 0)
      summary.truth.refused.emplace(cause(static_cast<Refusal>(i)), n);
  for (std::size_t i = 0; i < session.imu_count(); ++i) {
    const ImuCounters& counters = session.imu_counters(i);
    Summary::Imu imu;
    imu.name = session.imu_name(i);
    imu.samples = counters.samples;
    imu.frames = counters.frames;
    imu.dropped = counters.dropped;
    imu.extrapolated = counters.extrapolated;
    imu.held = counters.held;
    imu.p50_us = 1e6 * counters.lateness.percentile(50);
    imu.p99_us = 1e6 * counters.lateness.percentile(99);
    imu.p999_us = 1e6 * counters.lateness.percentile(99.9);
    imu.max_us = 1e6 * counters.lateness.max();
    summary.imus.push_back(std::move(imu));
  }
  return summary;
}

std::string text(const Summary& s) {
  std::string out = fmt::format("ran      {:.3f} s\n", s.duration_s);
  std::vector<std::string> refused;
  for (const auto& [cause, n] : s.truth.refused) refused.push_back(fmt::format("{} {}", n, cause));
  out += fmt::format("truth    {} received, {} accepted, {} without state, refused: {}\n", s.truth.received,
                     s.truth.accepted, s.truth.no_state, refused.empty() ? "none" : fmt::format("{}", fmt::join(refused, ", ")));
  if (s.truth.runs > 1) out += fmt::format("         {} runs: its time began anew\n", s.truth.runs);
  if (s.truth.resumed > 0) out += fmt::format("         {} times it paused, ran slow or jumped\n", s.truth.resumed);
  if (!s.truth.warning.empty() || s.truth.truncated > 0)
    out += fmt::format("         {} record{} cut short: {}\n", s.truth.truncated, s.truth.truncated == 1 ? "" : "s",
                       s.truth.warning.empty() ? "left out" : s.truth.warning);
  for (const Summary::Imu& imu : s.imus) {
    out += fmt::format("{:<8} {} samples, {} frames sent, {} dropped", imu.name, imu.samples, imu.frames, imu.dropped);
    if (imu.extrapolated > 0) out += fmt::format(", {} extrapolated, {} held", imu.extrapolated, imu.held);
    if (imu.max_us > 0.0)
      out += fmt::format("; late by p50 {:.1f} us, p99 {:.1f} us, p99.9 {:.1f} us, max {:.1f} us", imu.p50_us,
                         imu.p99_us, imu.p999_us, imu.max_us);
    out += "\n";
  }
  return out;
}

std::string json(const Summary& s) {
  nlohmann::ordered_json truth = {{"received", s.truth.received},   {"accepted", s.truth.accepted},
                                  {"refused", nlohmann::ordered_json::object()}, {"no_state", s.truth.no_state},
                                  {"runs", s.truth.runs},           {"resumed", s.truth.resumed},
                                  {"truncated", s.truth.truncated}};
  for (const auto& [cause, n] : s.truth.refused) truth["refused"][cause] = n;
  if (!s.truth.warning.empty()) truth["warning"] = s.truth.warning;
  nlohmann::ordered_json imus = nlohmann::ordered_json::array();
  for (const Summary::Imu& imu : s.imus)
    imus.push_back({{"name", imu.name},
                    {"samples", imu.samples},
                    {"frames", imu.frames},
                    {"dropped", imu.dropped},
                    {"extrapolated", imu.extrapolated},
                    {"held", imu.held},
                    {"lateness_us",
                     {{"p50", imu.p50_us}, {"p99", imu.p99_us}, {"p999", imu.p999_us}, {"max", imu.max_us}}}});
  return nlohmann::ordered_json{{"duration_s", s.duration_s}, {"truth", truth}, {"imus", imus}}.dump(2) + "\n";
}

}  // namespace imud
