// Sensor: the sensing part of an emulated sensor, from the truth at an instant to a Sample.
#pragma once

#include <cstdint>
#include <optional>

#include "core/gnss/acquisition.hpp"
#include "core/imu.hpp"
#include "core/navigation/own_solution.hpp"
#include "core/timeline.hpp"
#include "emulator/faults/channel_faults.hpp"
#include "emulator/imu/device_clock.hpp"
#include "emulator/imu/reload.hpp"
#include "emulator/imu/solution_judge.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

// The model with its grid and the device's clock, and the faults of the sensors. After construction nothing here
// allocates, locks or throws. One thread.
class Sensor {
 public:
  // `faults` are the faults of the imu; nullptr if there are none.
  Sensor(const ImuConfig& config, std::uint64_t seed, ChannelFaults* faults);

  Imu& imu() noexcept { return imu_; }
  const Imu& imu() const noexcept { return imu_; }
  DeviceClock& clock() noexcept { return clock_; }
  const DeviceClock& clock() const noexcept { return clock_; }
  const Grid& grid() const noexcept { return grid_; }
  // Returns the solution that the unit computes; nullptr: none.
  const OwnSolution* own_solution() const noexcept { return solution_ ? &*solution_ : nullptr; }
  // Returns the judge of that solution; nullptr if there is none.
  SolutionJudge* judge() noexcept { return judge_ ? &*judge_ : nullptr; }
  // The last sample that was taken.
  Sample& sample() noexcept { return sample_; }
  // Returns how far the last sample was ahead of the newest truth; 0 if it was not ahead.
  Nanoseconds ahead() const noexcept { return ahead_; }
  // Returns the time up to which the truth of this run was used; nullopt before its first sample.
  std::optional<TruthTime> used_until() const noexcept {
    return has_sampled_ ? std::optional(imu_.advanced_to()) : std::nullopt;
  }

  // Begins a run of the truth, whose first truth is at `begin`. The first sample has no increments.
  void begin_run(TruthTime begin) noexcept;
  // Continues the run after its time has leapt. The next sample has no increments and is flagged as extrapolated.
  void pass_over() noexcept;
  // Take the sample of instant `k` of the grid, of the truth at `time` or of a vehicle at rest.
  void sense(const Timeline& timeline, TruthTime time, std::uint64_t k) noexcept;
  void sense_at_rest(Nanoseconds since_power_on, std::uint64_t k) noexcept;
  // Integrates the truth up to `until`, which is not after the next sample (Imu::advance()).
  void advance(const Timeline& timeline, TruthTime until) noexcept {
    if (has_sampled_) imu_.advance(timeline, until);
  }
  // Replaces the seed, as Imu::set_seed() does.
  void set_seed(std::uint64_t seed) noexcept;
  // The next sample has the turn-on errors of another start.
  void restart() noexcept;
  // Follows the device (Device::filters(), navigation_requests()). Takes the filters that the device's settings
  // choose, if the product has such settings, and the host's requests to the unit's own filter, if the unit has one.
  // Writes nothing where neither has changed: an EncodingThread calls this at a device's deadline.
  void follow(const std::optional<SensorFilters>& filters, const NavigationRequests& requests) noexcept;
  // Exchanges the model for the reload's model, which continues from the old model (Imu::continue_from()).
  void exchange(Reload::Sensor& next) noexcept;

 private:
  void take_errors(const Timeline& timeline, TruthTime time) noexcept;
  void navigate(const Timeline& timeline, TruthTime time) noexcept;
  void take_clock_errors(std::optional<double> truth_c) noexcept;
  // Returns the UTC, ns since 1970, of a time of the clock; nullopt if the host's clock does not pace it.
  std::optional<std::int64_t> utc_ns_of(DeviceTime time) const noexcept;

  Grid grid_;
  Imu imu_;
  DeviceClock clock_;
  Normals normals_;  // the random numbers of the clock's errors
  Oscillator oscillator_;
  StampError stamp_error_;
  bool has_clock_errors_;  // the oscillator or the stamps have errors
  Acquisition acquisition_;
  std::optional<OwnSolution> solution_;
  std::optional<SolutionJudge> judge_;  // of the solution's errors
  NavigationRequests requests_;         // the requests that have acted
  const Nanoseconds sampling_delay_;
  const bool device_filters_;  // the device's settings have the filters
  SensorFilters filters_;      // if device_filters_
  ChannelFaults* const faults_;
  std::int64_t utc_offset_ns_ = 0;  // UTC, ns since 1970, less host time, if there are faults
  bool is_resting_ = false;
  bool has_sampled_ = false;     // in this run
  bool has_run_ = false;         // has sampled a truth
  bool has_leapt_ = false;       // since the last sample
  TruthTime run_begin_;          // the times of faults count from this time
  std::uint64_t power_ons_ = 0;  // after the first
  Navigation possible_fix_;      // of the last sample, at whose place its solution stands
  Sample sample_;
  Nanoseconds ahead_{0};
};

}  // namespace imud
