// DeviceClock: the clock of one emulated sensor.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "core/time.hpp"

namespace imud {

// Stamps the samples of the imu's grid with nominal periods, whatever the clock's error against the host's, and
// gives the device's time between two samples. Where the host's clock paces the samples, this clock runs between
// them, at the host's rate times its own error; where truth paces them, it stands still from one sample to the next.
// The clock never passes the stamp of the next sample. One thread.
class DeviceClock {
 public:
  explicit DeviceClock(const Grid& grid) noexcept : grid_(grid), walk_(grid, 0, true) {}

  // Starts the clock, which reads 0 at `origin`.
  void power_on(HostTime origin) noexcept {
    zero_ = now_ = DeviceTime{};
    origin_ = origin;
    next_ = 0;
    has_samples_ = false;
  }
  // Sets the clock: instant k of the grid is stamped `zero` + its nominal offset. With `origin`, the host time at
  // which the grid starts, the clock runs; without, it stands at the last stamp. Returns the step of the clock: the
  // new time of instant 0 less the time that it would have had there without set(), which is one period after the
  // last sample.
  Nanoseconds set(DeviceTime zero, std::optional<HostTime> origin) noexcept {
    const DeviceTime expected = next_ > 0 ? stamp(next_) : origin_ && origin ? read(*origin + grid_.phase()) : now_;
    zero_ = zero;
    origin_ = origin;
    next_ = 0;
    has_samples_ = false;
    const Nanoseconds step = stamp(0) - std::max(expected, now_);
    now_ = now_ + step;
    return step;
  }
  // Changes the grid between two samples: the next sample keeps its time, and is at instant 0 of the new grid.
  void change(const Grid& grid) noexcept {
    if (has_samples_) {
      zero_ = stamp(next_) - grid.phase();
      if (origin_) origin_ = *origin_ + (grid_.offset(next_) - grid.phase());
      next_ = 0;
    }
    grid_ = grid;
    walk_ = Grid::Walk(grid, 0, true);
  }
  // Delays the instants after the last sample by `by`, because the frequency is not constant. Called once for a
  // sample. The rate of the clock until the next sample does not change.
  void shift(Nanoseconds by) noexcept {
    shift_ = by;
    if (origin_) origin_ = *origin_ + by;
  }
  // Returns `by` of the last shift(); 0 if take_shift() was called since then.
  Nanoseconds take_shift() noexcept { return std::exchange(shift_, Nanoseconds{0}); }
  // Starts the samples: the next one is at instant 0.
  void start_samples() noexcept { has_samples_ = true; }

  // Returns the stamp of the next sample; nullopt before start_samples().
  std::optional<DeviceTime> next_sample() const noexcept {
    return has_samples_ ? std::optional(stamp(next_)) : std::nullopt;
  }
  // Returns the stamp of instant k of the present grid. The last set() or change() placed instant 0.
  DeviceTime stamp(std::uint64_t k) const noexcept {
    if (k == walk_.k() + 1)
      walk_.advance();
    else if (k != walk_.k()) [[unlikely]]
      walk_to(k);
    return zero_ + walk_.offset();
  }
  // Records that the next sample, which is stamped `stamp`, is taken.
  void take_sample(DeviceTime stamp) noexcept {
    ++next_;
    now_ = std::max(now_, stamp);
  }

  // Returns the clock's time at `host`, or the time at which the clock stands. Only set() can decrease this time.
  DeviceTime now(HostTime host) noexcept {
    if (!origin_) return now_;
    DeviceTime time = read(host);
    if (has_samples_) time = std::min(time, stamp(next_));
    return now_ = std::max(now_, time);
  }
  DeviceTime now() const noexcept { return now_; }
  // Returns when the clock will read `time`, rounded up; nullopt if the clock stands, or reads `time` only after the
  // next sample.
  std::optional<HostTime> host_time(DeviceTime time) const noexcept {
    if (!origin_ || (has_samples_ && time > stamp(next_))) return std::nullopt;
    const HostTime host = *origin_ + grid_.phase() + grid_.elapsed(time - zero_ - grid_.phase());
    return read(host) < time ? host + Nanoseconds{1} : host;
  }

 private:
  // Out of line: a Walk begins with divisions.
  [[gnu::noinline]] void walk_to(std::uint64_t k) const noexcept { walk_ = Grid::Walk(grid_, k, true); }
  DeviceTime read(HostTime host) const noexcept {
    return zero_ + grid_.phase() + grid_.counted(host - *origin_ - grid_.phase());
  }

  Grid grid_;
  mutable Grid::Walk walk_;  // stands at the nominal instant that was asked for last
  DeviceTime zero_;
  Nanoseconds shift_{0};
  std::optional<HostTime> origin_;  // nullopt while the clock stands
  bool has_samples_ = false;        // start_samples() was called since set()
  // On another cache line than the walk, because an EncodingThread may use them.
  alignas(64) DeviceTime now_;
  std::uint64_t next_ = 0;  // the next sample, counted from set()
};

}  // namespace imud
