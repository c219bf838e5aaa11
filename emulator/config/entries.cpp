#include "emulator/config/entries.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <boost/algorithm/string/replace.hpp>
#include <cstdio>
#include <type_traits>
#include <variant>
#include <vector>

#include "emulator/config/config_parts.hpp"
#include "emulator/frames/described_protocols.hpp"

namespace imud {

std::optional<Entries> find_entries(const std::string& name) {
  const Entries found{resolve_protocol(name), find_truth_format(name), find_transport(name), find_preset(name)};
  if (found.protocol != nullptr || found.format != nullptr || found.transport != nullptr || found.preset != nullptr)
    return found;
  std::vector<std::string> known = protocol_names();
  for (const auto& more : {names(truth_formats()), names(transports())})
    known.insert(known.end(), more.begin(), more.end());
  for (const auto all : {presets(), field_presets()})
    for (const Preset& preset : all) known.emplace_back(preset.name);
  fmt::print(stderr, "imud: there is no protocol, truth format, transport or preset \"{}\"; {}\n", name,
             suggestion(name, known, "see imud list"));
  return std::nullopt;
}

nlohmann::ordered_json initial_value(const Setting& setting) {
  return std::visit(
      [](const auto& value) -> nlohmann::ordered_json {
        if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::span<const std::string_view>>)
          return std::vector<std::string>(value.begin(), value.end());
        else
          return value;
      },
      setting.initial);
}

std::string valid_values(const Setting& setting) {
  const bool is_list = std::holds_alternative<std::span<const std::string_view>>(setting.initial);
  if (!setting.choices.empty())
    return fmt::format("{} of {}", is_list ? "any" : "one", fmt::join(setting.choices, ", "));
  return setting.min < setting.max ? fmt::format("{} to {}", setting.min, setting.max) : std::string();
}

std::string valid_values(const PortOption& option) {
  const std::string words = boost::replace_all_copy(std::string(option.choices), " ", ", ");
  if (!option.has_range()) return words.empty() ? "text" : "one of " + words;
  return fmt::format("{} to {}{}{}", option.min, option.max, words.empty() ? "" : ", or ", words);
}

}  // namespace imud
