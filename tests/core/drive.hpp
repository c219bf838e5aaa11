// Drives an Imu as the emulator does: pushes one truth after another, and takes the samples up to each.
#pragma once

#include <vector>

#include "core/imu.hpp"
#include "core/timeline.hpp"
#include "tools/truth/motion.hpp"

namespace imud {

inline Truth coning_truth(TruthTime t) { return find_motion("coning")->at(t, {}); }

// The instants k/rate from 0 to `duration`.
inline std::vector<TruthTime> instants(double rate_hz, Nanoseconds duration) {
  const Grid grid(rate_hz);
  std::vector<TruthTime> times;
  for (std::uint64_t k = 0; grid.offset(k) <= duration; ++k) times.push_back(TruthTime{} + grid.offset(k));
  return times;
}

// `truth_at` returns the truth at a time; both lists are in ascending order. Samples after the last truth are not
// taken.
template <class TruthAt>
std::vector<Sample> drive(const ImuModel& model, TruthAt truth_at, const std::vector<TruthTime>& truth_times,
                          const std::vector<TruthTime>& sensor_times, std::uint64_t seed = 1) {
  Timeline timeline;
  Imu imu(model, seed, stream_id("imu"));
  std::vector<Sample> samples;
  auto due = sensor_times.begin();
  for (const TruthTime t : truth_times) {
    timeline.push(truth_at(t));
    for (; due != sensor_times.end() && *due <= t; ++due)
      samples.push_back(imu.sample(timeline, *due, DeviceTime{due->ns}));
    if (!samples.empty()) imu.advance(timeline, t);
  }
  return samples;
}

}  // namespace imud
