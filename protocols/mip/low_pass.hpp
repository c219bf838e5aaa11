// The low-pass filters of the scaled quantities (mip_sdk e5a847d, commands_3dm.h, 0C:50 and 0C:54). Each has a single
// pole and, as delivered, "a -3dB cutoff frequency of half the reporting frequency".
#pragma once

#include <array>
#include <cstdint>

namespace imud::mip {

struct LowPass {
  std::uint8_t descriptor = 0;  // of the quantity, in the set of the sensor data
  bool is_enabled = true;
  bool is_manual = false;    // the cut-off is `frequency_hz`, not half of the rate
  double frequency_hz = 50;  // as set by the host; the initial value is a guess
};

// The filters of accelerometers, gyros, magnetometers and barometer. The barometer's filter can be set and read, but
// changes nothing.
using LowPasses = std::array<LowPass, 4>;
enum LowPassed : std::uint8_t { of_accelerometers, of_gyros, of_magnetometers, of_barometer };
inline constexpr LowPasses as_delivered = {{{0x04}, {0x05}, {0x06}, {0x17}}};

}  // namespace imud::mip
