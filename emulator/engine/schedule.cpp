#include "emulator/engine/schedule.hpp"

#include <algorithm>
#include <tuple>

namespace imud {

namespace {
bool is_later(const Schedule::Slot& a, const Schedule::Slot& b) noexcept {
  return std::tie(a.offset, a.imu) > std::tie(b.offset, b.imu);
}
}  // namespace

Schedule::Schedule(std::span<const Grid> grids)
    : grids_(grids.begin(), grids.end()), origins_(grids.size()), firsts_(grids.size()) {
  for (const Grid& grid : grids_) walks_.emplace_back(grid, 0);
  heap_.reserve(grids.size());
}

const Schedule::Slot& Schedule::next(std::size_t imu) const noexcept {
  return *std::ranges::find(heap_, imu, &Slot::imu);
}

void Schedule::advance(Nanoseconds shift) noexcept {
  Slot slot = heap_.front();
  origins_[slot.imu] += shift;
  Grid::Walk& walk = walks_[slot.imu];
  walk.advance();
  slot.index = walk.k() - firsts_[slot.imu];
  slot.offset = origins_[slot.imu] + walk.offset();
  // The advanced slot replaces the first slot of the heap, and sinks below earlier slots.
  std::size_t place = 0;
  for (std::size_t next = 1; next < heap_.size(); next = 2 * place + 1) {
    if (next + 1 < heap_.size() && is_later(heap_[next], heap_[next + 1])) ++next;
    if (!is_later(slot, heap_[next])) break;
    heap_[place] = heap_[next];
    place = next;
  }
  heap_[place] = slot;
}

void Schedule::start(std::size_t imu, Nanoseconds origin, std::uint64_t first) noexcept {
  origins_[imu] = origin;
  firsts_[imu] = first;
  walks_[imu] = Grid::Walk(grids_[imu], first);
  std::erase_if(heap_, [imu](const Slot& slot) { return slot.imu == imu; });
  std::make_heap(heap_.begin(), heap_.end(), is_later);
  heap_.push_back({origin + walks_[imu].offset(), 0, imu});
  std::push_heap(heap_.begin(), heap_.end(), is_later);
}

void Schedule::change(std::size_t imu, const Grid& grid) noexcept {
  const auto next = std::find_if(heap_.begin(), heap_.end(), [imu](const Slot& slot) { return slot.imu == imu; });
  grids_[imu] = grid;
  if (next != heap_.end()) start(imu, next->offset - grid.phase());
}

}  // namespace imud
