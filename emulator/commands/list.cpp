#include "emulator/commands/list.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "emulator/config/entries.hpp"
#include "emulator/faults/fault_kinds.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/plan/fault_units.hpp"
#include "protocols/frames/layout/frame_check.hpp"
#include "protocols/quantities/truth_quantities.hpp"

namespace imud {
namespace {

using Json = nlohmann::ordered_json;

std::string_view word(ColumnGroup::Need need) {
  return need == ColumnGroup::required ? "required" : need == ColumnGroup::one_of ? "one of these" : "optional";
}

template <class Entry>
Json described(std::string_view kind, const Entry& entry) {
  return {{"kind", kind}, {"name", entry.name}, {"summary", entry.summary}, {"document", entry.document}};
}

Json described(std::span<const Setting> settings) {
  Json all = Json::array();
  for (const Setting& setting : settings)
    all.push_back({{"key", setting.key},
                   {"help", setting.help},
                   {"default", initial_value(setting)},
                   {"valid", valid_values(setting)}});
  return all;
}

// Returns the default `model` for the initial settings, then the default for each choice of the setting `model`.
Json default_models(const Protocol& protocol) {
  Settings settings(protocol.settings);
  std::vector<std::string> models = {std::string(default_model(protocol, settings))};
  for (const Setting& setting : protocol.settings)
    for (const std::string_view choice :
         setting.key == "model" ? setting.choices : std::span<const std::string_view>{}) {
      settings.set_text(setting.key, choice);
      const std::string model(default_model(protocol, settings));
      if (std::find(models.begin(), models.end(), model) == models.end()) models.push_back(model);
    }
  return models;
}

Json described(const Protocol& protocol) {
  Json json = described("protocol", protocol);
  json["link"] = protocol.link == Link::can ? "CAN" : "bytes";
  json["models"] = default_models(protocol);
  if (const double rate_hz = default_rate_hz(protocol, Settings(protocol.settings)); rate_hz > 0)
    json["rate_hz"] = rate_hz;
  json["settings"] = described(protocol.settings);
  if (is_described(protocol)) json["layout"] = protocol.layout(Settings(protocol.settings));
  if (std::ranges::any_of(protocol.settings, &Setting::names_frames))
    for (const DescribedTitle& title : described_titles())
      json["descriptions"].push_back(
          {{"name", title.name}, {"summary", title.summary}, {"document", title.document}});
  json["counters"] = Json::array();
  for (const DeviceCounter& counter : protocol.counters)
    json["counters"].push_back({{"key", counter.key}, {"help", counter.words}});
  return json;
}

Json described(const TruthFormat& format) {
  Json json = described("truth format", format);
  json["settings"] = described(format.settings);
  for (const ColumnGroup& group : format.columns)
    json["columns"].push_back({{"names", group.names}, {"need", word(group.need)}, {"help", group.help}});
  if (format.maps_quantities)
    for (const QuantityGroup& group : quantity_groups())
      json["quantities"].push_back(
          {{"names", group.names}, {"units", unit_suffixes(group.kind)}, {"help", group.help}});
  return json;
}

Json described(const Transport& transport) {
  Json json = described("transport", transport);
  json["syntax"] = transport.syntax;
  json["example"] = transport.example;
  json["options"] = Json::array();
  for (const PortOption& option : transport.options)
    json["options"].push_back({{"key", option.key}, {"help", option.help}, {"valid", valid_values(option)}});
  return json;
}

Json described(const Preset& preset) {
  Json json = {
      {"kind", "preset"}, {"name", preset.name}, {"summary", preset.summary()}, {"document", preset.source()}};
  json["figures"] = Json::array();
  json["unconfirmed"] = Json::array();
  for (const Preset::Figure& figure : preset.figures()) {
    json["figures"].push_back({{"key", figure.key}, {"value", figure.value}, {"confidence", figure.confidence}});
    if (!figure.note.empty()) json["figures"].back()["note"] = figure.note;
    if (!figure.is_confirmed()) json["unconfirmed"].push_back(figure.key);
  }
  json["toml"] = preset.text;
  return json;
}

Json described(const FaultKind& kind) {
  Json json = {{"kind", "fault"}, {"name", kind.name}, {"summary", kind.summary}};
  json["targets"] = std::vector<std::string>(kind.targets.begin(), kind.targets.end());
  json["axes"] = kind.has_axes;
  json["ramp"] = kind.is_ramped;
  if (!kind.stays.empty()) json["afterwards"] = kind.stays;
  json["settings"] = Json::array();
  if (kind.has_settings)
    json["settings"].push_back(
        {{"key", "device"},
         {"help", "settings of the other unit, as in [imu.device], over those of its own; absent: as delivered"}});
  for (const FaultParameter& parameter : kind.parameters) {
    Json setting = {{"key", parameter.key}, {"help", parameter.meaning}};
    if (std::isfinite(parameter.initial)) setting["default"] = parameter.initial;
    json["settings"].push_back(std::move(setting));
  }
  return json;
}

// Returns the description of a check. The parameters of a CRC are texts in hexadecimal, as in catalogues; any other
// check has its size only.
Json described_check(const std::string& name) {
  Json json = {{"kind", "check"}, {"name", name}};
  const CrcAlgorithm* crc = find_crc(name);
  json["width"] = 8 * FrameCheck::find(name, {})->size();
  if (crc == nullptr) return json;
  const auto hex = [crc](std::uint64_t number) { return fmt::format("{:0{}X}", number, crc->parameters.width / 4); };
  const auto& [width, poly, init, refin, refout, xorout] = crc->parameters;
  json.update({{"poly", hex(poly)}, {"init", hex(init)}, {"refin", refin}, {"refout", refout}});
  json.update({{"xorout", hex(xorout)}, {"check", hex(crc->check)}});
  return json;
}

std::string text(const Json& json, const char* key) { return json.value(key, std::string()); }

void print_table(const char* key, const Json& rows) {
  if (rows.empty()) fmt::print("  no {} of its own\n", key);
  for (const Json& row : rows) {
    std::string valid = row.contains("default") ? row["default"].dump() : "";
    if (const std::string range = text(row, "valid"); !range.empty()) valid += (valid.empty() ? "" : "; ") + range;
    fmt::print("  {:<24} {}{}\n", text(row, "key"), text(row, "help"),
               valid.empty() ? "" : fmt::format(" ({})", valid));
  }
}

void print(const Json& entry) {
  fmt::print("{} {}: {} [{}]\n", text(entry, "kind"), text(entry, "name"), text(entry, "summary"),
             text(entry, "document"));
  if (entry.contains("syntax"))
    fmt::print("  syntax   {}\n  example  \"{}\"\n", text(entry, "syntax"), text(entry, "example"));
  if (entry.contains("models")) {
    const auto models = entry["models"].get<std::vector<std::string>>();
    fmt::print("  default of model in [[imu]]: {}{}\n", fmt::join(models, " or "),
               models.size() > 1 ? ", by device.model" : "");
  }
  if (entry.contains("rate_hz")) fmt::print("  default of rate_hz in [[imu]]: {}\n", entry["rate_hz"].get<double>());
  for (const char* key : {"settings", "options"})
    if (entry.contains(key)) print_table(key, entry[key]);
  for (const Json& line : entry.value("layout", Json::array())) fmt::print("  {}\n", line.get<std::string>());
  if (entry.contains("descriptions")) fmt::print("  descriptions that are shipped:\n");
  for (const Json& shipped : entry.value("descriptions", Json::array()))
    fmt::print("  {:<24} {} [{}]\n", text(shipped, "name"), text(shipped, "summary"), text(shipped, "document"));
  if (entry.contains("counters") && !entry["counters"].empty()) {
    fmt::print("  counters of its own, in the summary and in limits:\n");
    print_table("counters", entry["counters"]);
  }
  if (entry.contains("unconfirmed"))
    fmt::print("  {} of {} values are unconfirmed: from memory, from a secondary source, or assumed\n",
               entry["unconfirmed"].size(), entry["figures"].size());
  for (const Json& figure : entry.value("figures", Json::array()))
    fmt::print("  {:<56} {:<22} {:<16}{}{}\n", text(figure, "key"), text(figure, "value"), text(figure, "confidence"),
               figure.contains("note") ? "  " : "", text(figure, "note"));
  if (entry.contains("figures")) fmt::print("  as a file: imud example {} --model\n", text(entry, "name"));
  const auto words = [](const Json& list) { return list.get<std::vector<std::string>>(); };
  if (entry.contains("columns")) fmt::print("  columns, by the names in the header row:\n");
  for (const Json& group : entry.value("columns", Json::array()))
    fmt::print("  {:<12} {}: {}\n", text(group, "need"), fmt::join(words(group["names"]), ", "), text(group, "help"));
  if (entry.contains("quantities"))
    fmt::print("  quantities, for a map in `columns`; one of the units follows a name, as in p_deg_per_s:\n");
  for (const Json& group : entry.value("quantities", Json::array()))
    fmt::print("  {}: {}{}\n", fmt::join(words(group["names"]), ", "), text(group, "help"),
               group["units"].empty() ? "" : fmt::format(" ({})", fmt::join(words(group["units"]), " ")));
}

// The kinds of faults, all of one target together.
void print_faults() {
  std::vector<std::string_view> targets;
  for (const FaultKind* kind : fault_kinds())
    for (const std::string_view target : kind->targets)
      if (std::find(targets.begin(), targets.end(), target) == targets.end()) targets.push_back(target);
  for (const std::string_view target : targets) {
    std::vector<std::string_view> units;
    for (const KeyUnit& unit : fault_units(target)) units.push_back(unit.suffix.substr(1));
    fmt::print("target {}{}\n", target,
               units.empty() ? std::string() : fmt::format(", values in {}", fmt::join(units, ", ")));
    for (const FaultKind* kind : fault_kinds()) {
      if (std::find(kind->targets.begin(), kind->targets.end(), target) == kind->targets.end()) continue;
      fmt::print("  {:<16} {}{}\n", kind->name, kind->summary,
                 kind->stays.empty() ? std::string() : fmt::format("; afterwards {}", kind->stays));
      for (const FaultParameter& parameter : kind->parameters)
        fmt::print("    {:<14} {}{}\n", parameter.key, parameter.meaning,
                   std::isfinite(parameter.initial) ? fmt::format(" ({:g})", parameter.initial) : std::string());
    }
  }
}

// The checks of frames, for descriptions of them.
void print_checks() {
  fmt::print("{:<24} {:>5}  poly init refin refout xorout, and the check of \"123456789\"\n", "check", "width");
  for (const std::string& name : FrameCheck::names({})) {
    const Json check = described_check(name);
    fmt::print("{:<24} {:>5}", name, check["width"].get<int>());
    if (check.contains("poly"))
      fmt::print("  {} {} {} {} {}, {}", text(check, "poly"), text(check, "init"), check["refin"].get<bool>(),
                 check["refout"].get<bool>(), text(check, "xorout"), text(check, "check"));
    fmt::print("\n");
  }
}

// Prints the entries of one table, a line each.
template <class Entry>
void print_lines(std::string_view title, std::span<const Entry* const> entries) {
  fmt::print("{}\n", title);
  for (const Entry* entry : entries) {
    fmt::print("  {:<16} {}", entry->name, entry->summary);
    if constexpr (std::is_same_v<Entry, Transport>) fmt::print("; {}", entry->syntax);
    fmt::print(" [{}]\n", entry->document);
  }
}

void print_lines() {
  print_lines("protocols", protocols());
  fmt::print("protocols that a shipped description has\n");
  for (const DescribedTitle& title : described_titles())
    fmt::print("  {:<16} {} [{}]\n", title.name, title.summary, title.document);
  print_lines("truth formats", truth_formats());
  print_lines("transports", transports());
  fmt::print("presets\n");
  for (const auto all : {presets(), field_presets()})
    for (const Preset& preset : all) fmt::print("  {:<16} {} [{}]\n", preset.name, preset.summary(), preset.source());
}

}  // namespace

int list(const std::string& name, bool json) {
  if (name == "faults" && !json) {
    print_faults();
    return 0;
  }
  if (name == "checks" && !json) {
    print_checks();
    return 0;
  }
  if (name.empty() && !json) {
    print_lines();
    return 0;
  }
  Json chosen = Json::array();
  const auto add = [&](const auto* entry) {
    if (entry != nullptr) chosen.push_back(described(*entry));
  };
  if (name == "faults") {
    for (const FaultKind* kind : fault_kinds()) add(kind);
  } else if (name == "checks") {
    for (const std::string& check : FrameCheck::names({})) chosen.push_back(described_check(check));
  } else if (!name.empty()) {
    const auto entries = find_entries(name);
    if (!entries) return 2;
    add(entries->protocol);
    add(entries->format);
    add(entries->transport);
    add(entries->preset);
  } else {
    for (const Protocol* protocol : protocols()) add(protocol);
    for (const Protocol* protocol : described_protocols()) add(protocol);
    for (const TruthFormat* format : truth_formats()) add(format);
    for (const Transport* transport : transports()) add(transport);
    for (const auto all : {presets(), field_presets()})
      for (const Preset& preset : all) add(&preset);
  }
  if (json)
    fmt::print("{}\n", chosen.dump(2));
  else
    for (const Json& entry : chosen) print(entry);
  return 0;
}

}  // namespace imud
