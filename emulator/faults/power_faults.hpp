// PowerFaults: the state of the device's supply under faults of the power.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "emulator/plan/fault.hpp"

namespace imud {

// The kinds, with the target "power".
std::span<const FaultKind> power_fault_kinds() noexcept;

// The state of the device at a sample.
struct PowerStep {
  bool is_on = true;          // the device runs
  bool starts = false;        // the device is switched on, or comes out of a reset, at the sample
  bool as_delivered = false;  // its settings were lost at this start or at an earlier one
};

// The faults of one imu's power, sample by sample. No allocation after construction; one thread.
class PowerFaults {
 public:
  PowerFaults(std::string_view imu, std::uint64_t seed, double rate_hz);
  // Sets the rate of the samples from the next one on.
  void set_rate(double rate_hz) noexcept { rate_hz_ = rate_hz; }
  // Returns the state at the next sample, of which `faults` are active.
  PowerStep step(std::span<const ActiveFault> faults) noexcept;
  // The supply goes off and on between two samples, not by a fault. Returns true if the device starts at once: the
  // faults of the last sample neither keep it off nor delay its start.
  bool cycle() noexcept;

 private:
  std::uint64_t delay() const noexcept;

  const std::uint64_t seed_;
  const std::uint32_t stream_;
  double rate_hz_;
  bool is_supplied_ = true;
  bool is_on_ = true;
  bool as_delivered_ = false;
  double slow_s_ = 0;          // by which a start is delayed
  std::uint64_t waiting_ = 0;  // samples until the device starts
};

}  // namespace imud
