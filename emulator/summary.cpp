#include "emulator/summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace imud {

Summary summarize(const Session& session, double duration_s, const std::vector<double>& line_loads) {
  Summary summary;
  summary.duration_s = duration_s;
  const TruthCounters& truth = session.intake().counters();
  summary.truth.received = truth.received;
  summary.truth.accepted = truth.accepted;
  summary.truth.no_state = truth.no_state;
  summary.truth.runs = truth.runs;
  summary.truth.truncated = truth.truncated;
  summary.truth.inserted = truth.inserted;
  summary.truth.lost = truth.lost;
  for (std::size_t i = 0; i < summary.truth.refused.size(); ++i) summary.truth.refused[i] = truth.refused[i];
  const double span_s = 1e-9 * static_cast<double>(truth.newest_ns - truth.first_ns);
  if (span_s > 0) summary.truth.rate_hz = static_cast<double>(summary.truth.accepted - 1) / span_s;

  if (const TruthQuality& quality = session.quality(); quality.known) {
    Summary::Clock& clock = summary.clock.emplace();
    clock.rate = quality.rate;
    clock.offset_s = quality.offset_s;
    clock.delay_s = quality.delay_s;
    clock.stops = quality.stops;
    clock.returns = quality.returns;
    clock.resumed = quality.resumed;
    clock.jitter = quality.jitter;
    clock.age = quality.age;
  }
  for (std::size_t i = 0; i < session.imu_count(); ++i) {
    const ImuCounters& counters = session.imu_counters(i);
    Summary::Imu& imu = summary.imus.emplace_back();
    imu.name = session.imu_name(i);
    imu.samples = counters.samples;
    imu.frames = counters.frames;
    imu.dropped = counters.dropped;
    imu.extrapolated = counters.extrapolated;
    imu.held = counters.held;
    imu.silent = counters.silent;
    imu.missed = counters.missed;
    imu.lateness = counters.lateness;
    imu.write = counters.write;
    imu.line_load_percent = line_loads[i];
  }
  return summary;
}

Summary Summary::since(const Summary& before) const {
  Summary rest = *this;
  rest.duration_s -= before.duration_s;
  rest.truth.received -= before.truth.received;
  rest.truth.accepted -= before.truth.accepted;
  rest.truth.no_state -= before.truth.no_state;
  rest.truth.runs -= before.truth.runs;
  rest.truth.truncated -= before.truth.truncated;
  rest.truth.inserted -= before.truth.inserted;
  rest.truth.lost -= std::min(rest.truth.lost, before.truth.lost);  // one that was overtaken is found again
  for (std::size_t i = 0; i < rest.truth.refused.size(); ++i) rest.truth.refused[i] -= before.truth.refused[i];
  rest.truth.rate_hz = rest.duration_s > 0 ? static_cast<double>(rest.truth.accepted) / rest.duration_s : 0;
  if (rest.clock && before.clock) {
    rest.clock->stops -= before.clock->stops;
    rest.clock->returns -= before.clock->returns;
    rest.clock->resumed -= before.clock->resumed;
    rest.clock->jitter = clock->jitter.since(before.clock->jitter);
    rest.clock->age = clock->age.since(before.clock->age);
  }
  for (std::size_t i = 0; i < rest.imus.size(); ++i) {
    Imu& imu = rest.imus[i];
    const Imu& then = before.imus[i];
    imu.samples -= then.samples;
    imu.frames -= then.frames;
    imu.dropped -= then.dropped;
    imu.extrapolated -= then.extrapolated;
    imu.held -= then.held;
    imu.silent -= then.silent;
    imu.missed -= then.missed;
    imu.lateness = imu.lateness.since(then.lateness);
    imu.write = imu.write.since(then.write);
  }
  return rest;
}

namespace {

double share(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

double lost_share(const Summary::Truth& truth) { return share(truth.lost, truth.lost + truth.accepted); }

std::string late(const DurationHistogram& h) {
  return fmt::format("p50 {:.1f} us, p99 {:.1f} us, p99.9 {:.1f} us, max {:.1f} us", 1e6 * h.percentile(50),
                     1e6 * h.percentile(99), 1e6 * h.percentile(99.9), 1e6 * h.max());
}

// "jitter p99 0.31 ms, age p99 10.2 ms, rate 0.899912, offset +12.1 ms, delay 30.0 ms"
std::string clock_text(const Summary::Clock& clock) {
  return fmt::format("jitter p99 {:.2f} ms, age p99 {:.1f} ms, rate {:.6f}, offset {:+.1f} ms, delay {:.1f} ms",
                     1e3 * clock.jitter.percentile(99), 1e3 * clock.age.percentile(99), clock.rate,
                     1e3 * clock.offset_s, 1e3 * clock.delay_s);
}

}  // namespace

std::string text(const Summary& s) {
  std::string out = fmt::format("ran      {:.3f} s\n", s.duration_s);
  std::vector<std::string> refused;
  for (std::size_t i = 0; i < s.truth.refused.size(); ++i)
    if (s.truth.refused[i] > 0)
      refused.push_back(fmt::format("{} {}", s.truth.refused[i], cause(static_cast<Refusal>(i))));
  out += fmt::format("truth    {} received, {} accepted, {} without state, refused: {}\n", s.truth.received,
                     s.truth.accepted, s.truth.no_state,
                     refused.empty() ? "none" : fmt::format("{}", fmt::join(refused, ", ")));
  if (s.clock) {
    out += fmt::format("         {:.1f} Hz, lost {:.2f} %, {}\n", s.truth.rate_hz, 100 * lost_share(s.truth),
                       clock_text(*s.clock));
    if (s.clock->stops > 0)
      out += fmt::format("         stopped {} times, came back {} times\n", s.clock->stops, s.clock->returns);
    if (s.clock->resumed > 0)
      out += fmt::format("         {} times it had paused or jumped: a new run\n", s.clock->resumed);
  }
  if (s.truth.runs > 1) out += fmt::format("         {} runs: its time began anew\n", s.truth.runs);
  if (!s.truth.warning.empty() || s.truth.truncated > 0)
    out += fmt::format("         {} record{} cut short: {}\n", s.truth.truncated, s.truth.truncated == 1 ? "" : "s",
                       s.truth.warning.empty() ? "left out" : s.truth.warning);
  for (const Summary::Imu& imu : s.imus) {
    out +=
        fmt::format("{:<8} {} samples, {} frames sent, {} dropped", imu.name, imu.samples, imu.frames, imu.dropped);
    if (imu.extrapolated > 0) out += fmt::format(", {} extrapolated, {} held", imu.extrapolated, imu.held);
    if (imu.silent > 0) out += fmt::format(", {} not sent", imu.silent);
    if (imu.lateness.count() > 0) out += fmt::format("; late by {}; {} missed", late(imu.lateness), imu.missed);
    if (imu.line_load_percent > 0) out += fmt::format("; line {:.1f} %", imu.line_load_percent);
    out += "\n";
  }
  return out;
}

std::string line(const Summary& s) {
  std::string out = fmt::format("truth {:.1f} Hz, lost {:.2f} %", s.truth.rate_hz, 100 * lost_share(s.truth));
  if (s.clock) out += ", " + clock_text(*s.clock);
  // One imu as it is; of several the sums, and the worst of each percentile.
  std::uint64_t samples = 0, dropped = 0, missed = 0, extrapolated = 0;
  double p50 = 0, p99 = 0, p999 = 0, max = 0, load = 0;
  bool paced = false;
  for (const Summary::Imu& imu : s.imus) {
    samples += imu.samples;
    dropped += imu.dropped;
    missed += imu.missed;
    extrapolated += imu.extrapolated;
    p50 = std::max(p50, 1e6 * imu.lateness.percentile(50));
    p99 = std::max(p99, 1e6 * imu.lateness.percentile(99));
    p999 = std::max(p999, 1e6 * imu.lateness.percentile(99.9));
    max = std::max(max, 1e6 * imu.lateness.max());
    load = std::max(load, imu.line_load_percent);
    paced = paced || imu.lateness.count() > 0;
  }
  out += fmt::format("; {} {:.1f} Hz", s.imus.size() == 1 ? s.imus[0].name : fmt::format("{} imus", s.imus.size()),
                     s.duration_s > 0 ? static_cast<double>(samples) / s.duration_s : 0.0);
  if (paced)
    out += fmt::format(", late p50 {:.1f} us, p99 {:.1f} us, p99.9 {:.1f} us, max {:.1f} us, missed {}", p50, p99,
                       p999, max, missed);
  out += fmt::format(", dropped {}, extrapolated {:.1f} %", dropped, 100 * share(extrapolated, samples));
  if (load > 0) out += fmt::format(", line {:.1f} %", load);
  return out;
}

namespace {

nlohmann::ordered_json percentiles_us(const DurationHistogram& h) {
  return {{"p50", 1e6 * h.percentile(50)},
          {"p99", 1e6 * h.percentile(99)},
          {"p999", 1e6 * h.percentile(99.9)},
          {"max", 1e6 * h.max()}};
}

}  // namespace

std::string json(const Summary& s, JsonLayout layout) {
  nlohmann::ordered_json truth = {
      {"received", s.truth.received},   {"accepted", s.truth.accepted}, {"refused", nlohmann::ordered_json::object()},
      {"no_state", s.truth.no_state},   {"runs", s.truth.runs},         {"resumed", s.clock ? s.clock->resumed : 0},
      {"truncated", s.truth.truncated}, {"inserted", s.truth.inserted}, {"lost", s.truth.lost},
      {"rate_hz", s.truth.rate_hz}};
  for (std::size_t i = 0; i < s.truth.refused.size(); ++i)
    if (s.truth.refused[i] > 0) truth["refused"][std::string(cause(static_cast<Refusal>(i)))] = s.truth.refused[i];
  if (!s.truth.warning.empty()) truth["warning"] = s.truth.warning;
  if (s.clock) {
    truth["stops"] = s.clock->stops;
    truth["returns"] = s.clock->returns;
    truth["clock_rate"] = s.clock->rate;
    truth["offset_us"] = 1e6 * s.clock->offset_s;
    truth["delay_us"] = 1e6 * s.clock->delay_s;
    truth["jitter_us"] = percentiles_us(s.clock->jitter);
    truth["age_us"] = percentiles_us(s.clock->age);
  }
  nlohmann::ordered_json imus = nlohmann::ordered_json::array();
  for (const Summary::Imu& imu : s.imus) {
    imus.push_back({{"name", imu.name},
                    {"samples", imu.samples},
                    {"frames", imu.frames},
                    {"dropped", imu.dropped},
                    {"extrapolated", imu.extrapolated},
                    {"held", imu.held},
                    {"silent", imu.silent},
                    {"missed", imu.missed},
                    {"lateness_us", percentiles_us(imu.lateness)},
                    {"write_us", percentiles_us(imu.write)}});
    if (imu.line_load_percent > 0) imus.back()["line_load_percent"] = imu.line_load_percent;
  }
  const nlohmann::ordered_json all = {{"duration_s", s.duration_s}, {"truth", truth}, {"imus", imus}};
  return layout == JsonLayout::line ? all.dump() : all.dump(2) + "\n";
}

}  // namespace imud
