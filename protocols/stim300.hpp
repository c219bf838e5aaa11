// What the STIM300 keeps, shared by its datagrams (devices/stim300.cpp) and its Utility Mode (stim300_utility.cpp).
// Sensonor STIM300 Datasheet TS1524 rev. 31 (February 2024), whose tables, sections and equations are named here.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/frame.hpp"
#include "core/line.hpp"
#include "core/vector.hpp"

namespace imud::stim300 {

// The clusters of three axes, in the order of the datagram.
enum Cluster : std::size_t { gyro, accelerometer, inclinometer };
inline constexpr std::array<Cluster, 3> clusters = {gyro, accelerometer, inclinometer};

// Units of output, by the datasheet's numbers; gyro: in deg, s; the others: g, s, m/s.
enum Unit : unsigned { value, increment, average, integrated, integrated_m_per_s };
inline constexpr unsigned delayed = 8;  // is added; gyro only

inline constexpr std::array<unsigned, 5> sample_rates = {125, 250, 500, 1000, 2000};
inline constexpr std::array<unsigned, 4> bit_rates = {374400, 460800, 921600, 1843200};
inline constexpr unsigned external_trigger = 5;

// Table 5-16, by its numbers.
struct Configuration {
  unsigned sample_rate = 3;  // of sample_rates, or external_trigger
  unsigned content = 7;      // beside the rate; bit 0: acceleration, 1: inclination, 2: temperature, 3: PPS or AUX
  bool has_aux = false;      // an older unit: an AUX input in PPS's place, in the datagram and on the connector
  bool cr_lf = false;
  unsigned bit_rate = 2;  // of bit_rates
  Parity parity = Parity::none;
  unsigned stop_bits = 1;
  bool line_termination = true;
  std::array<unsigned, 3> units = {value, value, value};  // of the clusters
  unsigned pps_unit = 3;
  std::array<std::array<unsigned, 3>, 3> filters = {{{4, 4, 4}, {4, 4, 4}, {4, 4, 4}}};  // 4: 262 Hz
  unsigned pps_filter = 4;
  unsigned accelerometer_range = 0;  // 0: 10 g, 3: 5 g, 4: 30 g, 6: 80 g
  bool tov_3v3 = false, tov_toggles = false, bias_trim_at_start = false;

  bool has(Cluster cluster) const noexcept { return cluster == gyro || (content >> (cluster - 1) & 1U) != 0; }
  bool has_temperature() const noexcept { return (content & 4U) != 0; }
  bool has_pps() const noexcept { return (content & 8U) != 0; }
  LineSettings line() const noexcept { return {bit_rates[bit_rate], parity, stop_bits}; }
};

inline constexpr std::array<std::pair<unsigned, unsigned>, 4> accelerometer_ranges_g = {{{0, 10}, {3, 5}, {4, 30}, {6, 80}}};
constexpr unsigned range_g(unsigned code) noexcept {
  for (const auto& [known, g] : accelerometer_ranges_g)
    if (known == code) return g;
  return 10;
}

// One bit of a cluster's output in its unit (Equations 1 to 6): deg/s or deg; g, g s or m/s.
constexpr double lsb(const Configuration& c, Cluster cluster, unsigned unit) noexcept {
  const bool plain = unit % delayed == value || unit % delayed == average;
  const double acceleration = c.accelerometer_range == 3   ? 0x1p-20
                              : c.accelerometer_range == 4 ? 0x1p-18
                              : c.accelerometer_range == 6 ? 0x1p-16
                                                           : 0x1p-19;
  if (cluster == gyro) return plain ? 0x1p-14 : 0x1p-21;
  return (cluster == accelerometer ? acceleration : 0x1p-22) / (plain ? 1 : 8);
}

// All that a unit keeps beside its measurements.
struct Memory {
  Configuration active, stored;  // stored: in flash, taken at reset
  std::array<Vector3, 3> trim = {Vector3::Zero(), Vector3::Zero(), Vector3::Zero()};  // bias offsets: deg/s, g, g
  std::array<Vector3, 3> stored_trim = trim;
  std::uint32_t trim_reference = 0, stored_trim_reference = 0;
  std::uint16_t saves_left = 10'000;
  std::array<std::uint8_t, 16> errors = {};  // accumulated, bytes 1 to 16 of Table 5-18

  void set_error(unsigned bit) noexcept { errors[15 - bit / 8] |= static_cast<std::uint8_t>(1U << bit % 8); }
  void save() noexcept {
    stored = active;
    stored_trim = trim;
    stored_trim_reference = trim_reference;
    if (saves_left > 0) --saves_left;
  }
  void load() noexcept {
    active = stored;
    trim = stored_trim;
    trim_reference = stored_trim_reference;
  }
};

inline constexpr std::string_view part_number = "84167-4400003-321";
inline constexpr char part_revision = 'K';
inline constexpr unsigned firmware_revision = 0;
inline constexpr std::string_view serial_number = "N25582405002002";

// Utility Mode: the word that one comes in by, and a line of the host, without its end. Append the answer. False if
// Utility Mode is left.
void greet(FrameBuffer& replies) noexcept;
bool obey(Memory& memory, std::string_view line, FrameBuffer& replies) noexcept;

}  // namespace imud::stim300
