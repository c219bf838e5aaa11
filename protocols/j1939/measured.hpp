// The data messages of the sensor: layouts and scales, shared by the device and the decoder. All numbers are
// little-endian, unsigned with an offset.
//
// | message | number | bits of each number                 | LSB, offset        | figures of merit at           |
// |---------|--------|-------------------------------------|--------------------|-------------------------------|
// | SSI2    | 61481  | 24: pitch, roll                     | 1/32768 deg, -250  | 50, 54; latency 56            |
// | ARI     | 61482  | 16: pitch rate, roll rate, yaw rate | 1/128 deg/s, -250  | 48 to 53; mode 54; latency 56 |
// | ACCS    | 61485  | 16: lateral, longitudinal, vertical | 0.01 m/s^2, -320   | 48 to 53; rate 54; latency 56 |
// | SSI     | 61459  | 16: pitch, roll, pitch rate         | 0.002 deg(/s), -64 | 48 to 53; latency 56          |
// | ARI-HR  | 65387  | 19                                  | 1/1024 deg/s, -250 | 57 to 62                      |
// | ACCS-HR | 65389  | 19                                  | 1/800 m/s^2, -320  | 57 to 62                      |
// | mag     | 65386  | 16                                  | 0.25 mG, -8 G      | none                          |
// | VP      | 65267  | 32: latitude, longitude             | 1e-7 deg, -210     | none                          |
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "core/sample.hpp"
#include "core/units.hpp"
#include "protocols/j1939/message.hpp"

namespace imud::j1939 {

// A number on the wire: (value - offset) / lsb, in `bits` bits. `unit`: of lsb and offset, in SI.
struct Scale {
  double per_unit;  // 1 / LSB
  double offset;    // the value of raw 0, negative; its magnitude is also the largest value
  double unit;
  unsigned bits;

  constexpr double zero() const noexcept { return -offset * per_unit; }  // the raw number of 0; an integer
  constexpr double lsb() const noexcept { return unit / per_unit; }
  constexpr double max() const noexcept { return -offset * unit; }

  // Rounds to nearest, or down as the firmware of some models does; saturates at +-max().
  std::uint64_t raw(double value, bool rounds) const noexcept {
    const double limited = std::clamp(value / unit, offset, -offset);
    return static_cast<std::uint64_t>(limited * per_unit + zero() + (rounds ? 0.5 : 0.0));
  }
  constexpr double value(std::uint64_t raw) const noexcept {
    return (static_cast<double>(raw) - zero()) / per_unit * unit;
  }
  // Returns false for a number that SAE J1939-71 reserves for errors and for "not available". Numbers of 19 bits have
  // no reserved values.
  constexpr bool is_valid(std::uint64_t raw) const noexcept { return bits != 16 || raw <= 0xFAFF; }
};

inline constexpr Scale rate_scale{128, -250, units::degree, 16};
inline constexpr Scale fine_rate_scale{1024, -250, units::degree, 19};
inline constexpr Scale force_scale{100, -320, 1, 16};
inline constexpr Scale fine_force_scale{800, -320, 1, 19};
inline constexpr Scale angle_scale{32768, -250, units::degree, 24};
inline constexpr Scale coarse_angle_scale{500, -64, units::degree, 16};
inline constexpr Scale magnetic_scale{4000, -8, units::gauss, 16};
inline constexpr Scale position_scale{1e7, -210, units::degree, 32};

// The figure of merit of a number.
enum Merit : unsigned { merit_good, merit_degraded, merit_out_of_range, merit_not_available };

// One output of the sensor, in the axes and the order of the wire.
struct Reading {
  std::array<double, 3> rate = {};            // rad/s, in the order of the slots
  std::array<double, 3> force = {};           // m/s^2, same order
  std::array<double, 3> magnetic_field = {};  // T, x, y, z
  double pitch = 0, roll = 0, pitch_rate = 0;
  double latitude = 0, longitude = 0;
  std::array<Merit, 3> rate_merit = {}, force_merit = {};
  Merit angle_merit = merit_good, pitch_rate_merit = merit_good;
  std::uint8_t latency = 0;  // 0.5 ms
  unsigned mode = 0;         // of ARI
  bool rounds = true;
  bool has_force_latency = true;  // false: ACCS has 0 for the latency
};

// A message of the sensor, in the order of the masks of packet types.
enum Packet : unsigned { ssi2, ari, accs, ari_fine, accs_fine, ssi, magnetic, position, packets };

// Returns the eight bytes of a message.
std::uint64_t encoded(Packet packet, const Reading& reading) noexcept;

// Decodes the three numbers of ARI or ACCS, or of their forms of high resolution. Returns false if a number is not
// available.
bool decode(const Scale& scale, std::uint64_t word, std::array<double, 3>& values) noexcept;

}  // namespace imud::j1939
