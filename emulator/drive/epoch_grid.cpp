#include "emulator/drive/epoch_grid.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>

namespace imud {

namespace {
using namespace std::chrono_literals;

constexpr Nanoseconds between_readings = 100ms;
// A change of the clock is followed if it exceeds the uncertainty of the readings by more than this.
constexpr Nanoseconds noticeable = 2us;
// A change is a step if it is greater than least_step plus the drift of a clock off by 1000 ppm between two
// readings. At most a second of the time between the readings counts, so that the period of a slow imu hides no step.
constexpr Nanoseconds least_step = 100us;
constexpr std::int64_t drift_divisor = 1000;
constexpr Nanoseconds longest_drift = 1s;

constexpr std::int64_t second = 1'000'000'000;

// Returns the number of the nominal instant that is nearest to `offset` from the start; with `up`, of the first
// instant that is not before `offset`; 0 for a time before instant 0. Exact, as a rate is a whole number of uHz.
std::uint64_t number_at(const Grid& grid, Nanoseconds offset, bool up) {
  __extension__ using Wide = unsigned __int128;
  if (offset < grid.phase()) return 0;
  const auto elapsed = static_cast<std::uint64_t>((offset - grid.phase()).count());
  const auto rate_uhz = static_cast<std::uint64_t>(std::llround(1e6 / grid.nominal_period_s()));
  constexpr std::uint64_t period_ns = 1'000'000 * second;  // of 1 uHz
  return static_cast<std::uint64_t>((Wide{elapsed} * rate_uhz + (up ? period_ns - 1 : period_ns / 2)) / period_ns);
}

clockid_t clock_of(Epoch epoch) {
  if (epoch == Epoch::monotonic) return CLOCK_MONOTONIC;
  return epoch == Epoch::tai ? CLOCK_TAI : CLOCK_REALTIME;
}

bool has_clock_error(const Grid& grid) {
  constexpr Nanoseconds long_time = 1000s;  // the smallest clock error adds up to 1 us in this time
  return grid.counted(long_time) != long_time;
}
}  // namespace

Nanoseconds EpochGrid::ahead() const noexcept {
  if (epoch_ == Epoch::none || read_at_ != HostTime{}) return ahead_.by;
  return host_.ahead(clock_of(epoch_)).by;
}

HostTime EpochGrid::start_from(HostTime ready) noexcept {
  if (epoch_ == Epoch::none) return ready;
  read_first();
  const std::int64_t ns = std::max(ready, host_.now()).ns + ahead_.by.count();
  return HostTime{(ns + second - 1) / second * second - ahead_.by.count()};
}

EpochGrid::Placement EpochGrid::place(std::size_t imu, const Grid& grid, HostTime start) noexcept {
  if (epoch_ == Epoch::none) return {start, start};
  const Nanoseconds offset = start + ahead_.by - HostTime{};
  return place_at(imu, grid, number_at(grid, offset + grid.phase(), true), Nanoseconds{0});
}

// Places the grid so that its first instant is instant `number` of the nominal grid, later by `off`. The instants of
// an imu that is off its grid are counted from this first instant.
EpochGrid::Placement EpochGrid::place_at(std::size_t imu, const Grid& grid, std::uint64_t number,
                                         Nanoseconds off) noexcept {
  imus_[imu] = {.ahead = ahead_.by, .number = number};
  const HostTime zero = HostTime{} - ahead_.by;
  const HostTime begin = zero + (grid.nominal_offset(number) - grid.phase()) + off;
  const bool is_off = has_clock_error(grid) || off.count() != 0;
  return {begin, is_off ? begin : zero, is_off ? 0 : number, number};
}

EpochGrid::Placement EpochGrid::place_again(std::size_t imu, const Grid& grid, std::uint64_t index,
                                            HostTime next) noexcept {
  const Placed& placed = imus_[imu];
  if (placed.has_changed)
    return place_at(imu, grid, number_at(grid, next + ahead_.by - HostTime{}, false), Nanoseconds{0});
  const Nanoseconds nominal = grid.nominal_offset(placed.number + index);
  const Nanoseconds off = next + placed.ahead - (HostTime{} + nominal);
  return place_at(imu, grid, number_at(grid, nominal + (ahead_.by - placed.ahead), false), off);
}

void EpochGrid::read(HostTime now) noexcept {
  const Host::Ahead reading = host_.ahead(clock_of(epoch_));
  const Nanoseconds change = reading.by - ahead_.by, elapsed = now - read_at_;
  const bool is_first = read_at_ == HostTime{};
  next_reading_ = now + between_readings;
  read_at_ = now;
  const Nanoseconds size = std::chrono::abs(change);
  if (!is_first && size <= noticeable + ahead_.uncertainty + reading.uncertainty) return;
  ahead_ = reading;
  if (is_first || size <= least_step + std::min(elapsed, longest_drift) / drift_divisor) return;
  counters_.last_step = seconds(change);
  counters_.steps.count();
}

}  // namespace imud
