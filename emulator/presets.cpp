#include "emulator/presets.hpp"

#include <algorithm>

#include "emulator/config_parts.hpp"

namespace imud {

namespace {
// Returns a comment line of the text, without "# ".
std::string_view comment_line(std::string_view text, int number) noexcept {
  for (; number > 0; --number) text.remove_prefix(text.find('\n') + 1);
  return text.substr(2, text.find('\n') - 2);
}
}  // namespace

std::string_view Preset::summary() const noexcept { return comment_line(text, 0); }
std::string_view Preset::source() const noexcept { return comment_line(text, 1); }

const Preset* find_preset(std::string_view name) noexcept {
  const auto all = presets();
  const auto found =
      std::find_if(all.begin(), all.end(), [name](const Preset& preset) { return preset.name == name; });
  return found == all.end() ? nullptr : &*found;
}

std::string_view default_model(const Protocol& protocol, const Settings& settings) {
  return protocol.preset != nullptr ? protocol.preset(settings) : "white";
}

PresetErrors preset_errors(const Preset& preset, double rate_hz) {
  const toml::table file = toml::parse(preset.text);
  Faults faults("preset " + std::string(preset.name));
  toml::table resolved;
  TableReader imu(file["imu"].as_table(), "imu.", 0, faults, resolved);
  PresetErrors errors = {.gyro = read_gyro(imu.child("gyro"), nullptr, rate_hz),
                         .accelerometer = read_accelerometer(imu.child("accelerometer"), nullptr, rate_hz)};
  imu.finish();
  if (!faults.all().empty()) throw ConfigError(faults.all());
  return errors;
}

}  // namespace imud
