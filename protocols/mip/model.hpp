// The models of MicroStrain devices that imud emulates, and what distinguishes them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace imud::mip {

// Descriptor sets of data. gnss: the only receiver of a 5-series device; gnss_1, gnss_2: receivers of a 7-series
// device.
enum DataSet : std::uint8_t { sensor = 0x80, gnss, filter, gnss_1 = 0x91, gnss_2, system = 0xA0 };

// Sets of models.
inline constexpr unsigned gx5_25 = 1, cv7_ahrs = 2, gx5_45 = 4, cv7_ins = 8, gq7 = 16;
inline constexpr unsigned gx5 = gx5_25 | gx5_45, cv7 = cv7_ahrs | cv7_ins, series_7 = cv7 | gq7;
inline constexpr unsigned with_receiver = gx5_45 | gq7, ins = with_receiver | cv7_ins, all = gx5 | series_7;

struct Model {
  unsigned bit = 0;
  std::string_view keyword = {}, name = {}, number = {}, serial = {}, options = {};
  std::array<std::uint8_t, 2> receivers = {};      // their descriptor sets; 0: none
  std::uint16_t filter_hz = 0, gnss_hz = 0;        // Hz, base rates; 0: no receiver
  std::uint16_t filter_stream_hz = 10;             // Hz, of the stream as delivered
  double gyro_max = 0, accelerometer_max_g = 8;    // rad/s
  std::string_view preset = {};                    // the default model of errors
  double gyro_noise = 0, accelerometer_noise = 0;  // rad/s/sqrt(Hz), m/s^2/sqrt(Hz)
  std::span<const std::string_view> sensor_fields = {}, filter_fields = {}, gnss_fields = {};  // as delivered

  bool is(unsigned set) const noexcept { return (bit & set) != 0; }
};
extern const std::array<Model, 5> models;

}  // namespace imud::mip
