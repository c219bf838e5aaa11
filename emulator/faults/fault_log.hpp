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

// A list that only grows, up to a size that is set at the start; further events are counted as lost. One thread adds,
// any other reads the added events.
class FaultLog {
 public:
  static constexpr std::size_t default_size = 65536;
  // Reserves the memory for all events, of which only written events take pages.
  explicit FaultLog(std::size_t size = default_size) : capacity_(size) { events_.reserve(size); }

  void add(const FaultEvent& event) noexcept {
    const std::size_t size = size_.load(std::memory_order_relaxed);
    if (size == capacity_) {
      lost_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    events_.push_back(event);  // in its place, because the memory is reserved
    size_.store(size + 1, std::memory_order_release);
  }

  std::size_t size() const noexcept { return size_.load(std::memory_order_acquire); }
  // `i` must be below a value that size() has returned. The size of the vector may change in add() meanwhile.
  const FaultEvent& operator[](std::size_t i) const noexcept { return *(events_.data() + i); }
  std::uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }

 private:
  const std::size_t capacity_;
  std::vector<FaultEvent> events_;
  std::atomic<std::size_t> size_ = 0;
  std::atomic<std::uint64_t> lost_ = 0;
};

}  // namespace imud
