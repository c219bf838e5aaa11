// Schedule: the instants of many imus' samples as one sequence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/time.hpp"

namespace imud {

// Sorted by time; among equal ones, by imu. Allocates only in the constructor.
class Schedule {
 public:
  // At least one grid.
  explicit Schedule(std::span<const Grid> grids);

  struct Instant {
    Nanoseconds since_start{0};  // of the grids
    std::uint64_t index = 0;     // on its imu's grid
    std::size_t imu = 0;         // index into the constructor's grids
  };
  const Instant& next() const noexcept { return heap_.front(); }
  // Goes on to the instant after next().
  void advance() noexcept;
  // Begins again with every grid's first.
  void restart() noexcept;

  const Grid& grid(std::size_t imu) const noexcept { return grids_[imu]; }

 private:
  std::vector<Grid> grids_;
  std::vector<Instant> heap_;  // the next instant of each imu
};

}  // namespace imud
