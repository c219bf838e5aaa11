// Pins: the user GPIO of a MIP device of the 7 series, its pulse per second, and the events that an edge triggers;
// the pulse-per-second input of a 3DM-GX5-25. Source: mip_sdk e5a847d, commands_3dm.h; MicroStrain's manuals of the
// CV7 and of the GQ7, "PPS" and "User GPIO".
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocols/mip/mip.hpp"

namespace imud::mip {

// All pins of a kind are connected to one line. Every pin that timestamps edges receives the edges of [imu.sync]
// trigger_port; every pulse-per-second input receives the pulses of pps_port. Pulses leave by tov_port.
class Pins {
 public:
  Pins(Memory& memory, Fields& fields) noexcept : memory_(memory), fields_(fields) {}

  void restart() noexcept;
  void step_clock(Nanoseconds by) noexcept;
  // Report a rising edge, of a time in (last sample, next sample]. Edges from before power-on or reset are ignored.
  void trigger(DeviceTime at) noexcept;
  void pps(DeviceTime at) noexcept;
  // Executes the events since the last sample, and appends their messages. Finds the pulse of this sample. Call this
  // after Fields::set_sample().
  void sample(DeviceTime now, FrameBuffer& out) noexcept;
  std::optional<Device::Pulse> pulse() const noexcept { return pulse_; }

 private:
  void execute(std::uint8_t trigger, DeviceTime edge, DeviceTime now, FrameBuffer& out) noexcept;
  void drive(std::uint8_t pin, std::uint8_t mode, DeviceTime now) noexcept;
  void find_second(DeviceTime now) noexcept;

  Memory& memory_;
  Fields& fields_;
  std::array<DeviceTime, 16> edges_;  // since the last sample; later ones are lost
  std::size_t count_ = 0;
  std::optional<DeviceTime> passed_;    // an edge of the pulse-per-second input since the last sample
  std::optional<DeviceTime> last_;      // the last sample
  std::optional<Device::Pulse> pulse_;  // of the last sample
};

}  // namespace imud::mip
