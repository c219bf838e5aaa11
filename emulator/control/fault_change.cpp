#include "emulator/control/fault_change.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "emulator/config/scenario.hpp"
#include "emulator/engine/command_queue.hpp"
#include "emulator/faults/fault_kinds.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/plan/fault_units.hpp"

namespace imud {
namespace {

constexpr std::string_view seam_words[] = {"truth", "sensor", "message", "wire", "power"};

[[noreturn]] void refuse(const std::string& what) { throw wrong_params(what); }

// Returns the JSON value of a key as TOML.
std::string toml_of(const std::string& key, const Json& value) {
  std::vector<std::string> items;
  if (value.is_array()) {
    for (const Json& item : value) items.push_back(toml_of(key, item));
    return fmt::format("[{}]", fmt::join(items, ", "));
  }
  if (value.is_object()) {
    for (const auto& [name, item] : value.items())
      items.push_back(fmt::format("{} = {}", json_line(Json(name)), toml_of(key, item)));
    return fmt::format("{{{}}}", fmt::join(items, ", "));
  }
  if (value.is_null()) refuse(fmt::format("{}: null is no value", key));
  return json_line(value);
}

// Returns the keys of the [[fault]] that the parameters describe, as TOML.
std::string text_of(const Json& params) {
  if (!params.is_object()) refuse("give the keys of a [[fault]]");
  std::string text;
  for (const auto& [key, item] : params.items()) {
    const std::string value = toml_of(key, item);
    try {
      static_cast<void>(toml::parse("value = " + value));
    } catch (const toml::parse_error& error) {
      refuse(fmt::format("{}: {}", key, error.description()));
    }
    text += fmt::format("{} = {}\n", json_line(Json(key)), value);
  }
  return text;
}

// Returns the SI unit of a parameter for each target that has one: {"gyro": "rad_per_s"}.
Json units_json(const FaultKind& kind, const FaultParameter& parameter) {
  Json units = Json::object();
  if (!parameter.has_targets_unit) return units;
  for (const std::string_view target : kind.targets)
    if (const auto all = fault_units(target); !all.empty())
      units[std::string(target)] = fmt::format("{}{}", all[0].suffix.substr(1), parameter.is_per_s ? "_per_s" : "");
  return units;
}

void check_permission(const FaultBook& faults) {
  if (!faults.can_grow())
    throw RpcError(RpcError::refused,
                   "this run cannot fail by control; give faults = true in [control] of its configuration");
}

// Returns the names of all faults by their numbers, also of the faults that earlier changes of the batch begin.
std::vector<std::string> names_of_faults(const ChangeContext& context) {
  std::vector<std::string> names;
  for (const FaultConfig& fault : context.faults.all()) names.push_back(fault.name);
  for (const Change& change : context.earlier)
    if (change.fault) names.push_back(change.fault->config.name);
  return names;
}

// Begins the fault that the text describes. `params`: for the event.
Change begin_fault(std::string text, const Json& params, const ChangeContext& context) {
  const Config& config = context.config;
  const std::size_t number = names_of_faults(context).size();
  std::vector<std::string> wrong;
  FaultConfig fault = read_begun_fault(text, number, config.imus, wrong);
  if (!wrong.empty()) refuse(fmt::format("{}", fmt::join(wrong, "; ")));
  if (const std::string objection = begin_objection(fault, config); !objection.empty()) refuse(objection);
  const Json event = {{"event", "fault.requested"}, {"name", fault.name}, {"fault", params}};
  std::vector<Command> commands;
  const std::string words = fmt::format("fault {}: {}", fault.name, fault.text());
  // A fault of truth concerns all imus.
  const bool is_of_all = fault.kind->seam == FaultSeam::truth || fault.imus.size() == config.imus.size();
  for (std::size_t i = 0; i < config.imus.size() && !is_of_all; ++i)
    if (fault.acts_on(config.imus[i].name))
      commands.push_back(
          {.kind = Command::Kind::fault_begin, .imu = static_cast<std::uint16_t>(i), .number = number});
  if (is_of_all) commands.push_back({.kind = Command::Kind::fault_begin, .number = number});
  return {.commands = std::move(commands),
          .words = words,
          .event = event,
          .fault = BegunFault{std::move(fault), std::move(text)}};
}

void check_room(const ChangeContext& context) {
  check_permission(context.faults);
  if (names_of_faults(context).size() >= context.faults.capacity())
    throw RpcError(RpcError::refused,
                   fmt::format("{} faults have begun by control in this run; no more can", FaultBook::most_added));
}

}  // namespace

Change begin_fault_change(const Json& params, const ChangeContext& context) {
  check_room(context);
  return begin_fault(text_of(params), params, context);
}

Change repeat_fault_change(const Json& request_params, const ChangeContext& context) {
  check_room(context);
  RpcParams params(request_params);
  const std::string name = params.text("name", "the name of a [[fault]]");
  params.finish();
  const std::span<const FaultConfig> all = context.faults.configured();
  const auto found = std::ranges::find(all, name, &FaultConfig::name);
  if (found == all.end()) {
    std::vector<std::string> names;
    for (const FaultConfig& fault : all) names.push_back(fault.name);
    refuse(fmt::format("the configuration has no fault \"{}\"; it has {}", name,
                       names.empty() ? "none" : fmt::to_string(fmt::join(names, ", "))));
  }
  return begin_fault(text_to_begin(context.config, static_cast<std::size_t>(found - all.begin())), request_params,
                     context);
}

Change end_fault_change(const Json& request_params, const ChangeContext& context) {
  check_permission(context.faults);
  RpcParams params(request_params);
  Change change;
  const std::string name = params.text("name", "the name of a fault");
  const std::vector<std::string> names = names_of_faults(context);
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i] == name) change.commands.push_back({.kind = Command::Kind::fault_end, .number = i});
  if (change.commands.empty())
    refuse(fmt::format("there is no fault \"{}\"; there are {}", name, fmt::join(names, ", ")));
  if (change.commands.size() > CommandQueue::longest_batch)
    change.commands.erase(change.commands.begin(), change.commands.end() - CommandQueue::longest_batch);
  params.finish();
  change.words = fmt::format("end of fault {}", name);
  change.event = {{"event", "fault.end_requested"}, {"name", name}};
  return change;
}

Change clear_faults_change(const Json& request_params, const ChangeContext& context) {
  check_permission(context.faults);
  RpcParams params(request_params);
  const std::uint16_t imu = params.imu(context.config);
  params.finish();
  const std::string whose = imu < context.config.imus.size() ? context.config.imus[imu].name : "all imus";
  return {{{.kind = Command::Kind::fault_clear, .imu = imu}},
          fmt::format("end of all faults of {}", whose),
          {{"event", "fault.clear_requested"}}};
}

Json fault_kinds_json() {
  Json all = Json::array();
  for (const FaultKind* kind : fault_kinds()) {
    if (kind->seam == FaultSeam::truth || kind->has_settings) continue;
    Json parameters = Json::array();
    for (const FaultParameter& parameter : kind->parameters)
      parameters.push_back({{"key", parameter.key},
                            {"meaning", parameter.meaning},
                            {"units", units_json(*kind, parameter)},
                            {"initial", std::isfinite(parameter.initial) ? Json(parameter.initial) : Json()}});
    all.push_back({{"name", kind->name},
                   {"summary", kind->summary},
                   {"seam", seam_words[static_cast<std::size_t>(kind->seam)]},
                   {"targets", std::vector<std::string>(kind->targets.begin(), kind->targets.end())},
                   {"has_axes", kind->has_axes},
                   {"is_event", kind->is_event},
                   {"parameters", std::move(parameters)}});
  }
  return all;
}

Json configured_faults_json(const FaultBook& faults) {
  Json all = Json::array();
  for (const FaultConfig& fault : faults.configured()) all.push_back({{"name", fault.name}, {"text", fault.text()}});
  return all;
}

Json active_faults_json(const FaultBook& faults, const Config& config) {
  Json all = Json::array();
  const std::vector<std::string> imus = names_of(config.imus);
  for (const FaultLabel& label : fault_labels(faults.all(), imus, faults.log()))
    if (!label.has_ended) all.push_back(fault_event_json(faults, label.first, imus));
  return all;
}

Json fault_event_json(const FaultBook& faults, const FaultEvent& event, std::span<const std::string> imus) {
  const FaultConfig& fault = faults.all()[event.fault];
  Json parameters = Json::object();
  for (std::size_t i = 0; i < fault.kind->parameters.size(); ++i)
    parameters[std::string(fault.kind->parameters[i].key)] = event.parameters[i];
  constexpr const char* words[] = {"fault.begin", "fault.end", "fault.passed_over", "fault.effect"};  // by Kind
  const bool is_effect = event.kind == FaultEvent::Kind::effect;
  const auto size = [](double error) { return error < 0 ? Json() : Json(error); };
  Json json = {{"event", words[static_cast<std::size_t>(event.kind)]},
               {"name", fault.name},
               {"kind", fault.kind->name},
               {"target", fault.target_text()},
               {"imu", imu_of(event, imus)},
               {"sample", event.counter},
               {"time_ns", event.device_time.ns},
               {"parameters", std::move(parameters)}};
  if (is_effect)
    json.update({{"attitude_error_rad", size(event.effect.attitude)},
                 {"velocity_error_m_per_s", size(event.effect.velocity)},
                 {"position_error_m", size(event.effect.position)}});
  return json;
}

}  // namespace imud
