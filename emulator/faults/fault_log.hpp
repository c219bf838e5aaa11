// FaultLog: the begins, ends and effects of faults, from the sampling thread to any thread that reads them.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/time.hpp"
#include "emulator/plan/fault.hpp"

namespace imud {

// The sizes of the errors of a unit's own solution against the truth; negative: there was no such value.
struct SolutionErrors {
  double attitude = -1;  // rad, the angle of the rotation from one attitude to the other
  double velocity = -1;  // m/s
  double position = -1;  // m

  // Replaces each size by the other's where that is larger.
  void raise_to(const SolutionErrors& other) noexcept {
    attitude = std::max(attitude, other.attitude);
    velocity = std::max(velocity, other.velocity);
    position = std::max(position, other.position);
  }
};

// The begin or the end of an occurrence of a fault on an imu, or its effect.
struct FaultEvent {
  enum class Kind : std::uint8_t {
    begun,
    ended,
    passed_over,  // the fault has begun and ended between two samples, because the simulation's time leapt
    effect,       // `effect` is known; only where the unit computes its own solution
  };
  // For so long after its end a fault counts as the cause of errors, unless it occurs again.
  static constexpr double effect_s = 60;

  std::uint32_t fault = 0;  // its number in the configuration
  std::uint16_t imu = 0;    // its number in the configuration
  Kind kind = Kind::begun;
  std::int32_t run = 0;  // of the truth, from 0; -1: before the first truth
  std::uint64_t occurrence = 0;
  std::uint64_t sample = 0;   // of its run: the first, or the last that the fault acts on, or that was judged
  std::uint64_t counter = 0;  // of all samples of the imu (Sample::counter)
  double time_s = 0;          // since the begin of the run
  DeviceTime device_time;     // of the sample
  std::array<double, FaultKind::max_parameters> parameters = {};  // as drawn
  SolutionErrors effect;  // the largest errors of the solution from the begin until effect_s after the end
};

// A list that only grows, up to a size that is set at the start; further events are lost, and lost occurrences are
// counted. An occurrence has both its begin and its end in the list, or neither. One thread adds, any other reads the
// added events and the counts.
class FaultLog {
 public:
  static constexpr std::size_t default_size = 65536;
  // The occurrences of a fault on an imu that are not in the list.
  struct Lost {
    std::uint64_t acted = 0, passed_over = 0;
  };

  // The room is for `size` events. Lost occurrences are counted for the numbers of faults below `faults` on truth and
  // on the numbers of imus below `imus`.
  explicit FaultLog(std::size_t size = default_size, std::size_t faults = 0, std::size_t imus = 0)
      : capacity_(size), imus_(imus), lost_occurrences_(faults * (imus + 1)) {}

  // Reserves the memory for all events, 7 MB by default. Must be called before a fault can act: then add() does not
  // allocate.
  void reserve() { events_.reserve(capacity_); }

  // Returns false if there is no room, so that the event is lost. The begin of an occurrence keeps room for its end,
  // which must be added if and only if the begin is in the list.
  bool add(const FaultEvent& event) noexcept {
    using Kind = FaultEvent::Kind;
    const std::size_t size = size_.load(std::memory_order_relaxed);
    const std::size_t needed = event.kind == Kind::begun ? 2 : event.kind == Kind::ended ? 0 : 1;
    if (size + awaited_ends_ + needed > capacity_) {
      lose(event);
      return false;
    }
    if (event.kind == Kind::begun) ++awaited_ends_;
    if (event.kind == Kind::ended) --awaited_ends_;
    events_.push_back(event);  // in its place, because the memory is reserved
    size_.store(size + 1, std::memory_order_release);
    return true;
  }

  std::size_t size() const noexcept { return size_.load(std::memory_order_acquire); }
  // `i` must be below a value that size() has returned. The size of the vector may change in add() meanwhile.
  const FaultEvent& operator[](std::size_t i) const noexcept { return *(events_.data() + i); }
  // The number of lost begins and effects.
  std::uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }
  // The lost occurrences of a fault on an imu, or on truth by truth_number.
  Lost lost(std::size_t fault, std::size_t imu) const noexcept {
    const std::size_t i = index(fault, imu);
    if (i >= lost_occurrences_.size()) return {};
    const auto& [acted, passed_over] = lost_occurrences_[i];
    return {acted.load(std::memory_order_relaxed), passed_over.load(std::memory_order_relaxed)};
  }

 private:
  // The counts of truth follow the counts of the imus.
  std::size_t index(std::size_t fault, std::size_t imu) const noexcept {
    return fault * (imus_ + 1) + std::min(imu, imus_);
  }
  void lose(const FaultEvent& event) noexcept {
    using Kind = FaultEvent::Kind;
    lost_.fetch_add(1, std::memory_order_relaxed);
    const std::size_t i = index(event.fault, event.imu);
    if (i >= lost_occurrences_.size()) return;
    if (event.kind == Kind::begun) lost_occurrences_[i][0].fetch_add(1, std::memory_order_relaxed);
    if (event.kind == Kind::passed_over) lost_occurrences_[i][1].fetch_add(1, std::memory_order_relaxed);
  }

  const std::size_t capacity_, imus_;
  std::vector<FaultEvent> events_;
  std::atomic<std::size_t> size_ = 0;
  std::size_t awaited_ends_ = 0;  // of occurrences whose begin is in the list
  std::atomic<std::uint64_t> lost_ = 0;
  std::vector<std::array<std::atomic<std::uint64_t>, 2>> lost_occurrences_;  // acted, passed over
};

}  // namespace imud
