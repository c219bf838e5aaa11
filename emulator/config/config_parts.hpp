// The parts of reading a configuration that its files share.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/config/presets.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/plan/config.hpp"
#include "transports/port.hpp"

namespace imud {

template <class Entry>
std::vector<std::string> names(std::span<const Entry* const> table) {
  std::vector<std::string> all;
  for (const Entry* entry : table) all.emplace_back(entry->name);
  return all;
}

// Returns `found`, the table entry that `word` names. Adds a fault of `key` if there is none, unless `word` is empty
// because the key is absent or not text: then there is a fault already.
template <class Entry>
const Entry* entry(TableReader& table, std::string_view key, const std::string& word,
                   std::span<const Entry* const> entries, const Entry* found) {
  if (found != nullptr || (word.empty() && !is_text(table, key))) return found;
  table.fault(key, fmt::format("there is no \"{}\"; {}", word, suggestion(word, names(entries))));
  return nullptr;
}

// Returns the canonical path of the file that a port opens, or of its link; empty if it has none.
std::string path_of(const std::string& port);
// Returns the regular file that a port reads or writes (regular_file()); empty if it has none.
std::string file_of(const std::string& port);

// Lists the files in config.files. Adds a fault for each imu that would write over the configuration, which was read
// from `path`, over a file that it names, over the truth, or over a file that is in config.files already.
void check_files(Config& config, const std::string& path, const toml::array& tables, Faults& faults);

// Returns the UDP port on which a listener at `port` receives; nullopt if it receives on all or none, if the system
// chooses it, or if the text is malformed.
std::optional<std::uint16_t> udp_port(const std::string& port);
// Returns the TCP port number that `port` connects to or listens at; nullopt if it uses no TCP, if the system chooses
// the number, or if the text is malformed.
std::optional<std::uint16_t> tcp_port(const std::string& port);

// Returns true if the setting is the path of a file; frame_file may be the name of a shipped description instead.
inline bool names_file(const Setting& setting) { return setting.key.ends_with("_file"); }
// Reads the declared settings from `table`, or from `own`, a subtable that has only these settings. A list may be
// given as a table: {a = "b"} is ["a=b"]; a whole number in it counts as its text. Adds a fault for each value
// that is refused. `absent`: the values of absent keys; nullptr: the initial ones.
Settings read_settings(TableReader& table, std::span<const Setting> declared, TableReader* own = nullptr,
                       const Settings* absent = nullptr);

// Returns the transport that the port's text names, if check_port() accepts the text with `settings`. Otherwise
// returns nullptr and adds a fault of `key`, unless the key has no text.
const Transport* read_port(TableReader& table, std::string_view key, const std::string& text,
                           const PortSettings& settings);

// Returns examples of ports whose transports fulfil `condition`, in quotes.
template <class Condition>
std::string ports_that(Condition condition) {
  return fmt::format("\"{}\"", fmt::join(port_examples(condition), "\" or \""));
}

// Reads the errors of three sensors. `product`: the values of absent keys; nullptr: an ideal sensor's values, and the
// range is required. `rate_hz`: the rate of their samples; for all but magnetometers the internal rate. `density`:
// how the white noise of `product` was stated (triad_config.cpp).
TriadErrors read_gyro(TableReader table, const TriadErrors* product, double rate_hz,
                      Sidedness density = Sidedness::none);
TriadErrors read_accelerometer(TableReader table, const TriadErrors* product, double rate_hz,
                               Sidedness density = Sidedness::none);
TriadErrors read_inclinometer(TableReader table, const TriadErrors* product, double rate_hz,
                              Sidedness density = Sidedness::none);
// The field of an electric current, T/A, and its standard deviation from unit to unit.
struct CurrentField {
  Vector3 field, sigma;
};
TriadErrors read_magnetometer(TableReader table, const TriadErrors* product, double rate_hz, CurrentField& current);

// Reads [[imu.cause]] into model.causes. Requires that the errors of the triads have been read
// (sensor_keys.cpp).
void read_causes(TableReader& imu, ImuModel& model);

// Read the errors of a barometer, which replace the product's errors in `errors`, and the errors or the filter of
// a navigation solution (navigation_config.cpp). read_navigation() requires that the errors of the sensors have
// been read. The filter has the gravitation of the truth's world; the receiver of the filter must have places in
// this world.
void read_barometer(TableReader table, BarometerErrors& errors);
void read_navigation(TableReader table, const TruthConfig& truth, ImuConfig& imu);

// Read the vibration of a sensor, and its temperature (environment_config.cpp).
VibrationModel read_vibration(TableReader table);
TemperatureModel read_temperature(TableReader table);

// Reads where the web server listens (web/web_config.cpp).
WebConfig read_web(TableReader table);

// Returns the name of the model that the protocol and the settings of an imu imply. Adds a fault if a description
// of frames names a model that does not exist (presets.cpp).
std::string_view own_model(TableReader& table, const ImuConfig& imu);
// Reads the `model` of an imu, by default `own`, and returns its preset; nullptr if the word names no preset, or
// there is no such preset, which is a fault (presets.cpp).
const Preset* read_model(TableReader& table, std::string_view own, std::string& model);
// Reads the `model` of a magnetometer or a barometer, a preset that `has` one; nullopt if there is none.
std::optional<PresetErrors> read_field_model(TableReader& table, bool (*has)(const PresetErrors&), double rate_hz);

// Reads jitter and delay of an imu's sampling and errors of its stamps. Requires that the grid of the imu is set
// (environment_config.cpp).
void read_instants(TableReader& table, ImuConfig& imu);
// Reads [imu.clock].
OscillatorModel read_oscillator(TableReader table);

// Returns whether `port` is the record of a run whose resolved configuration lacks this text. A default that did
// not exist when the run was recorded does not apply now, so that the run is repeated without a change
// (fit_config.cpp).
bool was_recorded_without(const std::string& port, std::string_view text);

// Reads the [[imu]] of that index. Requires that [truth] and [earth] have been read (imu_config.cpp).
ImuConfig read_imu(TableReader& table, std::size_t index, const TruthConfig& truth);
// Adds a fault for each two imus that exclude one another, such as imus of the same name or port, and for each imu
// that sends to the truth's port (imus_together.cpp).
void check_imus_together(const std::vector<ImuConfig>& imus, const std::string& truth_port, const toml::array& tables,
                         Faults& faults);
// Lets each imu collect its frames that has its bus for itself: the frames of several leave in the order of time.
void set_collecting(std::vector<ImuConfig>& imus);
// Reads the keys of the fit of poses. Requires that truth.format and truth.port are set.
void read_fit(TableReader& table, ClockMode clock, TruthConfig& truth);
// Describes the fit, with delay and bandwidth; empty if nothing is derived.
std::string fit_text(const TruthConfig& truth);

// Reads truth.max_*; set_bounds() sets absent bounds to the widest ranges of the imus (earth_config.cpp).
void read_bounds(TableReader& table, TruthBounds& bounds);
void set_bounds(const std::vector<ImuConfig>& imus, TruthBounds& bounds);

// Reads [earth], which must not contradict the truth's own frame (earth_config.cpp).
EarthModel read_earth(TableReader table, TruthConfig& truth);
// Describes the relation of N to the Earth.
std::string earth_text(const TruthConfig& truth);

}  // namespace imud
