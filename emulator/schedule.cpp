#include "emulator/schedule.hpp"

#include <algorithm>
#include <tuple>

namespace imud {

namespace {
bool is_later(const Schedule::Instant& a, const Schedule::Instant& b) noexcept {
  return std::tie(a.since_start, a.imu) > std::tie(b.since_start, b.imu);
}
}  // namespace

Schedule::Schedule(std::span<const Grid> grids) : grids_(grids.begin(), grids.end()), heap_(grids.size()) {
  restart();
}

void Schedule::advance() noexcept {
  std::pop_heap(heap_.begin(), heap_.end(), is_later);
  Instant& instant = heap_.back();
  ++instant.index;
  instant.since_start = grids_[instant.imu].offset(instant.index);
  std::push_heap(heap_.begin(), heap_.end(), is_later);
}

void Schedule::restart() noexcept {
  for (std::size_t imu = 0; imu < grids_.size(); ++imu) heap_[imu] = {grids_[imu].offset(0), 0, imu};
  std::make_heap(heap_.begin(), heap_.end(), is_later);
}

}  // namespace imud
