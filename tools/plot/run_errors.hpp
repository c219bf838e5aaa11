// RunErrors: the channels of an emulated run beside its truth, their errors, and the errors with other seeds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "tools/allan/still_recording.hpp"

namespace imud {

struct RunErrors {
  struct Channel {
    std::size_t number = 0;  // index in channel_names
    // A value for each sample, in rad/s or m/s^2. mean and sigma are the mean and the standard deviation of the error
    // over the seeds, smoothed over a hundredth of the run to each side.
    std::vector<double> measured, truth, error, mean, sigma;
    std::vector<double> density;  // root of the error's one-sided density, at frequencies_hz; per sqrt(Hz)
    bool is_rate() const noexcept { return number < channels_per_sensor; }
    std::string_view name() const noexcept { return channel_names[number]; }
  };
  double rate_hz = 0;
  std::vector<Channel> channels;
  std::vector<double> frequencies_hz;  // above 0, to half of the rate
  std::size_t samples() const noexcept { return channels.empty() ? 0 : channels.front().error.size(); }
};

// Compares a recording with the truth, and with `count` recordings of other seeds on the same samples, at least two,
// which other(0), other(1), ... return; only one of them is in memory at a time. Throws std::runtime_error if their
// lengths or channels differ.
RunErrors compare_runs(const StillRecording& measured, const StillRecording& truth, std::uint64_t count,
                       const std::function<StillRecording(std::uint64_t)>& other);

// Returns the root of the one-sided spectral density at k * rate_hz / (2 * (result.size() - 1)): the mean over
// segments that overlap by half, less their mean, under Hann's window (Welch 1967). Segments have a quarter of the
// values, at most 8192; there are at least 32 values.
std::vector<double> root_density(const std::vector<double>& values, double rate_hz);

}  // namespace imud
