// DeviceClock: the clock of one emulated sensor.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "core/time.hpp"

namespace imud {

// Stamps the samples of the imu's grid with nominal periods, whatever error the clock has against the host's, and
// tells the device the time between two samples. Where the host's clock paces the samples it runs on between them, at
// the host's rate times its own error; where truth paces them it stands still from one sample to the next. It never
// passes the stamp of a sample that is still to be taken. One thread.
class DeviceClock {
 public:
  explicit DeviceClock(const Grid& grid) noexcept : grid_(grid) {}

  // Power comes on at `origin`: the clock reads 0 then, and runs.
  void power_on(HostTime origin) noexcept {
    zero_ = now_ = DeviceTime{};
    origin_ = origin;
    next_ = 0;
    samples_ = false;
  }
  // Sets the clock: instant k of the grid is stamped `zero` + its nominal offset. With `origin`, the host time at
  // which the grid starts, the clock runs; without, it stands at the last stamp. Returns by how much the clock was
  // set ahead, compared with the time that it would have had at instant 0: one period after the last sample.
  Nanoseconds set(DeviceTime zero, std::optional<HostTime> origin) noexcept {
    const DeviceTime expected = next_ > 0 ? stamp(next_) : origin_ && origin ? read(*origin + grid_.phase()) : now_;
    zero_ = zero;
    origin_ = origin;
    next_ = 0;
    samples_ = false;
    const Nanoseconds step = stamp(0) - std::max(expected, now_);
    now_ = now_ + step;
    return step;
  }
  // From now on samples are taken, the next one at instant 0.
  void start_samples() noexcept { samples_ = true; }

  // The stamp of instant k, counted from set().
  DeviceTime stamp(std::uint64_t k) const noexcept { return zero_ + grid_.nominal_offset(k); }
  // The next sample, which is stamped `stamp`, is taken.
  void take_sample(DeviceTime stamp) noexcept {
    ++next_;
    now_ = std::max(now_, stamp);
  }

  // Reads the clock at `host`, if it runs. Never decreases but by set().
  DeviceTime now(HostTime host) noexcept {
    if (!origin_) return now_;
    DeviceTime time = read(host);
    if (samples_) time = std::min(time, stamp(next_));
    return now_ = std::max(now_, time);
  }
  DeviceTime now() const noexcept { return now_; }
  // Returns when the clock will show `time`, rounded up; nullopt if it does not run, or shows it only after the next
  // sample is taken.
  std::optional<HostTime> host_time(DeviceTime time) const noexcept {
    if (!origin_ || (samples_ && time > stamp(next_))) return std::nullopt;
    const HostTime host = *origin_ + grid_.phase() + grid_.elapsed(time - zero_ - grid_.phase());
    return read(host) < time ? host + Nanoseconds{1} : host;
  }

 private:
  DeviceTime read(HostTime host) const noexcept {
    return zero_ + grid_.phase() + grid_.counted(host - *origin_ - grid_.phase());
  }

  Grid grid_;
  DeviceTime zero_;
  std::optional<HostTime> origin_;  // nothing while the clock stands
  DeviceTime now_;
  std::uint64_t next_ = 0;  // sample, counted from set()
  bool samples_ = false;
};

}  // namespace imud
