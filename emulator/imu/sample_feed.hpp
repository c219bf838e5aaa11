// SampleFeed: a bounded queue of samples, with the truth behind them, for watchers of a run.
#pragma once

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "core/sample.hpp"
#include "emulator/ground/counters.hpp"

namespace imud {

// The solution that a unit computes itself, and its errors.
struct FeedSolution {
  using Vectors = std::array<std::array<float, 3>, 3>;  // of attitude, velocity and position

  Solution::State state = Solution::State::aligning;
  std::uint16_t used = 0, rejected = 0;  // bits of namespace aid, as in Solution
  // Attitude: rotations about north, east and down, rad. Velocity and position: along north, east and down, m/s and
  // m. NaN: the unit, or the truth, has no such value.
  Vectors errors{}, sigmas{};
};

// A sample as its device has received it, and the truth that it measures, both in platform axes.
struct FeedSample {
  std::uint16_t imu = 0;  // its number in the configuration
  std::uint32_t status = 0;
  std::uint64_t k = 0;                  // Sample::counter
  std::int64_t time_ns = 0;             // its stamp by the device's clock
  std::optional<TruthTime> truth_time;  // the simulation time that it samples; nullopt at rest before the first truth
  bool is_sent = true;  // false: no frame has left, because the sample is silent, paused, without power, or too late
  double temperature_c = 0;
  Vector3 rate = Vector3::Zero(), specific_force = Vector3::Zero();  // rad/s, m/s^2
  // The motion without any error, interpolated at the sample's instant, even if the sample was extrapolated or held.
  // NaN if the truth of that instant has not come.
  Vector3 true_rate = Vector3::Zero(), true_specific_force = Vector3::Zero();
  // Extrapolated samples of the imu up to this one, the held among them, and the unsent among the held (ImuCounters).
  // The differences of these counts from one sample of the feed to the next include the samples between the two.
  std::uint64_t extrapolated = 0, held = 0, silent = 0;
  // The rest of the sample, as the device has received it (Sample). Position and velocity of a receiver include its
  // errors.
  std::array<float, 4> attitude{1, 0, 0, 0};        // q_LP: w, x, y, z
  std::array<float, 3> magnetic_field{};            // T; 0: not known
  float pressure = 0;                               // Pa; 0: not known
  std::optional<std::array<float, 3>> inclination;  // m/s^2; nullopt: the imu has no inclinometers
  bool has_place = false;
  double latitude = 0, longitude = 0, height = 0;  // rad, rad, m; valid if has_place
  std::optional<FeedSolution> solution;            // has attitude and place; nullopt: these are the truth's
};

// Filled only while somebody watches, and only with each n-th sample of an imu. The first watch() allocates; neither
// thread waits or locks. A sample for which there is no room is counted.
class SampleFeed {
 public:
  static constexpr std::size_t capacity = 16384;  // 2 s of 8 imus at 1 kHz

  // `lost` must outlive this.
  SampleFeed(std::size_t imus, Counter& lost) : every_(imus), lost_(lost) {}

  // Main thread: the feed gets samples of the imu whose numbers are multiples of `every`; 0: none.
  void watch(std::size_t imu, std::uint32_t every) {
    if (every != 0 && !samples_) samples_.emplace(capacity);
    every_[imu].store(every, std::memory_order_release);
  }
  bool pop(FeedSample& sample) noexcept { return samples_ && samples_->pop(sample); }

  // Sampling thread.
  bool wants(std::size_t imu, std::uint64_t k) const noexcept {
    const std::uint32_t every = every_[imu].load(std::memory_order_acquire);
    return every != 0 && k % every == 0;
  }
  // wants() must have returned true for a sample.
  void push(const FeedSample& sample) noexcept {
    if (!samples_->push(sample)) lost_.count();
  }

 private:
  std::optional<boost::lockfree::spsc_queue<FeedSample>> samples_;  // 5.6 MB; nullopt: nobody has watched
  std::deque<std::atomic<std::uint32_t>> every_;                    // by imu
  Counter& lost_;
};

}  // namespace imud
