#include "emulator/config/fault_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <sstream>

#include "core/time.hpp"
#include "emulator/faults/fault_kinds.hpp"
#include "emulator/plan/fault_units.hpp"

namespace imud {
namespace {

constexpr double longest_s = 1e9;
// The sampling thread goes through all occurrences of a step, so that their period has a limit.
constexpr double shortest_period_s = 1 / Grid::max_rate_hz;

// Reads a number, or a law by which it is drawn: {uniform = [from, to]} or {normal = [mean, standard_deviation]}.
FaultNumber read_number(TableReader& table, const std::string& key, double fallback, double min, double max) {
  const toml::node* node = table.node(key);
  const toml::table* law = node == nullptr ? nullptr : node->as_table();
  if (law == nullptr) return {.a = table.real(key, fallback, min, max)};
  constexpr std::string_view remedy =
      "give a number, {uniform = [from, to]} or {normal = [mean, standard deviation]}";
  FaultNumber number;
  const toml::array* pair = nullptr;
  if (law->size() == 1 && law->begin()->second.is_array()) {
    const std::string_view name = law->begin()->first.str();
    number.law = name == "uniform"  ? FaultNumber::Law::uniform
                 : name == "normal" ? FaultNumber::Law::normal
                                    : FaultNumber::Law::fixed;
    pair = law->begin()->second.as_array();
  }
  const auto value = [&](std::size_t i) { return pair->get(i)->value<double>().value_or(std::nan("")); };
  if (pair == nullptr || pair->size() != 2 || number.is_fixed() || !std::isfinite(value(0)) ||
      !std::isfinite(value(1))) {
    table.fault(key, remedy);
    return {.a = fallback};
  }
  number.a = value(0);
  number.b = value(1);
  const bool is_uniform = number.law == FaultNumber::Law::uniform;
  if (is_uniform ? number.a < min || number.b > max || number.a > number.b
                 : number.a < min || number.a > max || number.b < 0)
    table.fault(
        key, fmt::format("give {} within {:g} to {:g}",
                         is_uniform ? "a range" : "a mean and a standard deviation that is not negative,", min, max));
  toml::table resolved;
  resolved.insert(law->begin()->first.str(), toml::array{number.a, number.b});
  table.resolve(key, std::move(resolved));
  return number;
}

FaultCondition read_condition(TableReader& table) {
  FaultCondition condition;
  const std::string text = table.text("when", "");
  if (text.empty()) return condition;
  std::istringstream words(text);
  std::string quantity, sign, rest;
  const bool is_read = static_cast<bool>(words >> quantity >> sign >> condition.above) && !(words >> rest);
  if (quantity == "rate") condition.quantity = FaultCondition::Quantity::rate;
  if (quantity == "specific_force") condition.quantity = FaultCondition::Quantity::specific_force;
  if (!is_read || sign != ">" || condition.quantity == FaultCondition::Quantity::none || !(condition.above >= 0))
    table.fault("when", "give \"rate > X\" in rad/s or \"specific_force > X\" in m/s^2; both are magnitudes");
  return condition;
}

// Reads `after_host` and `at_time`.
void read_wait(TableReader& table, FaultConfig& fault) {
  if (const toml::node* node = table.node("after_host"); node != nullptr) {
    if (node->is_table()) {
      TableReader bytes = table.child("after_host");
      fault.after_host = read_host_bytes(bytes);
      if (!bytes.has("text") && !bytes.has("hex")) table.fault("after_host", "give text or hex, or \"any\" bytes");
      bytes.finish();
    } else {
      fault.after_host = HostBytes{};
      if (table.text("after_host", "any") != "any")
        table.fault("after_host", "give \"any\", {text = \"...\"} or {hex = \"...\"}");
    }
  }
  if (const toml::node* node = table.node("at_time"); node != nullptr) {
    const toml::value<toml::date_time>* given = node->as_date_time();
    if (given == nullptr || !given->get().offset) {
      table.fault("at_time",
                  "give a date and time with its offset, such as 2026-01-01T12:00:00Z, without quotes in TOML");
      return;
    }
    const toml::date_time& time = given->get();
    const std::chrono::sys_days day = std::chrono::year(time.date.year) / time.date.month / time.date.day;
    const std::int64_t minutes =
        std::int64_t{60} * time.time.hour + time.time.minute - std::int64_t{time.offset->minutes};
    fault.after_utc_ns = std::chrono::duration_cast<Nanoseconds>(day.time_since_epoch()).count() +
                         (60 * minutes + time.time.second) * 1'000'000'000 + time.time.nanosecond;
    std::ostringstream text;
    text << time;
    fault.after_utc_text = text.str();
    table.resolve("at_time", time);
    if (fault.after_host) table.fault("at_time", "give either after_host or at_time");
  }
}

// Reads `target` and `kind`.
void read_kind(TableReader& table, FaultConfig& fault) {
  require(table, "target", "what fails, for example \"gyro.x\", \"message\" or \"wire\"");
  require(table, "kind", "how it fails, for example \"bias\"; imud list faults shows all");
  const std::string text = table.text("target", ""), kind = table.text("kind", "");
  for (const char* key : {"target", "kind"})
    if (is_text(table, key) && table.text(key, "").empty()) table.fault(key, "empty; imud list faults shows all");
  if (text.empty() || kind.empty()) return;
  const std::size_t dot = text.find('.');
  const std::string target = text.substr(0, dot);
  std::vector<std::string> targets, kinds;
  for (const FaultKind* known : fault_kinds())
    for (const std::string_view name : known->targets) {
      if (std::find(targets.begin(), targets.end(), name) == targets.end()) targets.emplace_back(name);
      if (name == target) kinds.emplace_back(known->name);
    }
  if (kinds.empty()) {
    table.fault("target", fmt::format("there is no \"{}\"; known: {}", target, fmt::join(targets, ", ")));
    return;
  }
  fault.kind = find_fault_kind(kind, target);
  if (fault.kind == nullptr) {
    table.fault("kind", fmt::format("{} has no fault \"{}\"; {}", target, kind, suggestion(kind, kinds)));
    return;
  }
  const auto& names = fault.kind->targets;
  fault.target = static_cast<std::uint8_t>(std::find(names.begin(), names.end(), target) - names.begin());
  if (dot == std::string::npos) return;
  fault.axes = 0;
  for (const char letter : text.substr(dot + 1)) {
    const std::size_t axis = FaultConfig::axis_letters.find(letter);
    if (axis != std::string_view::npos) fault.axes = static_cast<std::uint8_t>(fault.axes | (1U << axis));
  }
  const auto axes = static_cast<std::size_t>(std::popcount(fault.axes));
  if (!fault.kind->has_axes)
    table.fault("target", fmt::format("this fault of {} has no axes; give \"{}\"", target, target));
  else if (axes == 0 || axes != text.size() - dot - 1)
    table.fault("target", fmt::format("give the axes of {} as in \"{}.x\" or \"{}.xy\"", target, target, target));
  else if (axes < fault.kind->least_axes)
    table.fault("target", fmt::format("\"{}\" needs {} axes or more; give \"{}.xy\" or \"{}\"", fault.kind->name,
                                      fault.kind->least_axes, target, target));
}

void read_parameters(TableReader& table, FaultConfig& fault) {
  const std::span<const KeyUnit> units = fault_units(fault.kind->targets[fault.target]);
  for (std::size_t i = 0; i < fault.kind->parameters.size(); ++i) {
    const FaultParameter& parameter = fault.kind->parameters[i];
    const std::string key(parameter.key);
    std::string given = key;
    double si = 1;
    if (parameter.has_targets_unit && !units.empty()) {
      std::vector<std::string> all;
      for (const KeyUnit& unit : units) {
        const std::string with_unit = fmt::format("{}{}", key, unit.suffix);
        if (!table.has(with_unit)) continue;
        all.push_back(with_unit);
        given = with_unit;
        si = unit.factor;
      }
      if (all.size() + (table.has(key) ? 1 : 0) > 1)
        table.fault(given, fmt::format("\"{}\" is given twice; give it in one unit", key));
    }
    const bool is_required = std::isnan(parameter.initial);
    if (is_required && !table.has(given)) {
      table.fault(key, fmt::format("missing: {}", parameter.meaning));
      continue;
    }
    FaultNumber number =
        read_number(table, given, is_required ? 0 : parameter.initial / si, parameter.min / si, parameter.max / si);
    if (parameter.is_whole && number.is_fixed() && number.a != std::round(number.a))
      table.fault(given, fmt::format("give a whole number: {}", parameter.meaning));
    number.a *= si;
    number.b *= si;
    fault.parameters[i] = number;
  }
}

void read_times(TableReader& table, FaultConfig& fault) {
  if (!table.has("at_sample") || table.has("at_s")) fault.begin_s = read_number(table, "at_s", 0, 0, longest_s);
  constexpr std::uint64_t most = 1'000'000'000'000;
  if (table.has("at_sample")) {
    fault.begin_sample = table.unsigned_integer("at_sample", 0, most);
    if (table.has("at_s")) table.fault("at_sample", "give either at_s or at_sample");
  }
  read_wait(table, fault);
  fault.condition = read_condition(table);
  const int durations = int{table.has("for_s")} + int{table.has("until_s")} + int{table.has("for_samples")};
  if (durations > 1) table.fault("for_s", "give one of for_s, until_s and for_samples");
  if (table.has("for_samples")) {
    fault.samples = table.unsigned_integer("for_samples", 1, most);
    if (fault.samples == 0) table.fault("for_samples", "give at least 1");
  } else if (table.has("until_s")) {
    const double until = table.real("until_s", 0, 0, longest_s);
    if (!fault.begin_s.is_fixed() || fault.begin_sample || fault.waits() ||
        fault.condition.quantity != FaultCondition::Quantity::none)
      table.fault("until_s", "needs a begin by a fixed at_s; give for_s");
    else if (until <= fault.begin_s.a)
      table.fault("until_s", fmt::format("give a time after at_s, {:g}", fault.begin_s.a));
    fault.duration_s.a = until - fault.begin_s.a;
    fault.has_duration = true;
  } else if (table.has("for_s")) {
    fault.duration_s = read_number(table, "for_s", 0, 1e-9, longest_s);
    fault.has_duration = true;
  }
  fault.ramp_in_s = table.real("ramp_in_s", 0, 0, longest_s);
  fault.ramp_out_s = table.real("ramp_out_s", 0, 0, longest_s);
  fault.every_s = table.real("every_s", 0, 0, longest_s);
  if (fault.every_s > 0 && fault.every_s < shortest_period_s)
    table.fault("every_s",
                fmt::format("give at least {:g}, the sample period of the fastest unit", shortest_period_s));
  fault.times = table.unsigned_integer("times", fault.every_s > 0 ? 0 : 1, most);
  fault.probability = table.real("probability", 1, 0, 1);
  fault.is_optional = table.flag("optional", false);
  const bool has_condition = fault.condition.quantity != FaultCondition::Quantity::none;
  if (fault.every_s == 0 && fault.times != 1 && !has_condition)
    table.fault("times", "needs every_s, the time from one begin to the next");
  if (fault.every_s > 0 && (fault.begin_sample || has_condition)) table.fault("every_s", "needs a begin by at_s");
  if (fault.every_s > 0 && fault.has_duration && fault.duration_s.is_fixed() && fault.duration_s.a > fault.every_s)
    table.fault("every_s", "give at least the duration");
  if (fault.every_s > 0 && !fault.has_duration && !fault.samples && fault.kind != nullptr && !fault.kind->is_event)
    table.fault("every_s", "needs a duration; give for_s or for_samples");
  if (fault.ramp_out_s > 0 && (!fault.has_duration || fault.samples))
    table.fault("ramp_out_s", "needs for_s or until_s");
  if (fault.kind == nullptr) return;
  if (!fault.kind->is_ramped && (fault.ramp_in_s > 0 || fault.ramp_out_s > 0))
    table.fault(fault.ramp_in_s > 0 ? "ramp_in_s" : "ramp_out_s",
                fmt::format("\"{}\" has no ramp: it is there or not", fault.kind->name));
  if (fault.kind->is_event && durations > 0)
    table.fault("kind", fmt::format("\"{}\" happens at its begin; omit its duration", fault.kind->name));
}

void read_imus(TableReader& table, FaultConfig& fault, const std::vector<std::string>& imus) {
  std::vector<std::string> given;
  if (const toml::node* node = table.node("imu"); node != nullptr && node->is_array()) {
    toml::array resolved;
    for (const toml::node& item : *node->as_array()) given.push_back(item.value<std::string>().value_or(""));
    for (const std::string& name : given) resolved.push_back(name);
    table.resolve("imu", std::move(resolved));
  } else {
    given = {table.text("imu", "*")};
  }
  if (given.empty()) table.fault("imu", fmt::format("is an empty list; give \"*\" or of: {}", fmt::join(imus, ", ")));
  for (const std::string& name : given) {
    if (name == "*") {
      fault.imus = imus;
      return;
    }
    if (std::find(imus.begin(), imus.end(), name) == imus.end())
      table.fault("imu", fmt::format("there is no imu \"{}\"; give \"*\" or of: {}", name, fmt::join(imus, ", ")));
    if (fault.acts_on(name))
      table.fault("imu", fmt::format("\"{}\" is given twice; give it once", name));
    else
      fault.imus.push_back(name);
  }
}

}  // namespace

FaultConfig read_fault(TableReader& table, std::size_t index, const std::vector<std::string>& imus) {
  FaultConfig fault;
  fault.name = name_in(table, fmt::format("fault{}", index + 1));
  read_kind(table, fault);
  if (fault.kind != nullptr && fault.kind->seam == FaultSeam::truth) {
    fault.imus = {std::string(fault_of_truth)};
    if (table.has("imu")) table.fault("imu", "truth is that of all imus; omit it");
  } else {
    read_imus(table, fault, imus);
  }
  if (fault.kind != nullptr) read_parameters(table, fault);
  read_times(table, fault);
  if (fault.kind != nullptr && fault.kind->has_settings) table.node("device");  // read_other_settings() reads it
  if (fault.kind != nullptr) table.finish();                                    // otherwise its keys are not known
  return fault;
}

}  // namespace imud
