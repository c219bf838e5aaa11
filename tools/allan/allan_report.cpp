#include "tools/allan/allan_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "core/units.hpp"

namespace imud {
namespace {

constexpr double hour = 3600;   // s
constexpr double rt_hour = 60;  // sqrt(s)
constexpr double arcsecond = units::degree / 3600;
constexpr double milli_g = units::standard_gravity / 1000;

constexpr auto rate_units = std::to_array<TermUnit>({
    {"quantization", "rad", "arcsec", "quantization_arcsec", 1 / arcsecond},
    {"angle random walk", "rad/sqrt(s)", "deg/sqrt(h)", "angle_random_walk_deg_per_rt_hr", rt_hour / units::degree},
    {"bias instability", "rad/s", "deg/h", "bias_instability_deg_per_hr", hour / units::degree},
    {"rate random walk", "rad/s/sqrt(s)", "deg/h/sqrt(h)", "rate_random_walk_deg_per_hr_per_rt_hr",
     hour* rt_hour / units::degree},
    {"rate ramp", "rad/s^2", "deg/h/h", "rate_ramp_deg_per_hr_per_hr", hour* hour / units::degree},
});
constexpr auto force_units = std::to_array<TermUnit>({
    {"quantization", "m/s", "mm/s", "quantization_mm_per_s", 1000},
    {"velocity random walk", "m/s/sqrt(s)", "m/s/sqrt(h)", "velocity_random_walk_m_per_s_per_rt_hr", rt_hour},
    {"bias instability", "m/s^2", "mg", "bias_instability_mg", 1 / milli_g},
    {"acceleration random walk", "m/s^2/sqrt(s)", "mg/sqrt(h)", "acceleration_random_walk_mg_per_rt_hr",
     rt_hour / milli_g},
    {"acceleration ramp", "m/s^3", "mg/h", "acceleration_ramp_mg_per_hr", hour / milli_g},
});
constexpr TermUnit rate_deviation = {"deviation", "rad/s", "deg/h", "", hour / units::degree};
constexpr TermUnit force_deviation = {"deviation", "m/s^2", "mg", "", 1 / milli_g};

constexpr double unknown = NAN;  // dump() of JSON writes null for a number that is not finite

std::string term_text(const AllanFit::Term& term, const TermUnit& unit) {
  if (!term.value) {
    if (!std::isfinite(term.least_seen)) return "not seen";
    return fmt::format("not seen; from {:.3g} {} on it would be", unit.factor * term.least_seen, unit.datasheet);
  }
  const double value = unit.factor * *term.value, error = unit.factor * term.error;
  return fmt::format("{:<10.4g} +- {:<8.2g} {:<13} = {:.4g} {}", value, error, unit.datasheet, *term.value, unit.si);
}

nlohmann::ordered_json term_json(const AllanFit::Term& term, const TermUnit& unit) {
  const double value = term.value.value_or(unknown), error = term.value ? term.error : unknown;
  return {{"name", unit.name},
          {"si", value},
          {"si_error", error},
          {"si_unit", unit.si},
          {"datasheet", unit.factor * value},
          {"datasheet_error", unit.factor * error},
          {"datasheet_unit", unit.datasheet},
          {"key", unit.key},
          {"least_seen_si", term.least_seen}};
}

// The value of a term for a limit, in SI.
double value_for(const Requirement& requirement, const AllanFit::Term& term) noexcept {
  using Relation = Requirement::Relation;
  const bool is_upper = requirement.relation == Relation::at_most || requirement.relation == Relation::less;
  return term.value.value_or(is_upper ? term.least_seen : 0);
}

}  // namespace

const std::array<TermUnit, allan_term_count>& term_units(bool is_rate) noexcept {
  return is_rate ? rate_units : force_units;
}
const TermUnit& deviation_unit(bool is_rate) noexcept { return is_rate ? rate_deviation : force_deviation; }

const AllanCurve::Point& AllanReport::Axis::lowest() const noexcept {
  return *std::ranges::min_element(curve.points, {}, &AllanCurve::Point::deviation);
}

std::optional<double> AllanReport::seen(const Requirement& requirement) const {
  const std::size_t dot = requirement.figure.find('.');
  const std::string sensor = requirement.figure.substr(0, dot);
  const std::string term = dot == std::string::npos ? "" : requirement.figure.substr(dot + 1);
  const bool is_rate = sensor.starts_with("gyro");
  const auto& units = term_units(is_rate);
  bool is_known = sensor == "gyro" || sensor == "accel" || std::ranges::count(channel_names, sensor) > 0;
  std::optional<std::size_t> number;
  double factor = 1;
  for (std::size_t t = 0; t < allan_term_count; ++t) {
    if (term == std::string(1, allan_term_list[t].letter)) number = t;
    if (term != units[t].key) continue;
    number = t;
    factor = units[t].factor;
  }
  if (!is_known || !number || requirement.percent)
    throw std::invalid_argument(
        fmt::format("{}: right would be an axis (gyro, accel, gyro_x, ...), a dot, a term (N, B, K, Q, R for SI, or "
                    "as {}) and a limit",
                    requirement.text, units[1].key));
  std::optional<double> largest;
  for (const Axis& axis : axes)
    if (axis.name() == sensor || axis.name().substr(0, axis.name().size() - 2) == sensor)
      largest = std::max(largest.value_or(0), factor * value_for(requirement, axis.fit.terms[*number]));
  return largest;
}

bool AllanReport::holds(const Requirement& requirement) const {
  const auto value = seen(requirement);
  return value && requirement.holds(*value, 0);
}

bool AllanReport::keeps_all_limits() const {
  return std::ranges::all_of(required, [this](const Requirement& limit) { return holds(limit); });
}

std::array<TermVerdict, allan_term_count> AllanReport::verdicts(const Axis& axis) const {
  std::vector<double> model;
  if (!against->noise[axis.number].of_values.empty())
    for (const auto& point : axis.curve.points) model.push_back(model_deviation(axis, point));
  return compare(axis.curve, axis.fit, against->of[axis.number], tolerance,
                 !model.empty() && has_deviations_of(axis.curve, model, tolerance));
}

double AllanReport::model_deviation(const Axis& axis, const AllanCurve::Point& point) const {
  return against->deviation(axis.curve.kind, axis.number, axis.curve.time(point), axis.is_increment);
}

bool AllanReport::agrees_with_model() const {
  return !against || std::ranges::all_of(axes, [this](const Axis& axis) { return agrees(verdicts(axis)); });
}

std::string AllanReport::comparison_text() const {
  std::string text =
      fmt::format("against    {}, within {:.4g} % at {:.4g} % confidence: {}\n", against->model, 100 * tolerance,
                  100 * (1 - false_difference), agrees_with_model() ? "agrees" : "DIFFERS");
  for (const Axis& axis : axes) {
    const auto found = verdicts(axis);
    std::string name(axis.name());
    for (std::size_t t = 0; t < allan_term_count; ++t) {
      if (found[t].is_in_neither) continue;
      const TermUnit& unit = term_units(axis.is_rate())[t];
      const auto& value = axis.fit.terms[t].value;
      const std::string seen = value ? fmt::format("{:.4g}", unit.factor * *value) : "not seen";
      const auto word = found[t].word;
      text += fmt::format("{:<10} {} {:<10} for {:.4g} {}: {}\n", name, allan_term_list[t].letter, seen,
                          unit.factor * found[t].model, unit.datasheet,
                          found[t].is_by_curve                 ? "agrees, by the curve of its samples"
                          : word == TermVerdict::Word::agrees  ? "agrees"
                          : word == TermVerdict::Word::differs ? "DIFFERS"
                                                               : "undecided, the recording is too short");
      name.clear();
    }
    if (!agrees(found) && std::ranges::none_of(found, [](const TermVerdict& verdict) {
          return verdict.word == TermVerdict::Word::differs;
        }))
      text += fmt::format("{:<10} no term of the model is decided, which counts as a difference\n", name);
  }
  return text;
}

std::string AllanReport::text() const {
  std::string text =
      fmt::format("samples    {} in {:.3f} s, {:.6g} Hz ({})\n", samples,
                  static_cast<double>(samples) / recording.rate_hz, recording.rate_hz, recording.rate_source);
  if (recording.can_detect_gaps)
    text += fmt::format("gaps       {} ({} samples missing, {} repeated, {} invalid), joined\n", recording.gaps,
                        recording.missing, recording.repeated, recording.invalid);
  if (axes.empty()) return text;
  const auto& points = axes.front().curve.points;
  text += fmt::format("deviation  {}, {} averaging times from {:.4g} s to {:.4g} s\n",
                      name_of(axes.front().curve.kind), points.size(), points.front().tau_s, points.back().tau_s);
  for (const Axis& axis : axes) {
    const auto& units = term_units(axis.is_rate());
    for (std::size_t t = 0; t < allan_term_count; ++t)
      text += fmt::format("{:<10} {} {:<25} {}\n", t == 0 ? axis.name() : "", allan_term_list[t].letter,
                          units[t].name, term_text(axis.fit.terms[t], units[t]));
    const auto& lowest = axis.lowest();
    const TermUnit& unit = deviation_unit(axis.is_rate());
    text += fmt::format("           lowest deviation            {:.4g} {} at {:.4g} s\n",
                        unit.factor * lowest.deviation, unit.datasheet, lowest.tau_s);
    if (axis.fit.flicker_from_s > 0)
      text += fmt::format("           B is flat from about {:.2g} s on, and lower at shorter averaging times\n",
                          axis.fit.flicker_from_s);
    if (axis.fit.misfit > 0)
      text += fmt::format(
          "           the terms explain the variance only to {:.1f} %, as after a filter or with vibration; see "
          "--fit-from\n",
          100 * axis.fit.misfit);
  }
  if (against) text += comparison_text();
  for (const Requirement& limit : required) {
    const auto value = seen(limit);
    text += fmt::format("required   {}: {}, {}\n", limit.text, holds(limit) ? "holds" : "VIOLATED",
                        value ? fmt::format("{:.4g}", *value) : "unknown");
  }
  return text;
}

std::string AllanReport::json() const {
  nlohmann::ordered_json report = {
      {"protocol", protocol},           {"port", port},
      {"ended_by", ended_by},           {"samples", samples},
      {"rate_hz", recording.rate_hz},   {"gaps", recording.gaps},
      {"missing", recording.missing},   {"repeated", recording.repeated},
      {"invalid", recording.invalid},   {"deviation", axes.empty() ? "" : name_of(axes.front().curve.kind)},
      {"confidence_level", confidence}, {"false_alarm", false_alarm}};
  report["axes"] = nlohmann::ordered_json::object();
  for (const Axis& axis : axes) {
    nlohmann::ordered_json entry;
    for (std::size_t t = 0; t < allan_term_count; ++t)
      entry[std::string(1, allan_term_list[t].letter)] = term_json(axis.fit.terms[t], term_units(axis.is_rate())[t]);
    entry["misfit"] = axis.fit.misfit;
    entry["flicker_from_s"] = axis.fit.flicker_from_s;
    const AllanTerms terms = axis.fit.seen();
    for (const auto& point : axis.curve.points) {
      entry["tau_s"].push_back(point.tau_s);
      entry["adev"].push_back(point.deviation);
      entry["confidence"].push_back({point.bounds.low, point.bounds.high});
      entry["degrees_of_freedom"].push_back(point.degrees);
      entry["noise_exponent"].push_back(point.noise);
      entry["fitted"].push_back(
          expected_deviation(axis.curve.kind, terms, axis.curve.time(point), axis.fit.flicker_from_s));
    }
    if (against) {
      const auto found = verdicts(axis);
      for (std::size_t t = 0; t < allan_term_count; ++t) {
        auto& term = entry[std::string(1, allan_term_list[t].letter)];
        term["model_si"] = found[t].model;
        term["verdict"] = name_of(found[t].word);
      }
      for (const auto& point : axis.curve.points) entry["model"].push_back(model_deviation(axis, point));
    }
    report["axes"][std::string(axis.name())] = std::move(entry);
  }
  if (against)
    report["against"] = {{"model", against->model}, {"tolerance", tolerance}, {"agrees", agrees_with_model()}};
  report["required"] = nlohmann::ordered_json::array();
  for (const Requirement& limit : required)
    report["required"].push_back(
        {{"limit", limit.text}, {"seen", seen(limit).value_or(unknown)}, {"holds", holds(limit)}});
  return report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string AllanReport::csv() const {
  std::string text = "tau_s";
  for (const Axis& axis : axes)
    text += fmt::format(",{0},{0}_low,{0}_high,{0}_fitted{1}", axis.name(),
                        against ? fmt::format(",{}_model", axis.name()) : "");
  text += "\n";
  if (axes.empty()) return text;
  for (std::size_t i = 0; i < axes.front().curve.points.size(); ++i) {
    text += fmt::format("{}", axes.front().curve.points[i].tau_s);
    for (const Axis& axis : axes) {
      const auto& point = axis.curve.points[i];
      // An absent curve is an empty field, which gnuplot leaves out.
      const auto field = [](double deviation) { return deviation > 0 ? fmt::format("{}", deviation) : ""; };
      text += fmt::format(",{},{},{},{}", point.deviation, point.bounds.low, point.bounds.high,
                          field(expected_deviation(axis.curve.kind, axis.fit.seen(), axis.curve.time(point),
                                                   axis.fit.flicker_from_s)));
      if (against) text += "," + field(model_deviation(axis, point));
    }
    text += "\n";
  }
  return text;
}

}  // namespace imud
