// Presets: the errors of sensors by their data sheets, for the key `model`. Each is a TOML file in presets/, which
// CMake builds in.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/effects/triad_errors.hpp"
#include "core/environment/barometer.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// Whether white noise is stated by a density, and whether this density also covers negative frequencies.
enum class Sidedness : std::uint8_t { none, two_sided, one_sided };

// A file: a line with the sensor's name, a line with the source, then, where a bandwidth is known, [imu] with the
// internal rate and the decimation, then [imu.gyro] and [imu.accelerometer] as in a configuration, or
// [imu.magnetometer], or [imu.barometer], or several of these; [imu.inclinometer] beside the gyros. The comment
// "unconfirmed: from memory", "secondary source" or "assumed" after a value marks a value that is not from a document
// of the manufacturer. Files of users have the same form, but need not have the first two lines.
struct Preset {
  std::string_view name;
  std::string_view text;

  std::string_view summary() const noexcept;
  std::string_view source() const noexcept;
  // A value and where it is from: "document" of the manufacturer, "secondary source", "memory" or "assumed"; in a
  // file of a user "not marked". The note is the rest of the value's comment.
  struct Figure {
    std::string key, value;  // with "gyro." or "accelerometer." before the key
    std::string_view confidence;
    std::string note;
    bool is_confirmed() const noexcept { return confidence == "document" || confidence == "not marked"; }
  };
  std::vector<Figure> figures() const;
};

// Return the presets of imus, and the presets of magnetometers and barometers, sorted by name.
std::span<const Preset> presets() noexcept;
std::span<const Preset> field_presets() noexcept;
// Returns the preset, or a user's file as a preset if the path ends with .toml. The file is read once, and kept to
// the end of the program. Returns nullptr if there is no such preset or file. One thread at a time.
const Preset* find_preset(std::string_view name);

// Returns the `model` of an imu with this protocol and these settings whose configuration names none: the product's
// preset, or "white".
std::string_view default_model(const Protocol& protocol, const Settings& settings);

// Returns the `rate_hz` of an imu with this protocol and these settings, Hz: the fixed rate of a product, or the
// rate that a description of frames gives; 0: the configuration must give the rate.
double default_rate_hz(const Protocol& protocol, const Settings& settings);

// How a product makes samples at a rate below its internal rate: each is the value of one internal sample, or the
// mean of all of them, which has as many more digits as it has summands.
enum class Decimation : std::uint8_t { sample, mean };

struct PresetErrors {
  double internal_rate_hz = 0;  // 0: the sample rate
  Decimation decimation = Decimation::sample;
  bool is_imu = true;  // the sensor has gyros and accelerometers
  TriadErrors gyro, accelerometer;
  Sidedness gyro_density = Sidedness::none, accelerometer_density = Sidedness::none;
  std::optional<TriadErrors> magnetometer;
  Sidedness magnetometer_density = Sidedness::none;
  std::optional<TriadErrors> inclinometer;
  Sidedness inclinometer_density = Sidedness::none;
  std::optional<BarometerErrors> barometer;

  // Returns whether the bandwidth is within half of this sample rate, Hz. The bandwidth of sensors without a filter
  // is half of the internal rate. Decimation to a lower rate aliases noise: then the samples do not have the density
  // of the data sheet, which a user of the preset expects by default.
  bool is_within(double rate_hz) const;
  // Removes the filters of gyros, accelerometers and inclinometers. The remaining noise and digits are correct for a
  // sensor whose samples at this rate, Hz, do not alias.
  void decimate(double rate_hz);
};
// Returns the errors at this sample rate, Hz, or the preset's internal rate if higher. Throws ConfigError if the
// errors are not possible at the rate, or if a user's file is not valid.
PresetErrors preset_errors(const Preset& preset, double rate_hz);

}  // namespace imud
