// The messages of DroneCAN that imud sends and receives, by their DSDL definitions (github.com/dronecan/DSDL, folder
// uavcan). All are little-endian. Arrays of covariances at the end of a message are empty, and have no length field.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/dronecan/transfer.hpp"
#include "protocols/wire/wire.hpp"

namespace imud::dronecan {

using namespace boost::endian;
using Half = little_uint16_buf_t;  // the bits of a float16

inline constexpr DataType node_status{341, false, 0x0F0868D0C1A7C6F1, "uavcan.protocol.NodeStatus"};
inline constexpr DataType global_time_sync{4, false, 0x20271116A793C2DB, "uavcan.protocol.GlobalTimeSync"};
inline constexpr DataType allocation{1, false, 0x0B2A812620A11D40, "uavcan.protocol.dynamic_node_id.Allocation"};
inline constexpr DataType solution{1000, false, 0x72A63A3C6F41FA9B, "uavcan.equipment.ahrs.Solution"};
inline constexpr DataType magnetic_field{1002, false, 0xB6AC0C442430297E,
                                         "uavcan.equipment.ahrs.MagneticFieldStrength2"};
inline constexpr DataType raw_imu{1003, false, 0x8280632C40E574B5, "uavcan.equipment.ahrs.RawIMU"};
inline constexpr DataType static_pressure{1028, false, 0xCDC7C43412BDC89A,
                                          "uavcan.equipment.air_data.StaticPressure"};
inline constexpr DataType static_temperature{1029, false, 0x49272A6477D96271,
                                             "uavcan.equipment.air_data.StaticTemperature"};
inline constexpr DataType gnss_auxiliary{1061, false, 0x9BE8BDC4C3DBBFD2, "uavcan.equipment.gnss.Auxiliary"};
inline constexpr DataType gnss_fix2{1063, false, 0xCA41E7000F37435F, "uavcan.equipment.gnss.Fix2"};

// Returns the nearest float16, ties to even; saturates at +-65504. Rounding first to a float and then to a float16
// could give another result. Therefore one sticky bit first replaces the lowest 29 bits of the double, so that the
// conversion to a float is exact.
inline Half to_half(double value) noexcept {
  constexpr double largest = 65504;
  constexpr std::uint64_t sticky = std::uint64_t{1} << 29;
  auto bits = std::bit_cast<std::uint64_t>(std::clamp(value, -largest, largest));
  if ((bits & (sticky - 1)) != 0) bits = (bits & ~(sticky - 1)) | sticky;
  const auto half = Eigen::half(static_cast<float>(std::bit_cast<double>(bits)));
  return Half(Eigen::numext::bit_cast<Eigen::numext::uint16_t>(half));
}
inline double from_half(const Half& bits) noexcept {
  return double{static_cast<float>(Eigen::numext::bit_cast<Eigen::half>(bits.value()))};
}
inline void put_halves(const Vector3& vector, Half (&wire)[3]) noexcept {
  for (int i = 0; i < 3; ++i) wire[i] = to_half(vector[i]);
}
inline Vector3 get_halves(const Half (&wire)[3]) noexcept {
  return {from_half(wire[0]), from_half(wire[1]), from_half(wire[2])};
}

enum Health : unsigned { health_ok, health_warning, health_error };
enum Mode : unsigned { operational, initialization };

struct NodeStatusWire {
  little_uint32_buf_t uptime_s;
  std::uint8_t state;  // health, 2 bits; mode, 3 bits; sub-mode, 3 bits: 0
  little_uint16_buf_t vendor_code;
};
static_assert(sizeof(NodeStatusWire) == 7);

struct RawImuWire {
  little_uint56_buf_t time_us;                // of the bus; 0: not known
  little_float32_buf_t integration_interval;  // s; not positive: there are no integrals
  Half rate[3];                               // rad/s
  little_float32_buf_t delta_angle[3];        // rad, over the interval
  Half specific_force[3];                     // m/s^2
  little_float32_buf_t delta_velocity[3];     // m/s, over the interval
};
static_assert(sizeof(RawImuWire) == 47);
inline constexpr std::size_t most_covariances = 36;  // of RawIMU

// The definition's linear acceleration is sent as specific force, as in RawIMU. The definition does not state the
// direction of the rotation; here v_L = q * v_P.
struct SolutionWire {
  little_uint56_buf_t time_us;
  Half orientation[4];       // x, y, z, w
  std::uint8_t covariances;  // 4 bits of padding, 4 bits of length: 0
  Half rate[3];
  std::uint8_t rate_covariances;
  Half specific_force[3];
};
static_assert(sizeof(SolutionWire) == 29);

struct MagneticFieldWire {
  std::uint8_t sensor_id;
  Half field[3];  // Gauss
};
static_assert(sizeof(MagneticFieldWire) == 7);

struct StaticPressureWire {
  little_float32_buf_t pressure;  // Pa
  Half variance;                  // 0
};
static_assert(sizeof(StaticPressureWire) == 6);

struct StaticTemperatureWire {
  Half temperature;  // K
  Half variance;     // 0
};
static_assert(sizeof(StaticTemperatureWire) == 4);

// Writes numbers of any length in bits one after another, as DSDL serialises them: first the lowest byte of a number,
// last its highest byte, which may be incomplete; each byte from its highest bit on.
template <std::size_t size>
class PackedPayload {
 public:
  // Writes the lowest `bits` of `value`, at most 64.
  void put(std::uint64_t value, unsigned bits) noexcept {
    for (; bits > 0; value >>= 8U) {
      const unsigned count = std::min(bits, 8U);
      for (unsigned i = count; i-- > 0; ++end_)
        bytes_[end_ / 8] |= static_cast<std::byte>((value >> i & 1U) << (7 - end_ % 8));
      bits -= count;
    }
  }
  // Writes the nearest signed integer of so many bits. A value outside the range saturates.
  void put_rounded(double value, unsigned bits) noexcept {
    const double limit = static_cast<double>(std::int64_t{1} << (bits - 1));
    put(static_cast<std::uint64_t>(std::llround(std::clamp(value, -limit, limit - 1))), bits);
  }
  void put_half(double value) noexcept { put(to_half(value).value(), 16); }
  void put_float(double value) noexcept { put(std::bit_cast<std::uint32_t>(to_float(value)), 32); }
  // Returns the payload, which is complete when `size` bytes have been written.
  std::span<const std::byte> bytes() const noexcept { return bytes_; }

 private:
  std::array<std::byte, size> bytes_{};
  std::size_t end_ = 0;  // bits written
};

// Fix2 with the 6 variances of position and velocity along north, east, down, and without a position in E.
inline constexpr std::size_t gnss_fix2_size = 62;
inline constexpr std::size_t gnss_auxiliary_size = 16;
enum GnssTimeStandard : std::uint8_t { no_gnss_time, utc_gnss_time = 2 };
enum FixStatus : std::uint8_t { no_fix, fix_3d = 3 };

// The time of the bus at which the master sent its previous message of this type; 0 in its first message.
struct GlobalTimeSyncWire {
  little_uint56_buf_t previous_us;
};
static_assert(sizeof(GlobalTimeSyncWire) == 7);

// The payload of a transfer while it is written. A part that does not fit is left out.
class Payload {
 public:
  template <WireLayout T>
  void put(const T& wire) noexcept {
    if (sizeof(T) > bytes_.size() - size_) return;
    write_wire(wire, std::span(bytes_).subspan(size_));
    size_ += sizeof(T);
  }
  void put_byte(unsigned byte) noexcept { put(static_cast<std::uint8_t>(byte)); }
  void put_text(std::string_view text) noexcept {
    for (const char c : text) put(c);
  }
  std::span<const std::byte> bytes() const noexcept { return std::span(bytes_).first(size_); }

 private:
  std::array<std::byte, longest_transfer> bytes_;
  std::size_t size_ = 0;
};

}  // namespace imud::dronecan
