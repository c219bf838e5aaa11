#include "emulator/config/presets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <system_error>
#include <utility>
#include <vector>

#include "emulator/config/config_parts.hpp"
#include "emulator/ground/text_file.hpp"
#include "protocols/frames/frame_device.hpp"

namespace imud {
namespace {

constexpr std::string_view end_of_file = ".toml";

// Returns a comment line of the text, without "# "; empty if that line is no comment.
std::string_view comment_line(std::string_view text, int number) noexcept {
  for (; number > 0; --number) text.remove_prefix(std::min(text.find('\n'), text.size() - 1) + 1);
  const std::string_view line = text.substr(0, text.find('\n'));
  return line.starts_with("# ") ? line.substr(2) : std::string_view();
}

// Returns the preset in a user's file; nullptr if the file cannot be read.
const Preset* preset_in_file(const std::string& path) {
  struct File {
    std::string text;
    Preset preset;
  };
  static std::map<std::string, File> files;
  const auto known = files.find(path);
  if (known != files.end()) return &known->second.preset;
  try {
    std::string text = read_whole(path);
    if (text.empty()) return nullptr;
    const auto place = files.emplace(path, File{std::move(text), {}}).first;
    place->second.preset = {place->first, place->second.text};
    return &place->second.preset;
  } catch (const std::system_error&) {
    return nullptr;
  }
}

// Returns the model that the table names, or the path of its file.
std::string model_in(TableReader& table, std::string_view own) {
  std::string model = table.text("model", std::string(own));
  return model.ends_with(end_of_file) ? file_named(table, "model", model) : model;
}

// Returns how a table of a file states its white noise. The file may lack the table.
Sidedness sidedness_of(const toml::table* triad) {
  if (triad == nullptr) return Sidedness::none;
  bool is_density = false;
  for (const auto& [key, value] : *triad)
    is_density = is_density || (key.str().starts_with("noise_density_") && key.str() != "noise_density_sidedness");
  if (!is_density) return Sidedness::none;
  return (*triad)["noise_density_sidedness"].value_or(std::string_view()) == "one_sided" ? Sidedness::one_sided
                                                                                         : Sidedness::two_sided;
}

// Removes the mark from the beginning of a comment, with the words that separate the mark from the note.
std::string_view take_confidence(std::string_view& comment, std::string_view unmarked) {
  constexpr std::string_view mark = "unconfirmed: ";
  if (!comment.starts_with(mark)) return unmarked;
  comment.remove_prefix(mark.size());
  const std::string_view words = comment.substr(0, comment.find(';'));
  comment.remove_prefix(std::min(comment.size(), words.size() + 2));
  return words.starts_with("secondary source") ? "secondary source"
         : words.starts_with("assumed")        ? "assumed"
                                               : "memory";
}

// Returns the given words and the names of all presets, for suggestions.
std::vector<std::string> preset_words(std::vector<std::string> words) {
  for (const Preset& known : presets()) words.emplace_back(known.name);
  return words;
}

}  // namespace

std::vector<Preset::Figure> Preset::figures() const {
  std::vector<Figure> all;
  std::string triad;
  const std::string_view unmarked = name.ends_with(".toml") ? "not marked" : "document";
  for (std::string_view rest = text; !rest.empty();) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    if (line.starts_with("[imu.")) triad = std::string(line.substr(5, line.find(']') - 5)) + ".";
    const std::size_t equals = line.find(" = ");
    if (line.starts_with("#") || equals == line.npos) continue;
    const std::string_view value = line.substr(equals + 3, line.find("  # ") - (equals + 3));
    std::string_view comment;
    if (const std::size_t at = line.find("  # "); at != line.npos) comment = line.substr(at + 4);
    const std::string_view confidence = take_confidence(comment, unmarked);
    all.push_back(
        {triad + std::string(line.substr(0, equals)), std::string(value), confidence, std::string(comment)});
  }
  return all;
}
std::string_view Preset::summary() const noexcept { return comment_line(text, 0); }
std::string_view Preset::source() const noexcept { return comment_line(text, 1); }

const Preset* find_preset(std::string_view name) {
  if (name.ends_with(end_of_file)) return preset_in_file(std::string(name));
  for (const std::span<const Preset> all : {presets(), field_presets()})
    if (const auto found = std::ranges::find(all, name, &Preset::name); found != all.end()) return &*found;
  return nullptr;
}

std::string_view default_model(const Protocol& protocol, const Settings& settings) {
  return protocol.preset != nullptr ? protocol.preset(settings) : "white";
}

double default_rate_hz(const Protocol& protocol, const Settings& settings) {
  if (protocol.product != nullptr) return protocol.product(settings).rate_hz;
  return settings.frames() != nullptr ? default_rate_hz(*settings.frames()) : 0;
}

bool PresetErrors::is_within(double rate_hz) const {
  const auto bandwidth_hz = [&](const TriadErrors& triad) {
    return triad.filter.is_on() ? triad.filter.cut_off_hz.maxCoeff() : 0.5 * internal_rate_hz;
  };
  return std::max(bandwidth_hz(gyro), bandwidth_hz(accelerometer)) <= 0.5 * rate_hz;
}

void PresetErrors::decimate(double rate_hz) {
  const double share = std::min(1.0, rate_hz / internal_rate_hz);
  for (TriadErrors* triad : {&gyro, &accelerometer, inclinometer ? &*inclinometer : nullptr}) {
    if (triad == nullptr) continue;
    triad->filter = {};
    triad->fir_taps.reset();
    if (decimation == Decimation::mean) triad->lsb *= share;
  }
}

PresetErrors preset_errors(const Preset& preset, double rate_hz) {
  Faults faults("preset " + std::string(preset.name));
  toml::table file;
  try {
    file = toml::parse(preset.text);
  } catch (const toml::parse_error& error) {
    faults.add(error.source().begin.line, "TOML", error.description());
    throw ConfigError(faults.all());
  }
  toml::table resolved;
  TableReader root(&file, "", 0, faults, resolved);
  TableReader imu = root.child("imu");
  PresetErrors errors;
  errors.internal_rate_hz = imu.real("internal_rate_hz", 0, 0, ImuConfig::max_internal_rate_hz);
  errors.decimation = imu.choice<Decimation>(
      "decimation", {{Decimation::sample, "sample"}, {Decimation::mean, "mean"}}, errors.decimation);
  const double internal_hz = std::max(rate_hz, errors.internal_rate_hz);
  const bool has_magnetometer = imu.has_table("magnetometer"), has_barometer = imu.has_table("barometer");
  errors.is_imu = imu.has_table("gyro") || imu.has_table("accelerometer") || !(has_magnetometer || has_barometer);
  if (errors.is_imu) {
    errors.gyro = read_gyro(imu.child("gyro"), nullptr, internal_hz);
    errors.accelerometer = read_accelerometer(imu.child("accelerometer"), nullptr, internal_hz);
    errors.gyro_density = sidedness_of(file["imu"]["gyro"].as_table());
    errors.accelerometer_density = sidedness_of(file["imu"]["accelerometer"].as_table());
    if (imu.has("inclinometer")) {
      errors.inclinometer = read_inclinometer(imu.child("inclinometer"), nullptr, internal_hz);
      errors.inclinometer_density = sidedness_of(file["imu"]["inclinometer"].as_table());
    }
  }
  if (has_magnetometer) {
    CurrentField no_current;
    errors.magnetometer = read_magnetometer(imu.child("magnetometer"), nullptr, rate_hz, no_current);
    errors.magnetometer_density = sidedness_of(file["imu"]["magnetometer"].as_table());
  }
  if (has_barometer) read_barometer(imu.child("barometer"), errors.barometer.emplace());
  imu.finish();
  root.finish();
  if (!faults.all().empty()) throw ConfigError(faults.all());
  return errors;
}

std::optional<PresetErrors> read_field_model(TableReader& table, bool (*has)(const PresetErrors&), double rate_hz) {
  if (!table.has("model")) return std::nullopt;
  const std::string model = model_in(table, "");
  const auto errors_of = [&](const Preset& preset) -> std::optional<PresetErrors> {
    PresetErrors errors = preset_errors(preset, rate_hz);
    return has(errors) ? std::optional(std::move(errors)) : std::nullopt;
  };
  try {
    const Preset* preset = find_preset(model);
    if (preset != nullptr)
      if (auto errors = errors_of(*preset)) return errors;
    std::vector<std::string> words;
    for (const Preset& known : field_presets())
      if (errors_of(known)) words.emplace_back(known.name);
    table.fault("model", fmt::format("there is no such sensor \"{}\"; {}", model, suggestion(model, words)));
  } catch (const ConfigError& error) {
    table.fault("model", error.what());
  }
  return std::nullopt;
}

const Preset* read_model(TableReader& table, std::string_view own, std::string& model) {
  model = model_in(table, own);
  const Preset* preset = find_preset(model);
  if (preset != nullptr || model == "white" || model == model_without_errors) return preset;
  table.fault("model", fmt::format("there is no \"{}\"; {}", model,
                                   suggestion(model, preset_words({"white", std::string(model_without_errors)}))));
  return nullptr;
}

std::string_view own_model(TableReader& table, const ImuConfig& imu) {
  constexpr std::string_view none = "white";
  if (imu.protocol == nullptr) return none;
  const std::string_view model = default_model(*imu.protocol, imu.settings);
  const auto& description = imu.settings.frames();
  if (description == nullptr || model == none || std::ranges::count(presets(), model, &Preset::name) > 0)
    return model;
  table.child("device").fault("frame_file", fmt::format("{}: model: there is no preset \"{}\"; {}", description->file,
                                                        model, suggestion(model, preset_words({}))));
  return none;
}

}  // namespace imud
