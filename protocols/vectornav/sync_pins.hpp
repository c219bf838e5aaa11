// SyncPins: the SyncIn and SyncOut pins (registers 32 and 33), and the pulse per second of a GNSS receiver (register
// 55). Sources: VN-100 user manual UM001 2.22, pages 66 to 69 and 75; VN-200 user manual UM004, pages 38, 39 and 42.
//
// Register 32 selects the polarity of edges and of the pulse at SyncOut. The emulated signals have no polarity.
#pragma once

#include <cstdint>
#include <optional>

#include "core/sample.hpp"
#include "core/time.hpp"
#include "protocols/protocol.hpp"

namespace imud::vectornav {

// Register 32.
struct SyncControl {
  enum class In : std::uint8_t {
    none = 0,         // edges have no effect
    count = 3,        // events are counted
    imu_sample = 4,   // an event makes the IMU sample
    async_all = 5,    // an event makes every output send
    async_rate_0 = 6  // an event makes the outputs send whose rate is 0
  };
  enum class Out : std::uint8_t { none = 0, imu_start = 1, imu_ready = 2, nav_ready = 3, gnss_pulse = 6 };

  In in = In::count;
  Out out = Out::gnss_pulse;
  unsigned in_skip = 0, out_skip = 0;  // triggers that precede each event without effect
  Nanoseconds width{100'000'000};      // of the pulse at SyncOut

  static bool is_in_mode(unsigned mode) noexcept { return mode == 0 || (mode >= 3 && mode <= 6); }
  static bool is_out_mode(unsigned mode) noexcept { return mode <= 3 || mode == 6; }
};

// The origin of the pulse per second.
enum class PulseSource : std::uint8_t { none, receiver, pps_pin, sync_in };

// Counts that register 33, messages and fields report.
struct SyncStatus {
  std::uint32_t in_count = 0, out_count = 0;
  Nanoseconds since_in{0}, since_pulse{0};  // 0 before the first one
};

// Report all edges up to a sample in order of time, then call sample(). One thread.
class SyncPins {
 public:
  // Discards counts, times and pending events.
  void reset() noexcept { *this = SyncPins(); }
  void step_clock(Nanoseconds by) noexcept;

  // edge() reports an edge at SyncIn, pps_edge() an edge at the PPS pin.
  void edge(const SyncControl& control, PulseSource source, DeviceTime time) noexcept;
  void pps_edge(const SyncControl& control, PulseSource source, DeviceTime time) noexcept;
  // Ends the interval up to `sample`, and makes the pulse that the sample causes. Returns true if there was a SyncIn
  // event in the interval.
  bool sample(const SyncControl& control, PulseSource source, const Sample& sample) noexcept;

  // Writing a zero to a count of register 33 resets it.
  void reset_in_count() noexcept { in_count_ = 0; }
  void reset_out_count() noexcept { out_count_ = 0; }
  SyncStatus status(DeviceTime now) const noexcept;
  // Returns the pulse at SyncOut that began in the last interval.
  const std::optional<Device::Pulse>& pulse() const noexcept { return pulse_; }

 private:
  void trigger_out(const SyncControl& control, DeviceTime time) noexcept;
  void take_pulse(const SyncControl& control, DeviceTime time) noexcept;

  std::uint32_t in_count_ = 0, out_count_ = 0;
  unsigned in_skipped_ = 0, out_skipped_ = 0;
  bool has_event_ = false;  // since the last sample
  bool has_fix_ = false;    // at the last sample
  std::optional<DeviceTime> last_in_, last_pulse_, last_sample_;
  std::optional<std::int64_t> gnss_second_;  // of the last sample
  std::optional<Device::Pulse> pulse_, next_pulse_;
};

}  // namespace imud::vectornav
