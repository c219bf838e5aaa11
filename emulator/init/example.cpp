#include "emulator/init/example.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "emulator/config/entries.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/plan/config.hpp"

namespace imud {
namespace {

// Returns the first entry that fulfils `condition`. Requires that there is one.
template <class Entry, class Condition>
const Entry* first(std::span<const Entry* const> table, Condition condition) {
  return *std::find_if(table.begin(), table.end(), [&](const Entry* entry) { return condition(*entry); });
}

std::string comment(std::string_view what, const std::string& valid) {
  return fmt::format("# {}{}\n", what, valid.empty() ? "" : " (" + valid + ")");
}

// Returns the settings as comments; a # before a key makes it one.
// `unit`: the value of the setting `model`; empty: the default.
std::string settings_text(std::span<const Setting> settings, std::string_view unit = {}) {
  std::string text;
  for (const Setting& setting : settings) {
    text += comment(setting.help, valid_values(setting));
    if (setting.key == "model" && !unit.empty())
      text += fmt::format("model = \"{}\"\n", unit);
    else
      text += fmt::format("#{} = {}\n", setting.key, initial_value(setting).dump());
  }
  return text;
}

// Returns the line of a port, after the options that it may have.
std::string port_text(std::string_view key, const Transport& transport, std::string_view port) {
  std::string text = comment(transport.summary, "");
  for (const PortOption& option : transport.options)
    text += comment(fmt::format("option {}: {}", option.key, option.help), valid_values(option));
  return text + fmt::format("{} = {}\n", key, toml_word(port));
}

// Returns true if truth may come through the transport in that way.
bool brings(const Transport& transport, TruthFormat::Way way) {
  if (!transport.brings_truth) return false;
  switch (way) {
    case TruthFormat::Way::datagrams:
      return transport.udp_port != nullptr && !transport.ends;
    case TruthFormat::Way::connection:
      return transport.tcp_port != nullptr && !transport.ends;
    case TruthFormat::Way::file:
      return transport.ends && transport.serves_device;
  }
  return false;
}

// Returns the port of the truth in an example with that transport.
std::string truth_port_text(const TruthFormat& format, const Transport& port) {
  // A device of the same configuration may have the example port of the same transport.
  const std::string_view example = format.example_port.empty() ? "127.0.0.1:9810" : format.example_port;
  return brings(port, format.way) ? fmt::format("{}:{}", port.name, example) : std::string(port.example);
}

// Returns the transport by which the records of a format usually come.
const Transport* usual_transport(const TruthFormat& format) {
  return first(transports(), [&](const Transport& t) { return brings(t, format.way); });
}

std::string model_text(const Preset& preset) {
  return comment(preset.summary(), std::string(preset.source())) +
         fmt::format("model = {}\n", toml_word(preset.name));
}

std::string model_text(const Protocol& protocol, const Settings& settings, const Preset* preset) {
  if (preset == nullptr)
    return fmt::format("# whose errors the sensors have: a preset of imud list, ideal, or white\n#model = \"{}\"\n",
                       default_model(protocol, settings));
  return model_text(*preset);
}

// Returns whether a preset has figures of the sensor, such as "barometer".
bool has_sensor(const Preset& preset, std::string_view sensor) {
  return std::ranges::any_of(preset.figures(),
                             [&](const Preset::Figure& figure) { return figure.key.starts_with(sensor); });
}

// Returns the tables that take the errors of a preset without gyros.
std::string field_models_text(const Preset& preset) {
  std::string text;
  for (const std::string_view sensor : {"magnetometer", "barometer"})
    if (has_sensor(preset, sensor)) text += fmt::format("\n[imu.{}]\n{}", sensor, model_text(preset));
  return text;
}

// Returns a sample rate, Hz, at which the messages of a protocol that is no product are possible and fit on the line.
double example_rate_hz(const Protocol& protocol, const std::string& port) {
  constexpr double usual = 200;
  for (const double rate_hz : {usual, 100.0, 50.0, 20.0, 10.0, 1000.0, 2000.0}) try {
      ImuConfig imu;
      imu.protocol = &protocol;
      imu.settings = Settings(protocol.settings);
      imu.rate_hz = rate_hz;
      imu.port = port;
      imu.port_settings.uart = protocol.make(imu.settings)->uart();
      if (protocol.check != nullptr) protocol.check(imu.settings, rate_hz);
      if (line_load(imu).percent <= 100.0) return rate_hz;
    } catch (const std::invalid_argument&) {
      continue;  // a message is sent more often
    }
  return usual;
}

}  // namespace

std::string toml_word(std::string_view text) { return nlohmann::json(text).dump(); }

std::string truth_text(const TruthFormat& format, const std::string& port) {
  const std::string address = port.empty() ? truth_port_text(format, *usual_transport(format)) : port;
  std::string text = "[truth]\n" + port_text("port", *transport_of(address), address) +
                     comment(format.summary, std::string(format.document)) +
                     fmt::format("format = \"{}\"\n", format.name);
  for (const ColumnGroup& group : format.columns)
    text += comment(fmt::format("{} column: {}: {}",
                                group.need == ColumnGroup::optional   ? "optional"
                                : group.need == ColumnGroup::required ? "required"
                                                                      : "alternative",
                                fmt::join(group.names, ", "), group.help),
                    "");
  return text + settings_text(format.settings);
}

std::string imu_text(const Protocol& protocol, const std::string& port, std::string_view unit, const Preset* preset) {
  const Transport& transport = *transport_of(port);
  Settings settings(protocol.settings);
  if (!unit.empty()) settings.set_text("model", unit);
  std::string text = "\n[[imu]]\n#name = \"imu1\"\n" + comment(protocol.summary, std::string(protocol.document)) +
                     fmt::format("protocol = \"{}\"\n", protocol.name) + port_text("port", transport, port);
  if (protocol.has_second_uart)
    text += "# where the product's second UART is connected\n#second_port = \"pty:imu1.2\"\n";
  const double own_hz = default_rate_hz(protocol, settings);
  if (protocol.product == nullptr)
    text += fmt::format("# samples per second\n{}\n",
                        own_hz > 0 ? fmt::format("#rate_hz = {}", own_hz)
                                   : fmt::format("rate_hz = {}", example_rate_hz(protocol, port)));
  if (preset != nullptr && !has_sensor(*preset, "gyro"))
    return imu_text(protocol, port, unit) + field_models_text(*preset);
  text += model_text(protocol, settings, preset);
  if (!protocol.settings.empty()) text += "\n[imu.device]\n" + settings_text(protocol.settings, unit);
  if (protocol.has_sync_pins)
    text +=
        "\n[imu.sync]\n# pins, as UDP ports: protocols/README.md\n#trigger_port = \"udp:127.0.0.1:9811\"\n"
        "#pps_port = \"udp:127.0.0.1:9812\"\n#tov_port = \"udp:127.0.0.1:9813\"\n";
  const bool has_preset = preset != nullptr || find_preset(default_model(protocol, settings)) != nullptr;
  if (protocol.product == nullptr && !has_preset)
    text +=
        "\n[imu.gyro]\n# range of each axis\nmax_rad_per_s = 10\n\n[imu.accelerometer]\n# range of each axis\n"
        "max_m_per_s2 = 200\n";
  return text;
}

int example(const std::string& name) {
  const auto entries = find_entries(name);
  if (!entries) return 2;
  const Transport* named = entries->transport;
  const bool is_device_port = named != nullptr && named->serves_device;
  const Protocol* protocol = entries->protocol;
  if (protocol == nullptr)  // a product's example is the shortest, but a product sets its line itself
    protocol = first(protocols(), [&](const Protocol& p) {
      if (is_device_port && named->carries_can) return p.link == Link::can;
      return p.link != Link::can && (p.product == nullptr) == is_device_port;
    });
  const TruthFormat* format = entries->format;
  if (format == nullptr) format = find_truth_format(default_truth_format);
  const Transport* truth_port = named;
  if (named == nullptr || is_device_port) truth_port = usual_transport(*format);
  const Transport* port = named;
  if (!is_device_port)
    port = first(transports(), [&](const Transport& t) {
      return protocol->link == Link::can ? t.carries_can : t.uart == Uart::emulated;
    });

  fmt::print(
      "# imud example {}\n"
      "# A # before a key makes it a comment, which shows the default or an example. `imud check FILE` shows what a\n"
      "# configuration does; emulator/CONFIGURATION.md describes every key.\n\n"
      "# seed of all random numbers\n#seed = 1\n"
      "# what paces the samples (one of realtime, lockstep, fast)\n#clock = \"realtime\"\n\n{}{}",
      name, truth_text(*format, truth_port_text(*format, *truth_port)),
      imu_text(*protocol, std::string(port->example), {}, entries->protocol == nullptr ? entries->preset : nullptr));
  return 0;
}

int example_model(const std::string& name) {
  const auto entries = find_entries(name);
  if (!entries) return 2;
  if (entries->preset == nullptr) {
    fmt::print(stderr, "imud: \"{}\" is no preset; see imud list\n", name);
    return 2;
  }
  fmt::print("{}", entries->preset->text);
  return 0;
}

}  // namespace imud
