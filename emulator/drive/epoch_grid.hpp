// EpochGrid: where the imus' grids of samples start, and where they stay if several hosts share a clock.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/time.hpp"
#include "emulator/ground/counters.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/plan/epoch.hpp"

namespace imud {

// Without an epoch, instant 0 of a grid is where its run starts. With an epoch, the instants of an imu are
// epoch + Grid::nominal_offset(K) by the epoch's clock, for every host that has the same clock, and a run starts with
// the first of them that is at or after a whole second. An imu with a clock error starts on that grid and leaves it.
//
// The host's clock is the one that the loop waits by. The difference of the epoch's clock from it is read ten times a
// second. If the difference has changed by more than the uncertainty of a reading, the grids follow: the next instant
// of each imu moves by half a period at most, to an instant of its grid by the changed clock. A change that no drift
// explains is a step, which is counted. Allocates only in the constructor. One thread.
class EpochGrid {
 public:
  EpochGrid(Host& host, Epoch epoch, std::size_t imus, ClockCounters& counters)
      : host_(host), epoch_(epoch), counters_(counters), imus_(imus) {}

  // Returns the start of grids that may not start before `ready`: `ready` without an epoch, otherwise the next whole
  // second of the epoch's clock. Reads the clock of the epoch. Changes of the clock count from then on, so that the
  // imus must be placed at once.
  HostTime start_from(HostTime ready) noexcept;

  // Reads the clock before the first grid is placed, as start_from() does.
  void read_first() noexcept {
    if (epoch_ != Epoch::none) read(host_.now());
  }
  // Return how much the epoch's clock is ahead of the host's; 0 without an epoch. The first returns the difference
  // that the grids use, or reads the clock now if it was never read. The second returns the difference by which the
  // imu is placed.
  Nanoseconds ahead() const noexcept;
  Nanoseconds ahead(std::size_t imu) const noexcept { return imus_[imu].ahead; }

  struct Placement {
    HostTime begin;            // the imu's first instant less the phase
    HostTime origin;           // the instants are origin + Grid::offset(first + i)
    std::uint64_t first = 0;   // instant of the grid from `origin`
    std::uint64_t number = 0;  // K of the first instant; without an epoch 0
  };
  // Places the imu's grid so that its first instant is the first at or after `start`, apart from the phase.
  Placement place(std::size_t imu, const Grid& grid, HostTime start) noexcept;

  // Reads the clock if that is due.
  void update(HostTime now) noexcept {
    if (epoch_ != Epoch::none && now >= next_reading_) [[unlikely]]
      read(now);
  }
  // Returns false if the placed imu stays where it is, because neither the clock nor its grid has changed.
  bool moves(std::size_t imu) const noexcept {
    return epoch_ != Epoch::none && (imus_[imu].ahead != ahead_.by || imus_[imu].has_changed);
  }
  // Returns the placement that an imu changes to because the clock has changed; nullopt if it stays. The imu's next
  // instant is `next`, the one with this `index` since it was placed.
  std::optional<Placement> follow(std::size_t imu, const Grid& grid, std::uint64_t index, HostTime next) noexcept {
    if (!moves(imu)) return std::nullopt;
    return place_again(imu, grid, index, next);
  }
  // The imu has another grid from its next instant on. The next instant does not move. The instants after it follow
  // the epoch.
  void change(std::size_t imu) noexcept { imus_[imu].has_changed = true; }

 private:
  void read(HostTime now) noexcept;
  Placement place_at(std::size_t imu, const Grid& grid, std::uint64_t number, Nanoseconds off) noexcept;
  Placement place_again(std::size_t imu, const Grid& grid, std::uint64_t index, HostTime next) noexcept;

  struct Placed {
    Nanoseconds ahead{0};      // the clock's, when the imu was placed
    std::uint64_t number = 0;  // K of its first instant
    bool has_changed = false;  // its grid has changed
  };
  Host& host_;
  const Epoch epoch_;
  ClockCounters& counters_;
  Host::Ahead ahead_;  // the reading that counts
  HostTime read_at_;   // when the clock was read last
  HostTime next_reading_;
  std::vector<Placed> imus_;
};

}  // namespace imud
