// Schedule: the sample instants of many imus as one sequence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/time.hpp"

namespace imud {

// Merges the grids of all imus, sorted by time; among equal instants, by imu. A grid is included from its start()
// on. Allocates only in the constructor. One thread.
class Schedule {
 public:
  // `grids` must have at least one grid. The constructor starts none.
  explicit Schedule(std::span<const Grid> grids);

  struct Slot {
    Nanoseconds offset{0};    // from the schedule's origin
    std::uint64_t index = 0;  // since the imu's start()
    std::size_t imu = 0;      // index into the constructor's grids
  };
  // Returns true while no grid is started; then next() must not be called.
  bool empty() const noexcept { return heap_.empty(); }
  // Returns the earliest slot that advance() has not passed.
  const Slot& next() const noexcept { return heap_.front(); }
  // Returns the earliest such slot of the imu, whose grid must be started.
  const Slot& next(std::size_t imu) const noexcept;
  // Advances to the slot after next(). The later instants of next()'s imu are delayed by `shift`, which must leave
  // the instants in order.
  void advance(Nanoseconds shift = Nanoseconds{0}) noexcept;

  // Starts the imu's grid, or starts it again, so that its instants are `origin` + Grid::offset(first + index), as
  // far as advance() does not shift them.
  void start(std::size_t imu, Nanoseconds origin, std::uint64_t first = 0) noexcept;
  // Changes the imu's grid. If the grid is started, its next instant does not move, and becomes instant 0 of the new
  // grid.
  void change(std::size_t imu, const Grid& grid) noexcept;

 private:
  std::vector<Grid> grids_;
  std::vector<Grid::Walk> walks_;  // each at the imu's next instant
  std::vector<Nanoseconds> origins_;
  std::vector<std::uint64_t> firsts_;  // instants of the grids
  std::vector<Slot> heap_;             // the next slot of each imu whose grid is started
};

}  // namespace imud
