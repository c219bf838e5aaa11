#include <fmt/format.h>

#include <sstream>
#include <stdexcept>

#include "emulator/config/config_parts.hpp"
#include "emulator/config/fault_reader.hpp"
#include "emulator/faults/other_units.hpp"

namespace imud {
namespace {

// Returns why a unit with these settings cannot replace the imu's unit; empty if it can.
std::string objection(const ImuConfig& imu, const Settings& settings) {
  try {
    static_cast<void>(imu.protocol->make(settings));
    if (imu.protocol->check != nullptr) imu.protocol->check(settings, imu.rate_hz);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  if (imu.protocol->product == nullptr) return {};
  const double rate_hz = imu.protocol->product(settings).rate_hz;
  return rate_hz == imu.rate_hz ? std::string()
                                : fmt::format("it samples at {} Hz, {} at {} Hz; give settings with the same rate",
                                              rate_hz, imu.name, imu.rate_hz);
}

}  // namespace

void read_other_settings(TableReader& table, const std::vector<ImuConfig>& imus, FaultConfig& fault) {
  const toml::node* node = table.node("device");
  const toml::table* given = node == nullptr ? nullptr : node->as_table();
  if (node != nullptr && given == nullptr) return table.fault("device", "give settings, as those of [imu.device]");
  std::optional<TableReader> reader;
  if (given != nullptr) reader.emplace(table.child("device"));
  toml::table only_given = given == nullptr ? toml::table() : *given;
  for (const ImuConfig& imu : imus) {
    if (imu.protocol == nullptr || !fault.acts_on(imu.name)) continue;
    const Settings settings =
        reader ? read_settings(*reader, imu.protocol->settings, nullptr, &imu.settings) : settings_as_delivered(imu);
    if (const std::string wrong = objection(imu, settings); !wrong.empty())
      table.fault("device", fmt::format("{}: {}", imu.name, wrong));
    for (const Setting& setting : imu.protocol->settings)
      if (names_file(setting) && only_given.contains(setting.key))
        only_given.insert_or_assign(setting.key, settings.text(setting.key));
    fault.settings.emplace_back(imu.name, settings);
  }
  if (!reader) return;
  reader->finish();
  only_given.is_inline(true);
  std::ostringstream text;
  text << only_given;
  fault.settings_text = text.str();
  table.resolve("device", std::move(only_given));
}

}  // namespace imud
