// Shared by the tests of faults over whole runs: a unit on CAN that sends everything that a sensor measures as
// doubles, each in a message of its own.
#pragma once

#include <array>
#include <cstring>
#include <map>
#include <string>
#include <string_view>

#include "tests/emulator/sampled_run.hpp"

namespace imud {

inline constexpr std::array<std::string_view, 29> all_quantities = {"rate_x_rad_per_s",
                                                                    "rate_y_rad_per_s",
                                                                    "rate_z_rad_per_s",
                                                                    "specific_force_x_m_per_s2",
                                                                    "specific_force_y_m_per_s2",
                                                                    "specific_force_z_m_per_s2",
                                                                    "delta_angle_x_rad",
                                                                    "delta_angle_y_rad",
                                                                    "delta_angle_z_rad",
                                                                    "delta_velocity_x_m_per_s",
                                                                    "delta_velocity_y_m_per_s",
                                                                    "delta_velocity_z_m_per_s",
                                                                    "magnetic_field_x_t",
                                                                    "magnetic_field_y_t",
                                                                    "magnetic_field_z_t",
                                                                    "pressure_pa",
                                                                    "temperature_c",
                                                                    "latitude_rad",
                                                                    "longitude_rad",
                                                                    "height_m",
                                                                    "velocity_north_m_per_s",
                                                                    "velocity_east_m_per_s",
                                                                    "velocity_down_m_per_s",
                                                                    "gnss_satellites",
                                                                    "gnss_position_sigma_north_m",
                                                                    "gps_time_of_week_s",
                                                                    "time_s",
                                                                    "sample_counter",
                                                                    "status"};
inline constexpr std::size_t all_reals = 26;  // the first of them; the others are integers, the time in microseconds

inline std::string every_quantity_dbc() {
  std::string text, types;
  for (std::size_t i = 0; i < all_quantities.size(); ++i) {
    const std::string_view scale = all_quantities[i] == "time_s" ? "1e-6" : "1";
    text += fmt::format("BO_ {} M{}: 8 Imu\n SG_ Q{} : 0|{}@1{} ({},0) [0|0] \"\" Host\n", 256 + i, i, i,
                        i < all_reals ? 64 : 32, i < all_reals ? '-' : '+', scale);
    if (i < all_reals) types += fmt::format("SIG_VALTYPE_ {} Q{} : 2;\n", 256 + i, i);
  }
  return text + types;
}

class EveryQuantityTest : public SampledRunTest {
 protected:
  // A unit at 200 Hz with white noise.
  Unit every_quantity_unit(const std::string& name, const std::string& more = "") const {
    std::string signals;
    for (std::size_t i = 0; i < all_quantities.size(); ++i)
      signals += fmt::format("\"Q{}={}\",", i, all_quantities[i]);
    return {name,
            fmt::format("protocol = \"dbc\"\nport = \"can:{}?bitrate=1000000\"\nrate_hz = 200\nmodel = \"white\"\n"
                        "gyro.max_rad_per_s = 10\ngyro.angle_random_walk_rad_per_rt_s = 1e-3\n"
                        "accelerometer.max_m_per_s2 = 100\nmagnetometer.max_t = 1e-3\nbarometer.noise_pa = 3\n"
                        "{}device.dbc_file = \"{}\"\ndevice.signals = [{}]\n",
                        name, more, write("every_quantity.dbc", every_quantity_dbc()), signals),
            200};
  }
  // The numbers of a sample by their names.
  static std::map<std::string_view, double> quantities(const std::string& sent) {
    std::map<std::string_view, double> all;
    for (std::size_t i = 0; i < all_quantities.size(); ++i) {
      const std::string id = fmt::format("{:x}#", 256 + i);
      const std::size_t at = sent.find(id, i * (id.size() + 8));
      if (at == std::string::npos || at + id.size() + 8 > sent.size()) continue;
      std::uint32_t integer = 0;
      double value = 0;
      std::memcpy(&value, sent.data() + at + id.size(), sizeof value);
      std::memcpy(&integer, sent.data() + at + id.size(), sizeof integer);
      all[all_quantities[i]] = i < all_reals ? value : integer;
    }
    return all;
  }
};

}  // namespace imud
