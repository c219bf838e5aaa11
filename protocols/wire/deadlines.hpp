// Deadlines: the times at which a device acts without input. Each reason to act has its own deadline.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "core/time.hpp"

namespace imud {

// Returns the earlier of two times; nullopt stands for a time that is not scheduled.
constexpr std::optional<DeviceTime> earlier(std::optional<DeviceTime> a, std::optional<DeviceTime> b) noexcept {
  return !b || (a && *a < *b) ? a : b;
}

// `Reason` is an enumeration from 0 whose last enumerator, `count`, is the number of reasons. At most one deadline
// is scheduled for each reason. Allocates nothing. One thread.
template <class Reason>
class Deadlines {
 public:
  void set(Reason reason, DeviceTime time) noexcept { times_[index(reason)] = time; }
  void clear(Reason reason) noexcept { times_[index(reason)].reset(); }
  void clear() noexcept { times_ = {}; }
  // Returns the time that is scheduled for `reason`, or nullopt.
  std::optional<DeviceTime> operator[](Reason reason) const noexcept { return times_[index(reason)]; }

  // Returns the earliest time, or nullopt if nothing is scheduled.
  std::optional<DeviceTime> next() const noexcept {
    const std::size_t first = earliest();
    return first == size ? std::nullopt : times_[first];
  }
  struct Due {
    Reason reason;
    DeviceTime time;  // the scheduled time
  };
  // Removes and returns the earliest deadline up to `now`; of equal deadlines, the first in the order of the
  // enumeration. Returns nullopt if no deadline is due.
  std::optional<Due> take(DeviceTime now) noexcept {
    const std::size_t first = earliest();
    if (first == size || *times_[first] > now) return std::nullopt;
    const Due due{static_cast<Reason>(first), *times_[first]};
    times_[first].reset();
    return due;
  }
  void step_clock(Nanoseconds by) noexcept {
    for (std::optional<DeviceTime>& time : times_)
      if (time) time = *time + by;
  }

 private:
  static constexpr auto size = static_cast<std::size_t>(Reason::count);
  static constexpr std::size_t index(Reason reason) noexcept { return static_cast<std::size_t>(reason); }
  std::size_t earliest() const noexcept {
    std::size_t first = size;
    for (std::size_t i = 0; i < size; ++i)
      if (times_[i] && (first == size || *times_[i] < *times_[first])) first = i;
    return first;
  }

  std::array<std::optional<DeviceTime>, size> times_ = {};
};

}  // namespace imud
