#include "tools/stream_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "emulator/ground/plural.hpp"
#include "tools/duration_text.hpp"

namespace imud {
namespace {

// Returns the duration by the device's time stamps if there are any, otherwise by the arrivals, s.
std::optional<double> duration_s(const StreamStatistics& statistics) {
  for (const auto* rate : {&statistics.device(), &statistics.arrival()})
    if (rate->steps > 0) return seconds(rate->time);
  return std::nullopt;
}

std::string rates(const StreamStatistics& statistics) {
  std::string text;
  if (const auto hz = statistics.device().hz()) text += fmt::format("{:.3f} Hz (device clock)", *hz);
  if (const auto hz = statistics.arrival().hz())
    text += fmt::format("{}{:.3f} Hz (arrival)", text.empty() ? "" : ", ", *hz);
  if (!text.empty()) return text;
  return statistics.samples() < 2 || statistics.has_time()
             ? "unknown: too few samples with a time"
             : "unknown: neither the samples nor the input carry a time";
}

// A layout that the settings describe may have checksums.
bool may_have_checksum(const Protocol& protocol) { return protocol.has_checksum || protocol.layout != nullptr; }

}  // namespace

std::vector<StreamReport::Figure> StreamReport::figures() const {
  const auto count = [](std::uint64_t n) { return std::optional(static_cast<double>(n)); };
  const auto gaps = [&](std::uint64_t n) { return statistics.can_detect_gaps() ? count(n) : std::nullopt; };
  const DurationHistogram& jitter = statistics.jitter();
  const auto jitter_us = [&](double percent) {
    return jitter.count() > 0 ? std::optional(1e6 * jitter.percentile(percent)) : std::nullopt;
  };
  return {
      {"samples", count(statistics.samples())},
      {"gaps", gaps(statistics.gaps())},
      {"missing", gaps(statistics.missing())},
      {"checksum", count(errors.checksum)},
      {"malformed", count(errors.malformed)},
      {"incomplete", count(errors.incomplete)},
      {"skipped_bytes", count(errors.skipped_bytes)},
      {"repeated", count(statistics.repeated())},
      {"back", count(statistics.back())},
      {"time_jumps", count(statistics.time_jumps())},
      {"device_lost", count(counters.lost_count)},
      {"truncated_records", count(counters.truncated)},
      {"rate_hz", statistics.device().hz() ? statistics.device().hz() : statistics.arrival().hz()},
      {"arrival_rate_hz", statistics.arrival().hz()},
      {"jitter_p50_us", jitter_us(50)},
      {"jitter_p99_us", jitter_us(99)},
      {"jitter_p999_us", jitter_us(99.9)},
      {"jitter_max_us", jitter.count() > 0 ? std::optional(1e6 * jitter.max()) : std::nullopt},
  };
}

std::optional<double> StreamReport::seen(const Requirement& requirement) const {
  std::string names;
  for (const Figure& figure : figures()) {
    if (figure.name == requirement.figure) return figure.value;
    fmt::format_to(std::back_inserter(names), "{}{}", names.empty() ? "" : ", ", figure.name);
  }
  throw std::invalid_argument(
      fmt::format("\"{}\": there is no figure {}; there are {}", requirement.text, requirement.figure, names));
}

bool StreamReport::holds(const Requirement& requirement) const {
  const auto value = seen(requirement);
  return value && requirement.holds(*value, static_cast<double>(statistics.samples()));
}

bool StreamReport::keeps_all_limits() const {
  return std::all_of(required.begin(), required.end(), [this](const Requirement& limit) { return holds(limit); });
}

std::string StreamReport::text() const {
  std::string text;
  const auto line = [&text](std::string_view subject, std::string_view what) {
    fmt::format_to(std::back_inserter(text), "{:<10} {}\n", subject, what);
  };
  const auto duration = duration_s(statistics);
  line("samples", fmt::format("{}{}", statistics.samples(), duration ? fmt::format(" in {:.3f} s", *duration) : ""));
  line("rate", rates(statistics));
  if (statistics.jitter().count() > 0)
    line("jitter", percentiles_text(statistics.jitter()) + " (arrival against a fitted line)");
  if (statistics.can_detect_gaps())
    line("gaps", fmt::format("{} ({} missing)", statistics.gaps(), plural(statistics.missing(), "sample")));
  else if (statistics.samples() < 2)
    line("gaps", "unknown: they are between samples, and there are not two");
  else
    line("gaps", "unknown: the protocol carries neither counter nor time");
  line("checksum",
       fmt::format("{}, {} malformed, {} incomplete, {} skipped",
                   may_have_checksum(protocol) ? plural(errors.checksum, "failure") : "none in this protocol",
                   errors.malformed, errors.incomplete, plural(errors.skipped_bytes, "byte")));

  if (statistics.repeated() + statistics.back() > 0)
    line("order", fmt::format("{} repeated, {} back (a restart, or reordering)",
                              plural(statistics.repeated(), "sample"), statistics.back()));
  if (statistics.time_jumps() > 0)
    line("clock", plural(statistics.time_jumps(), "jump") + " of the device's time stamps");
  if (counters.lost_count > 0) line("device", fmt::format("lost {}", plural(counters.lost_count, "time")));
  if (counters.truncated > 0) line("capture", fmt::format("{} cut short", plural(counters.truncated, "record")));
  if (!warning.empty()) line("warning", warning);
  for (const Requirement& limit : required) {
    const auto value = seen(limit);
    line("required", fmt::format("{}: {}, {}", limit.text, holds(limit) ? "holds" : "VIOLATED",
                                 value ? fmt::format("{:.6g}", *value) : "unknown"));
  }
  return text;
}

std::string StreamReport::json() const {
  using Json = nlohmann::ordered_json;
  const DurationHistogram& jitter = statistics.jitter();
  Json jitter_us, limits = Json::array();
  constexpr double unknown = NAN;  // dump() writes null
  if (jitter.count() > 0)
    jitter_us = {{"p50", jitter.percentile(50) * 1e6},
                 {"p99", jitter.percentile(99) * 1e6},
                 {"p999", jitter.percentile(99.9) * 1e6},
                 {"max", jitter.max() * 1e6}};
  for (const Requirement& limit : required)
    limits.push_back({{"limit", limit.text}, {"seen", seen(limit).value_or(unknown)}, {"holds", holds(limit)}});
  const auto of_gaps = [&](std::uint64_t n) { return statistics.can_detect_gaps() ? Json(n) : Json(); };
  const Json report = {{"protocol", protocol.name},
                       {"port", port},
                       {"ended_by", ended_by},
                       {"samples", statistics.samples()},
                       {"duration_s", duration_s(statistics).value_or(unknown)},
                       {"rate_hz",
                        {{"device", statistics.device().hz().value_or(unknown)},
                         {"arrival", statistics.arrival().hz().value_or(unknown)}}},
                       {"jitter_us", jitter_us},
                       {"gaps", of_gaps(statistics.gaps())},
                       {"missing", of_gaps(statistics.missing())},
                       {"time_jumps", statistics.time_jumps()},
                       {"repeated", statistics.repeated()},
                       {"back", statistics.back()},
                       {"errors",
                        {{"checksum", errors.checksum},
                         {"malformed", errors.malformed},
                         {"incomplete", errors.incomplete},
                         {"skipped_bytes", errors.skipped_bytes}}},
                       {"device_lost", counters.lost_count},
                       {"truncated_records", counters.truncated},
                       {"warning", warning},
                       {"required", limits}};
  return report.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace imud
