// Streams of products that are C++, the same streams by description, and a motion to encode.
#pragma once

#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "core/units.hpp"
#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {

struct FrameLikeDevice {
  std::string_view product;
  std::string_view settings;  // of the product: it sends nothing but the described message
  double rate_hz;
  std::string description;
};

inline std::vector<FrameLikeDevice> frame_like_devices() {
  return {
      {"stim300", "start_up=false sample_rate=2000 inclination=false temperature=false", 2000,
       one_message("@a\n91\n"
                   "rate_x_deg_per_s:i24*2^-14\nrate_y_deg_per_s:i24*2^-14\nrate_z_deg_per_s:i24*2^-14\n"
                   "00\n"
                   "specific_force_x_g:i24*2^-19\nspecific_force_y_g:i24*2^-19\n"
                   "specific_force_z_g:i24*2^-19\n"
                   "00\nsample_counter:u8\n01 FA\n"
                   "check:crc32/mpeg-2:@a..",
                   "byte_order = \"big\"")},
      {"vectornav", "baud=921600 async_hz=0 binary_1=1,1,01,0121", 800,
       one_message("FA\n@a\n01 21 01\ntime_ns:u64\n"
                   "rate_x_rad_per_s:f32\nrate_y_rad_per_s:f32\nrate_z_rad_per_s:f32\n"
                   "specific_force_x_m_per_s2:f32\nspecific_force_y_m_per_s2:f32\n"
                   "specific_force_z_m_per_s2:f32\n"
                   "check:crc16/xmodem:@a.. be")},
      {"mip", "baud=921600 sensor_rate_hz=1000 sensor_fields=acceleration,rate,delta_angle,delta_velocity", 1000,
       one_message("@a\n75 65 80\nlength:u8:@d..@e\n@d\n"
                   "0E 04\nspecific_force_x_g:f32\nspecific_force_y_g:f32\nspecific_force_z_g:f32\n"
                   "0E 05\nrate_x_rad_per_s:f32\nrate_y_rad_per_s:f32\nrate_z_rad_per_s:f32\n"
                   "0E 07\ndelta_angle_x_rad:f32\ndelta_angle_y_rad:f32\ndelta_angle_z_rad:f32\n"
                   "0E 08\ndelta_velocity_x_m_per_s:f32*9.80665\n"
                   "delta_velocity_y_m_per_s:f32*9.80665\ndelta_velocity_z_m_per_s:f32*9.80665\n"
                   "@e\ncheck:fletcher8:@a..",
                   "byte_order = \"big\"")},
  };
}

// A motion at this rate, in the ranges of the products.
class FrameMotion {
 public:
  explicit FrameMotion(double rate_hz) : step_(nanoseconds(1 / rate_hz)) {}

  Sample next() {
    std::normal_distribution<double> normal;
    const auto vector = [&](double size) -> Vector3 {
      return Vector3(normal(random_), normal(random_), normal(random_)) * size;
    };
    sample_.rate = vector(1.5);
    sample_.specific_force = vector(25);
    const double step_s = seconds(step_);
    sample_.delta_angle = sample_.rate * step_s;
    sample_.delta_velocity = sample_.specific_force * step_s;
    sample_.temperature_c = 25 + normal(random_);
    const Sample now = sample_;
    ++sample_.counter;
    sample_.time = sample_.time + step_;
    return now;
  }

 private:
  std::mt19937_64 random_{3};
  Nanoseconds step_;
  Sample sample_;
};

}  // namespace imud
