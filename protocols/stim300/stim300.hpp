// The configuration and memory of the STIM300, shared by the device (device.cpp), its datagrams (datagram.hpp:
// measurement.cpp and special.cpp write, decoder.cpp reads), its Utility Mode (utility.cpp) and its Service Mode
// (service.hpp). Sensonor STIM300 Datasheet TS1524 rev. 31 (February 2024), whose tables, sections and equations are
// named here.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>

#include "core/frame.hpp"
#include "core/numbers/lanes.hpp"
#include "core/numbers/number_text.hpp"
#include "core/time.hpp"
#include "core/uart.hpp"
#include "core/vector.hpp"

namespace imud::stim300 {

// The clusters of three axes, in the order of the datagram.
enum Cluster : std::size_t { gyro, accelerometer, inclinometer };
inline constexpr std::array<Cluster, 3> clusters = {gyro, accelerometer, inclinometer};

// Output units, with the datasheet's numbers: of the gyros in deg and s, of the other clusters in g, s and m/s.
enum Unit : unsigned { value, increment, average, integrated, integrated_m_per_s };
inline constexpr unsigned delayed = 8;  // is added to a unit of the gyros

inline constexpr double internal_hz = 2000;
inline constexpr std::array<unsigned, 5> sample_rates = {125, 250, 500, 1000, 2000};
inline constexpr std::array<unsigned, 4> bit_rates = {374400, 460800, 921600, 1843200};
inline constexpr std::array<unsigned, 5> filters_hz = {16, 33, 66, 131, 262};
// The -3 dB frequencies of the inclinometers at these settings. Their own response, of first order, ends at 17 Hz
// (Table 5-8); with 16 Hz it is 12.5 Hz for both together, read off figure 5-20.
inline constexpr std::array<double, 5> inclinometer_filters_hz = {12.5, 17, 17, 17, 17};
inline constexpr unsigned external_trigger = 5, user_defined = 15;

// Returns the bit rate of the unit's UART that is nearest to `wanted` (Equation 13). `wanted`: bit/s, 1500 to
// 5184000.
constexpr unsigned nearest_bit_rate(unsigned wanted) noexcept {
  constexpr unsigned clock = 82'944'000;
  const unsigned n = clock / wanted;
  const unsigned above = (clock + n / 2) / n, below = (clock + n / 2) / (n + 1);
  return above - wanted < wanted - below ? above : below;
}

// The g-compensation of one gyro axis (section 7.5.2.2.6). Sources of the acceleration: 0: none, 1: accelerometers,
// 2: inclinometers.
struct GCompensation {
  unsigned bias_source = 0;
  bool bias_filter = false;
  unsigned scale_source = 0;
  bool scale_filter = false;
  bool operator==(const GCompensation&) const = default;
};
// Table 9-22.
inline constexpr std::array<GCompensation, 13> standard_g_compensations = {{{0, false, 0, false},
                                                                            {0, false, 1, false},
                                                                            {0, false, 1, true},
                                                                            {1, false, 0, false},
                                                                            {1, true, 0, false},
                                                                            {2, false, 0, false},
                                                                            {2, true, 0, false},
                                                                            {1, false, 1, false},
                                                                            {1, true, 1, false},
                                                                            {2, false, 1, false},
                                                                            {2, true, 1, false},
                                                                            {1, true, 1, true},
                                                                            {2, true, 2, true}}};

// The configuration of a unit, in the codes of Table 5-16.
struct Configuration {
  unsigned sample_rate = 3;  // index in sample_rates, or external_trigger
  unsigned content =
      7;  // of the datagram beside the gyros; bit 0: acceleration, 1: inclination, 2: temperature, 3: PPS or AUX
  bool has_aux = false;  // an older unit: an AUX input in PPS's place, in the datagram and on the connector
  bool cr_lf = false;
  unsigned bit_rate = 2;       // index in bit_rates, or user_defined
  unsigned user_bit_rate = 0;  // bit/s, if user_defined
  Parity parity = Parity::none;
  unsigned stop_bits = 1;
  bool line_termination = true;
  std::array<unsigned, 3> units = {value, value, value};  // index: Cluster
  unsigned pps_unit = 3;
  // Index in filters_hz of each axis; index: Cluster.
  std::array<std::array<unsigned, 3>, 3> filters = {{{4, 4, 4}, {4, 4, 4}, {4, 4, 4}}};
  unsigned pps_filter = 4;
  std::array<GCompensation, 3> g_compensation = {};  // index: axis
  double g_filter_hz = 0.01;
  unsigned accelerometer_range = 0;  // 0: 10 g, 3: 5 g, 4: 30 g, 6: 80 g
  bool tov_3v3 = false, tov_toggles = false, bias_trim_at_start = false;

  bool has(Cluster cluster) const noexcept { return cluster == gyro || (content >> (cluster - 1) & 1U) != 0; }
  bool has_temperature() const noexcept { return (content & 4U) != 0; }
  bool pps_is_time() const noexcept { return pps_unit >= 2; }
  bool has_pps() const noexcept { return (content & 8U) != 0; }
  UartSettings line() const noexcept {
    return {bit_rate == user_defined ? user_bit_rate : bit_rates[bit_rate], parity, stop_bits};
  }
  void set_bit_rate(unsigned wanted) noexcept {  // 1500 to 5184000 bit/s
    const auto known = std::find(bit_rates.begin(), bit_rates.end(), wanted);
    bit_rate = known == bit_rates.end() ? user_defined : static_cast<unsigned>(known - bit_rates.begin());
    user_bit_rate = bit_rate == user_defined ? nearest_bit_rate(wanted) : 0;
  }
  void set_line(const Configuration& from) noexcept {
    bit_rate = from.bit_rate;
    user_bit_rate = from.user_bit_rate;
    parity = from.parity;
    stop_bits = from.stop_bits;
  }
  bool operator==(const Configuration&) const = default;
};
inline constexpr unsigned least_bit_rate = 1500, greatest_bit_rate = 5'184'000;

struct AccelerometerRange {
  unsigned code, g;
  double overload_g;             // Tables 5-4 to 5-7, note 1
  double lsb_g;                  // of acceleration, 24 bits
  std::string_view part_number;  // section 12
};
inline constexpr std::array<AccelerometerRange, 4> accelerometer_ranges = {
    {{0, 10, 11, 0x1p-19, "84167-4400003-321"},
     {3, 5, 5.5, 0x1p-20, "84458-4400003-321"},
     {4, 30, 33, 0x1p-18, "84461-4400003-321"},
     {6, 80, 96, 0x1p-16, "84615-4400003-321"}}};
constexpr const AccelerometerRange& range_of(const Configuration& c) noexcept {
  for (const AccelerometerRange& range : accelerometer_ranges)
    if (range.code == c.accelerometer_range) return range;
  return accelerometer_ranges[0];
}
inline constexpr double inclinometer_overload_g = 1.87,
                        inclinometer_end_g = 2;  // Table 5-8, note 1; 24 bits of 2^-22 g

// Returns the LSB of a cluster's output (Equations 1 to 6), in deg/s or deg; g, g s or m/s.
constexpr double lsb(const Configuration& c, Cluster cluster, unsigned unit) noexcept {
  const bool plain = unit % delayed == value || unit % delayed == average;
  if (cluster == gyro) return plain ? 0x1p-14 : 0x1p-21;
  return (cluster == accelerometer ? range_of(c).lsb_g : 0x1p-22) / (plain ? 1 : 8);
}

// Returns the size of a Normal Mode datagram in bytes, without CR LF.
constexpr std::size_t datagram_size(unsigned content) noexcept {
  const std::size_t clusters_in_it = 1 + (content & 1U) + (content >> 1 & 1U);
  return 1 + 10 * clusters_in_it + ((content & 4U) != 0 ? 7 * clusters_in_it : 0) + ((content & 8U) != 0 ? 4 : 0) +
         3 + 4;
}
static_assert(datagram_size(0b0111) == 59 && datagram_size(0b1111) == 63);

// Returns the shortest period of datagrams with so many characters (Equation 12, from which Table 5-12 follows).
constexpr Nanoseconds least_period(const UartSettings& line, std::size_t characters) noexcept {
  const auto tenths = static_cast<std::int64_t>(11 * characters * line.bits_per_character());
  return Nanoseconds((tenths * 100'000'000 + line.baud - 1) / line.baud);
}

// Returns true if the line can carry the datagrams at their rate.
constexpr bool can_transmit(const Configuration& c) noexcept {
  if (c.sample_rate == external_trigger) return true;
  const std::size_t characters = datagram_size(c.content) + (c.cr_lf ? 2 : 0);
  return least_period(c.line(), characters) <= Nanoseconds(1'000'000'000 / sample_rates[c.sample_rate]);
}

// Table 5-23.
namespace status_bit {
inline constexpr unsigned integrity = 0x80, start_up = 0x40, outside = 0x20, overload = 0x10, channel = 0x08;
}

// The samples of a cluster since the last transmission, in deg or g, and s.
struct Axes {
  Vector3 now = Vector3::Zero();
  LaneVector sum, integral;
  std::uint64_t samples = 0;
  unsigned status = 0, status_now = 0;
  [[gnu::always_inline]] void add(Lanes value, Lanes step, unsigned bits) noexcept {
    now = vector_of(value);
    sum.add(step);
    integral.add(step);
    ++samples;
    status_now = bits;
    status |= bits;
  }
  void begin() noexcept {  // restarts the sums; `integral` runs on
    sum = {};
    samples = 0;
    status = 0;
  }
};

// The fields of a measurement that the clusters share.
struct Reading {
  double temperature_c;
  unsigned status;  // status bits common to all clusters
  std::uint32_t pps;
  unsigned pps_status;
  unsigned counter, latency_us;
};
inline constexpr std::uint32_t longest_pps = 0x7FFFFF;  // us; also stands for any longer time

// The settings and errors of a unit.
struct Memory {
  Configuration active, stored;  // stored: in flash, loaded at reset
  Configuration factory;
  std::array<Vector3, 3> trim = {Vector3::Zero(), Vector3::Zero(), Vector3::Zero()};  // bias offsets: deg/s, g, g
  std::array<Vector3, 3> stored_trim = trim;
  std::uint32_t trim_reference = 0, stored_trim_reference = 0;
  static constexpr std::uint16_t saves = 10'000;
  std::uint16_t saves_left = saves;
  std::array<std::uint8_t, 16> errors = {};  // accumulated, bytes 1 to 16 of Table 5-18

  // Records an overload as an error, and returns its status bits.
  unsigned overload(Cluster cluster, unsigned axis) noexcept {
    set_error(101 + 3 * static_cast<unsigned>(cluster) + axis);  // Table 5-19: in the order of the datagram
    return status_bit::overload | 1U << axis;
  }
  void set_error(unsigned bit) noexcept { errors[15 - bit / 8] |= static_cast<std::uint8_t>(1U << bit % 8); }
  bool has_error(unsigned bit) const noexcept { return (errors[15 - bit / 8] >> bit % 8 & 1U) != 0; }
  // Sets a bias trim offset, clamped to its limit (Tables 5-3 to 5-8). Returns false if it was clamped.
  bool set_trim(Cluster cluster, unsigned axis, double wanted) noexcept {
    const unsigned range = range_of(active).g;
    const double limit = cluster == gyro ? 1 : cluster == inclinometer ? 0.02 : range == 5 ? 0.1 : range / 100.0;
    return (trim[cluster][axis] = std::clamp(wanted, -limit, limit)) == wanted;
  }
  bool is_saved() const noexcept {
    return active == stored && trim == stored_trim && trim_reference == stored_trim_reference;
  }
  // Saves in flash. Returns false if the number of saves that flash is specified for was already used up.
  bool save() noexcept {
    stored = active;
    stored_trim = trim;
    stored_trim_reference = trim_reference;
    if (saves_left == 0) return false;
    --saves_left;
    return true;
  }
  void load() noexcept {
    active = stored;
    trim = stored_trim;
    trim_reference = stored_trim_reference;
  }
};

inline constexpr std::string_view product_name = "STIM300", firmware = "SWD12404 REV 0", hardware = "M5728 REV 11";
inline constexpr char part_revision = 'K';
inline constexpr unsigned firmware_revision = 0;
inline constexpr std::string_view serial_number = "N25582405002002";

// Returns the index of a one-letter parameter in `letters`; nullopt if the parameter is no letter of this list.
inline std::optional<unsigned> index(std::string_view parameter, std::string_view letters) noexcept {
  const std::size_t at = letters.find(parameter);
  if (parameter.size() != 1 || parameter == " " || at == letters.npos) return std::nullopt;
  return static_cast<unsigned>(at);
}

// Utility Mode. greet() appends the answer to the command that enters this mode. execute() executes one line of the
// host, given without its end, and appends the answer. It returns false if the line exits Utility Mode.
void greet(FrameBuffer& replies) noexcept;
bool execute(Memory& memory, std::string_view line, FrameBuffer& replies) noexcept;
unsigned crc8(std::string_view text) noexcept;  // of a command up to and including its last comma (section 10.2)

}  // namespace imud::stim300
