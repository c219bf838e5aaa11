#include "emulator/report/summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace imud {

std::vector<DeviceCount> device_counts(const DeviceCounters& counters) {
  std::vector<DeviceCount> counts;
  for (std::size_t i = 0; i < counters.declared().size(); ++i)
    counts.push_back({counters.declared()[i].key, counters.declared()[i].words, counters.count(i)});
  return counts;
}

Summary summarize(const RunCounters& counters, double duration_s, const std::vector<double>& line_loads) {
  Summary summary;
  summary.duration_s = duration_s;
  const TruthCounters& truth = *counters.truth;
  summary.truth.counters = Snapshot(truth);
  summary.truth.refused = Snapshot(truth.refused);
  summary.truth.has_clock = counters.quality->known;
  summary.truth.quality = Snapshot(*counters.quality);
  const auto& error = counters.quality->extrapolation_error;
  summary.truth.extrapolation_error = {error.samples, error.ahead_s, error.rate_rad_per_s,
                                       error.specific_force_m_per_s2};
  summary.truth.has_fit = truth.fit.known.load(std::memory_order_acquire);
  summary.truth.fit = Snapshot(truth.fit);
  const double span_s = 1e-9 * static_cast<double>(truth.newest_ns - truth.first_ns);
  const std::uint64_t accepted = summary.truth.counters[&TruthCounters::accepted];
  summary.truth.longest_gap_s = 1e-9 * static_cast<double>(truth.longest_gap_ns);
  summary.simulated_s = 1e-9 * static_cast<double>(truth.simulated_ns);
  if (const double progress = truth.progress; progress >= 0) summary.truth.progress = progress;
  if (span_s > 0) summary.truth.rate_hz = static_cast<double>(accepted - 1) / span_s;
  for (std::size_t i = 0; i < counters.imus.size(); ++i) {
    const auto& [name, imu] = counters.imus[i];
    summary.imus.push_back({name, Snapshot(*imu), device_counts(imu->device), line_loads[i], {}});
    if (const std::int64_t k = imu->first_k; k >= 0) summary.imus.back().first_k = static_cast<std::uint64_t>(k);
  }
  summary.has_record = counters.record != nullptr;
  if (summary.has_record) summary.record = Snapshot(*counters.record);
  summary.has_control = counters.control != nullptr;
  if (summary.has_control) summary.control = Snapshot(*counters.control);
  return summary;
}

Summary Summary::since(const Summary& before) const {
  Summary rest = *this;
  rest.duration_s -= before.duration_s;
  rest.simulated_s -= before.simulated_s;
  rest.truth.counters.subtract(before.truth.counters);
  rest.truth.refused.subtract(before.truth.refused);
  rest.truth.quality.subtract(before.truth.quality);
  rest.record.subtract(before.record);
  rest.control.subtract(before.control);
  if (rest.clock && before.clock) rest.clock->counters.subtract(before.clock->counters);
  const auto accepted = static_cast<double>(rest.truth.counters[&TruthCounters::accepted]);
  rest.truth.rate_hz = rest.duration_s > 0 ? accepted / rest.duration_s : 0;
  for (std::size_t i = 0; i < rest.imus.size(); ++i) {
    rest.imus[i].counters.subtract(before.imus[i].counters);
    for (std::size_t k = 0; k < rest.imus[i].device.size(); ++k)
      rest.imus[i].device[k].count -= before.imus[i].device[k].count;
  }
  return rest;
}

namespace {

// Returns the value of the group's counter `key`; nullopt if there is none.
template <class Group>
std::optional<std::uint64_t> count_of(const Snapshot<Group>& snapshot, std::string_view key) {
  const auto& declared = snapshot.declared().counters;
  for (std::size_t i = 0; i < declared.size(); ++i)
    if (declared[i]->info.key == key) return snapshot.counts[i];
  return std::nullopt;
}

}  // namespace

std::optional<std::uint64_t> find_count(const Summary& summary, std::string_view name) {
  constexpr std::string_view truth = "truth.", refused = "refused.", record = "record.", control = "control.";
  if (summary.clock && name.starts_with("clock.")) return find_count(*summary.clock, name);
  if (name.starts_with(record)) return count_of(summary.record, name.substr(record.size()));
  if (name.starts_with(control)) return count_of(summary.control, name.substr(control.size()));
  if (name == "truth.refused") return summary.truth.refused.total();
  if (name.starts_with(truth)) {
    name.remove_prefix(truth.size());
    if (name.starts_with(refused)) return count_of(summary.truth.refused, name.substr(refused.size()));
    const auto count = count_of(summary.truth.counters, name);
    return count ? count : count_of(summary.truth.quality, name);
  }
  const std::size_t dot = name.rfind('.');
  const std::string_view key = dot == name.npos ? name : name.substr(dot + 1);
  std::optional<std::uint64_t> sum;
  for (const Summary::Imu& imu : summary.imus) {
    if (dot != name.npos && imu.name != name.substr(0, dot)) continue;
    if (const auto count = count_of(imu.counters, key)) sum = sum.value_or(0) + *count;
    for (const DeviceCount& figure : imu.device)
      if (figure.key == key) sum = sum.value_or(0) + figure.count;
  }
  return sum;
}

std::vector<std::string> count_names(const Summary& summary) {
  std::vector<std::string> names;
  const auto add = [&names](std::string_view prefix, const auto& snapshot) {
    for (const Counter* counter : snapshot.declared().counters)
      names.push_back(fmt::format("{}{}", prefix, counter->info.key));
  };
  add("", Snapshot<ImuCounters>());
  for (const Summary::Imu& imu : summary.imus)
    for (const DeviceCount& figure : imu.device)
      if (std::find(names.begin(), names.end(), figure.key) == names.end()) names.emplace_back(figure.key);
  add("truth.", summary.truth.counters);
  names.emplace_back("truth.refused");
  add("truth.refused.", summary.truth.refused);
  add("truth.", summary.truth.quality);
  add("record.", summary.record);
  add("control.", summary.control);
  for (const std::string_view name : clock_count_names)
    if (summary.clock && find_count(*summary.clock, name)) names.emplace_back(name);
  return names;
}

namespace {

struct Percentiles {
  double p50_us = 0, p99_us = 0, p999_us = 0, max_us = 0;

  Percentiles() = default;
  explicit Percentiles(const DurationHistogram& durations)
      : p50_us(1e6 * durations.percentile(50)),
        p99_us(1e6 * durations.percentile(99)),
        p999_us(1e6 * durations.percentile(99.9)),
        max_us(1e6 * durations.max()) {}
  std::string text() const {
    return fmt::format("p50 {:.1f} us, p99 {:.1f} us, p99.9 {:.1f} us, max {:.1f} us", p50_us, p99_us, p999_us,
                       max_us);
  }
  nlohmann::ordered_json json() const {
    return {{"p50", p50_us}, {"p99", p99_us}, {"p999", p999_us}, {"max", max_us}};
  }
};

Percentiles worse(const Percentiles& a, const Percentiles& b) {
  Percentiles worst;
  for (const auto member : {&Percentiles::p50_us, &Percentiles::p99_us, &Percentiles::p999_us, &Percentiles::max_us})
    worst.*member = std::max(a.*member, b.*member);
  return worst;
}

double share(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

// Returns "100.0 Hz, lost 0.20 %, jitter p99 0.31 ms, age p99 10.2 ms, rate 0.899912, offset +12.1 ms, delay 30.0 ms"
std::string rate_text(const Summary::Truth& truth) {
  const std::uint64_t lost = truth.counters[&TruthCounters::lost];
  std::string out = fmt::format("{:.1f} Hz, lost {:.2f} %", truth.rate_hz,
                                100 * share(lost, lost + truth.counters[&TruthCounters::accepted]));
  const auto& quality = truth.quality;
  if (truth.has_clock)
    out += fmt::format(", jitter p99 {:.2f} ms, age p99 {:.1f} ms, rate {:.6f}, offset {:+.1f} ms, delay {:.1f} ms",
                       1e3 * quality[&TruthQuality::jitter].percentile(99),
                       1e3 * quality[&TruthQuality::age].percentile(99), quality[&TruthQuality::rate],
                       1e3 * quality[&TruthQuality::offset_s], 1e3 * quality[&TruthQuality::delay_s]);
  return out;
}

// Returns the counters that the summary or the log (`where`) shows: "2001 samples, 1999 frames sent, 2 dropped".
template <class Group>
std::string counts_text(const Snapshot<Group>& snapshot, Show CounterInfo::*where) {
  std::vector<std::string> shown;
  const auto& declared = snapshot.declared().counters;
  for (std::size_t i = 0; i < declared.size(); ++i)
    if (const CounterInfo& info = declared[i]->info; is_shown(info.*where, snapshot.counts[i]))
      shown.push_back(fmt::format("{} {}", snapshot.counts[i], info.words));
  return fmt::format("{}", fmt::join(shown, ", "));
}

// Returns the lines that state how the run ended.
std::string text(const Outcome& outcome) {
  std::string out =
      fmt::format("ended    by {}, {}{}\n", word(outcome.ended_by),
                  outcome.is_complete() ? "complete" : "incomplete: ", fmt::join(outcome.shortfalls, "; "));
  for (const Outcome::Required& limit : outcome.required)
    out += fmt::format("required {}: {}, {}\n", limit.requirement.text, limit.holds ? "holds" : "VIOLATED",
                       limit.seen_text());
  for (const FaultOutcome& fault : outcome.faults)
    if (!fault.has_begun())
      out += fmt::format("fault    {}: {}\n", fault.name,
                         fault.is_passed_over ? "passed over by a leap of the simulation's time" : "has never begun");
    else if (fault.lost > 0)
      out += fmt::format("fault    {}: {} of {} occurrences have no label: the log of faults is full\n", fault.name,
                         fault.lost, fault.occurrences);
  for (const Expected& one : outcome.expected)
    out += fmt::format("expected {}: {}: {}, {}\n", one.name, one.text, one.holds ? "holds" : "FAILED", one.seen);
  return out;
}

}  // namespace

std::string extrapolation_text(double ahead_s, double rate_rad_per_s, double specific_force_m_per_s2) {
  return fmt::format(
      "extrapolated by up to {:.1f} ms; at this truth rate and motion the rate error was up to {:.2g} rad/s and that "
      "of "
      "the specific force up to {:.2g} m/s^2",
      1e3 * ahead_s, rate_rad_per_s, specific_force_m_per_s2);
}

bool is_noticeable(double rate_rad_per_s, double specific_force_m_per_s2) noexcept {
  constexpr double rate = 1e-3, force = 1e-2;
  return rate_rad_per_s > rate || specific_force_m_per_s2 > force;
}

std::string fit_text(const Snapshot<FitFigures>& fit) {
  std::string out;
  const auto add = [&](std::string_view what, double noise, std::string_view unit, double shortest, double mean,
                       double longest, double left, std::string_view derived_unit) {
    if (mean == 0) return;
    std::string delays = fmt::format("{:.4g}", 1e3 * shortest);
    if (const std::string to = fmt::format("{:.4g}", 1e3 * longest); to != delays)
      delays += fmt::format(" to {} (mean {:.4g})", to, 1e3 * mean);
    out += fmt::format("{}{} of poses with {:.2g} {} of noise, over {} ms to either side: {:.2g} {} of it",
                       out.empty() ? "" : "; ", what, 1e3 * noise, unit, delays, left, derived_unit);
  };
  using F = FitFigures;
  add("rate", fit[&F::attitude_noise], "mrad", fit[&F::rate_shortest], fit[&F::rate_mean], fit[&F::rate_longest],
      fit[&F::rate_noise], "rad/s");
  add("force", fit[&F::place_noise], "mm", fit[&F::force_shortest], fit[&F::force_mean], fit[&F::force_longest],
      fit[&F::force_noise], "m/s^2");
  return out;
}

std::string text(const Summary& s) {
  constexpr auto where = &CounterInfo::summary;
  std::string out = fmt::format("ran      {:.3f} s, simulated {:.3f} s\n", s.duration_s, s.simulated_s);
  const std::string refused = counts_text(s.truth.refused, where), quality = counts_text(s.truth.quality, where);
  out += fmt::format("truth    {}, refused: {}\n", counts_text(s.truth.counters, where),
                     refused.empty() ? "none" : refused);
  if (s.truth.has_clock) out += fmt::format("         {}\n", rate_text(s.truth));
  if (!quality.empty()) out += fmt::format("         {}\n", quality);
  if (const auto& error = s.truth.extrapolation_error; error.samples > 0)
    out += fmt::format("         {}\n",
                       extrapolation_text(error.ahead_s, error.rate_rad_per_s, error.specific_force_m_per_s2));
  if (s.truth.has_fit) out += fmt::format("         {}\n", fit_text(s.truth.fit));
  if (!s.truth.warning.empty()) out += fmt::format("         warning: {}\n", s.truth.warning);
  for (const Summary::Imu& imu : s.imus) {
    out += fmt::format("{:<8} {}", imu.name, counts_text(imu.counters, where));
    for (const DeviceCount& figure : imu.device)
      if (figure.count > 0) out += fmt::format(", {} {}", figure.count, figure.words);
    const DurationHistogram& lateness = imu.counters[&ImuCounters::lateness];
    if (lateness.count() > 0) out += fmt::format("; late by {}", Percentiles(lateness).text());
    if (const DurationHistogram& replies = imu.counters[&ImuCounters::reply]; replies.count() > 0)
      out += fmt::format("; replies after {}", Percentiles(replies).text());
    if (imu.line_load_percent > 0) out += fmt::format("; line {:.1f} %", imu.line_load_percent);
    if (imu.first_k) out += fmt::format("; first k {}", *imu.first_k);
    out += "\n";
    for (const DrawnTerms& drawn : imu.drawn) {
      std::vector<std::string> terms;
      for (const auto& [name, values] : drawn.terms)
        terms.push_back(fmt::format("{} [{:.3g}]", name, fmt::join(values, ", ")));
      out += fmt::format("         {}, drawn {}, SI: {}\n", drawn.sensor,
                         drawn.layer == "unit" ? "for the unit" : "at power on", fmt::join(terms, ", "));
    }
  }
  if (s.clock) out += fmt::format("{:<8} {}\n", "clock", text(*s.clock));
  if (s.has_record) out += fmt::format("{:<8} {}\n", "record", counts_text(s.record, where));
  if (s.control.total() > 0) out += fmt::format("{:<8} {}\n", "control", counts_text(s.control, where));
  if (s.whole) out += text(s.whole->outcome);
  return out;
}

std::string line(const Summary& s) {
  constexpr auto where = &CounterInfo::log;
  std::string out = fmt::format("truth {}", rate_text(s.truth));
  if (const std::string counts = counts_text(s.truth.counters, where); !counts.empty()) out += ", " + counts;
  if (const std::string counts = counts_text(s.truth.refused, where); !counts.empty()) out += ", refused: " + counts;
  // The line has the figures of a single imu, or the sums of the counts of several with the worst of each percentile.
  Snapshot<ImuCounters> sums;
  Percentiles lateness;
  double load = 0;
  bool paced = false;
  for (const Summary::Imu& imu : s.imus) {
    for (std::size_t i = 0; i < sums.counts.size(); ++i) sums.counts[i] += imu.counters.counts[i];
    const DurationHistogram& durations = imu.counters[&ImuCounters::lateness];
    lateness = worse(lateness, Percentiles(durations));
    paced = paced || durations.count() > 0;
    load = std::max(load, imu.line_load_percent);
  }
  const std::uint64_t samples = sums[&ImuCounters::samples];
  out += fmt::format("; {} {:.1f} Hz", s.imus.size() == 1 ? s.imus[0].name : fmt::format("{} imus", s.imus.size()),
                     s.duration_s > 0 ? static_cast<double>(samples) / s.duration_s : 0.0);
  if (paced) out += fmt::format(", late {}", lateness.text());
  if (s.clock && s.clock->state) out += ", " + clock_error_text(*s.clock);
  out += fmt::format(", {}, extrapolated {:.1f} %", counts_text(sums, where),
                     100 * share(sums[&ImuCounters::extrapolated], samples));
  if (load > 0) out += fmt::format(", line {:.1f} %", load);
  if (const std::string counts = counts_text(s.record, where); !counts.empty()) out += ", record: " + counts;
  return out;
}

namespace {

template <class Group>
void add_counts(nlohmann::ordered_json& json, const Snapshot<Group>& snapshot, Show show = Show::always) {
  const auto& declared = snapshot.declared().counters;
  for (std::size_t i = 0; i < declared.size(); ++i)
    if (is_shown(show, snapshot.counts[i])) json[std::string(declared[i]->info.key)] = snapshot.counts[i];
}

template <class Group>
void add_estimates(nlohmann::ordered_json& json, const Snapshot<Group>& snapshot) {
  const auto& [levels, durations] = std::tie(snapshot.declared().levels, snapshot.declared().durations);
  for (std::size_t i = 0; i < levels.size(); ++i)
    json[std::string(levels[i]->key)] = levels[i]->scale * snapshot.levels[i];
  for (std::size_t i = 0; i < durations.size(); ++i)
    json[std::string(durations[i]->key)] = Percentiles(snapshot.durations[i]).json();
}

void add(nlohmann::ordered_json& json, const Summary::Whole& whole) {
  const Outcome& outcome = whole.outcome;
  json["exit_code"] = outcome.exit_code();
  json["complete"] = outcome.is_complete();
  json["ended_by"] = word(outcome.ended_by);
  json["shortfalls"] = outcome.shortfalls;
  json["required"] = nlohmann::ordered_json::array();
  for (const Outcome::Required& limit : outcome.required)
    json["required"].push_back({{"limit", limit.requirement.text},
                                {"seen", limit.seen ? nlohmann::ordered_json(*limit.seen) : nlohmann::ordered_json()},
                                {"holds", limit.holds}});
  json["expected"] = nlohmann::ordered_json::array();
  for (const Expected& one : outcome.expected)
    json["expected"].push_back({{"name", one.name}, {"text", one.text}, {"holds", one.holds}, {"seen", one.seen}});
  json["faults"] = nlohmann::ordered_json::array();
  for (const FaultOutcome& fault : outcome.faults)
    json["faults"].push_back(
        {{"name", fault.name}, {"occurrences", fault.occurrences}, {"began", fault.has_begun()}});
  json["version"] = IMUD_VERSION;
  json["seed"] = whole.seed;
  json["config_sha256"] = whole.config_sha256;
  json["chosen_ports"] = nlohmann::ordered_json::object();
  for (const auto& [key, port] : whole.chosen_ports) json["chosen_ports"][key] = port;
}

}  // namespace

std::string json(const Summary& s, JsonLayout layout) {
  nlohmann::ordered_json truth, refused = nlohmann::ordered_json::object();
  add_counts(truth, s.truth.counters);
  add_counts(refused, s.truth.refused, Show::if_not_zero);
  truth["refused"] = refused;
  add_counts(truth, s.truth.quality);
  truth["longest_gap_s"] = s.truth.longest_gap_s;
  truth["rate_hz"] = s.truth.rate_hz;
  if (s.truth.progress) truth["progress"] = *s.truth.progress;
  if (!s.truth.warning.empty()) truth["warning"] = s.truth.warning;
  if (!s.truth.remarks.empty()) truth["remarks"] = s.truth.remarks;
  if (s.truth.has_clock) {
    add_estimates(truth, s.truth.quality);
    truth["delay_ms"] = 1e3 * s.truth.quality[&TruthQuality::delay_s];
    const auto& error = s.truth.extrapolation_error;
    truth["extrapolation_error"] = {{"samples", error.samples},
                                    {"ahead_ms", 1e3 * error.ahead_s},
                                    {"rate_rad_per_s", error.rate_rad_per_s},
                                    {"specific_force_m_per_s2", error.specific_force_m_per_s2}};
  }
  if (s.truth.has_fit) add_estimates(truth["fit"], s.truth.fit);

  nlohmann::ordered_json imus = nlohmann::ordered_json::array();
  for (const Summary::Imu& imu : s.imus) {
    nlohmann::ordered_json& object = imus.emplace_back();
    object["name"] = imu.name;
    add_counts(object, imu.counters);
    for (const DeviceCount& figure : imu.device) object[std::string(figure.key)] = figure.count;
    add_estimates(object, imu.counters);
    if (imu.line_load_percent > 0) object["line_load_percent"] = imu.line_load_percent;
    if (imu.first_k) object["first_k"] = *imu.first_k;
    for (const DrawnTerms& drawn : imu.drawn)
      for (const auto& [name, values] : drawn.terms)
        object["drawn"][std::string(drawn.sensor)][std::string(drawn.layer)][name] = values;
  }
  nlohmann::ordered_json all = {{"duration_s", s.duration_s}, {"simulated_s", s.simulated_s}};
  if (s.whole) add(all, *s.whole);
  all["truth"] = truth;
  all["imus"] = imus;
  if (s.clock) all["clock"] = json(*s.clock);
  if (s.has_record) add_counts(all["record"], s.record);
  if (s.has_control) add_counts(all["control"], s.control);
  // The path of a file, in the words of a shortfall, may be no UTF-8.
  constexpr auto replace = nlohmann::ordered_json::error_handler_t::replace;
  return layout == JsonLayout::line ? all.dump(-1, ' ', false, replace) : all.dump(2, ' ', false, replace) + "\n";
}

}  // namespace imud
