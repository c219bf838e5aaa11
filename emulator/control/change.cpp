#include "emulator/control/change.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "emulator/control/running_keys.hpp"
#include "emulator/ground/table_reader.hpp"

namespace imud {
namespace {

// The text becomes a part of one line of the log.
std::string line_of_text(RpcParams& params) {
  std::string text = params.text("text", "one line of text");
  const bool is_line = std::none_of(text.begin(), text.end(),
                                    [](char c) { return static_cast<unsigned char>(c) < ' ' || c == '\x7F'; });
  if (!is_line || text.empty() || text.size() > Command::longest_text)
    throw RpcError(RpcError::invalid_params,
                   fmt::format("text: give one line of 1 to {} bytes", Command::longest_text));
  return text;
}

std::string name_of(std::uint16_t imu, const Config& config) {
  return imu < config.imus.size() ? config.imus[imu].name : "*";
}

Change of_imu(Command::Kind kind, std::uint16_t imu, const Config& config, std::string_view event) {
  const std::string name = name_of(imu, config);
  return {{{.kind = kind, .imu = imu}}, fmt::format("{} {}", event, name), {{"event", event}, {"imu", name}}};
}
Change of_named_imu(Command::Kind kind, const Json& request_params, const Config& config, std::string_view event) {
  RpcParams params(request_params);
  const std::uint16_t imu = params.imu(config);
  params.finish();
  return of_imu(kind, imu, config, event);
}

}  // namespace

Change mark_change(const Json& request_params, const ChangeContext&) {
  RpcParams params(request_params);
  const std::string text = line_of_text(params);
  params.finish();
  Command command = {.text_size = static_cast<std::uint8_t>(text.size())};
  std::copy(text.begin(), text.end(), command.text.begin());
  return {{command}, fmt::format("mark: {}", text), {{"event", "mark"}, {"text", text}}};
}

Change set_change(const Json& params, const ChangeContext& context) {
  if (!params.is_object() || params.empty()) throw wrong_params("give the keys with their values");
  Change change;
  for (const auto& [key, value] : params.items()) {
    const auto before = static_cast<std::ptrdiff_t>(change.commands.size());
    add_commands(change.commands, key, value, context.config);
    const Command& added = change.commands.back();
    if (std::any_of(change.commands.begin(), change.commands.begin() + before,
                    [&](const Command& one) { return one.kind == added.kind && one.imu == added.imu; }))
      throw wrong_params(fmt::format("{}: another key of this request sets the same value; give one of them", key));
    change.words += fmt::format("{}{} = {}", change.words.empty() ? "set " : ", ", key, json_line(value));
  }
  change.event = {{"event", "set"}, {"values", params}};
  return change;
}

Change seed_change(const Json& request_params, const ChangeContext& context) {
  RpcParams params(request_params);
  static_cast<void>(params.get("seed", "a whole number that is not negative"));
  Change change = set_change(request_params, context);
  params.finish();
  return change;
}

Change power_change(const Json& request_params, const ChangeContext& context) {
  RpcParams params(request_params);
  const std::uint16_t imu = params.imu(context.config);
  constexpr std::array<std::string_view, 3> states = {"off", "on", "cycle"};
  const std::string state = params.choice("state", states);
  params.finish();
  Change change = of_imu(state == "off"  ? Command::Kind::power_off
                         : state == "on" ? Command::Kind::power_on
                                         : Command::Kind::power_cycle,
                         imu, context.config, "power");
  change.words = fmt::format("power {}: {}", state, name_of(imu, context.config));
  change.event["state"] = state;
  return change;
}

Change pause_change(const Json& request_params, const ChangeContext& context) {
  return of_named_imu(Command::Kind::pause, request_params, context.config, "pause");
}

Change resume_change(const Json& request_params, const ChangeContext& context) {
  return of_named_imu(Command::Kind::resume, request_params, context.config, "resume");
}

RpcParams::RpcParams(const Json& params) : params_(params) {
  if (params.is_array()) throw wrong_params("give them by name, as an object");
}

bool RpcParams::has(std::string_view name) {
  known_.emplace_back(name);
  return params_.is_object() && params_.contains(std::string(name));
}

const Json& RpcParams::get(std::string_view name, std::string_view meaning) {
  if (!has(name)) throw wrong_params(fmt::format("{} is missing: {}", name, meaning));
  return params_[std::string(name)];
}

std::string RpcParams::text(std::string_view name, std::string_view meaning) {
  const Json& value = get(name, meaning);
  if (!value.is_string()) throw wrong_params(fmt::format("{}: give a text, {}", name, meaning));
  return value.get<std::string>();
}

double RpcParams::number(std::string_view name, std::string_view meaning, double min, double max) {
  const Json& value = get(name, meaning);
  if (!value.is_number() || !(value.get<double>() >= min && value.get<double>() <= max))
    throw wrong_params(fmt::format("{}: give a number from {} to {}, {}", name, min, max, meaning));
  return value.get<double>();
}

std::uint32_t RpcParams::whole_number(std::string_view name, std::string_view meaning, double min, double max) {
  const double value = number(name, meaning, min, max);
  if (value != std::floor(value)) throw wrong_params(fmt::format("{}: give a whole number, {}", name, meaning));
  return static_cast<std::uint32_t>(value);
}

std::string RpcParams::choice(std::string_view name, std::span<const std::string_view> words) {
  const std::string word = text(name, fmt::format("one of {}", fmt::join(words, ", ")));
  if (std::ranges::count(words, word) == 0)
    throw wrong_params(fmt::format("{}: give one of {}", name, fmt::join(words, ", ")));
  return word;
}

std::uint16_t RpcParams::imu(const Config& config) {
  if (!has("imu")) return Command::all_imus;
  const std::string name = text("imu", "the name of an imu, or \"*\" for all");
  if (name == "*") return Command::all_imus;
  const auto found = std::ranges::find(config.imus, name, &ImuConfig::name);
  if (found == config.imus.end())
    throw wrong_params(fmt::format("there is no such imu; there are {}", fmt::join(names_of(config.imus), ", ")));
  return static_cast<std::uint16_t>(found - config.imus.begin());
}

void RpcParams::finish() const {
  if (!params_.is_object()) return;
  for (const auto& [name, value] : params_.items())
    if (std::find(known_.begin(), known_.end(), name) == known_.end()) {
      throw wrong_params(
          fmt::format("there is no \"{}\"; {}", name, suggestion(name, known_, known_.empty() ? "known: none" : "")));
    }
}

}  // namespace imud
