#include "tools/plot/run_errors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>
#include <unsupported/Eigen/FFT>

namespace imud {
namespace {

void require_same(const StillRecording& a, const StillRecording& b) {
  if (a.samples() != b.samples() || a.channels.size() != b.channels.size())
    throw std::runtime_error(fmt::format(
        "runs of {} and {} samples, of {} and {} channels, cannot be compared; where a [[fault]] takes samples "
        "away, `imud replay --npy` has the truth beside each that is left",
        a.samples(), b.samples(), a.channels.size(), b.channels.size()));
}

// Returns the means over up to `half` values to each side.
std::vector<double> smoothed(const std::vector<double>& values, std::size_t half) {
  std::vector<double> sums(values.size() + 1), result(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) sums[i + 1] = sums[i] + values[i];
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t begin = i - std::min(i, half), end = std::min(values.size(), i + half + 1);
    result[i] = (sums[end] - sums[begin]) / static_cast<double>(end - begin);
  }
  return result;
}

}  // namespace

std::vector<double> root_density(const std::vector<double>& values, double rate_hz) {
  constexpr std::size_t longest = 8192;
  const std::size_t length = std::min(longest, std::bit_floor(values.size() / 4));
  std::vector<double> window(length), segment(length), density(length / 2 + 1);
  double power = 0;
  for (std::size_t i = 0; i < length; ++i) {
    window[i] = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(length));
    power += window[i] * window[i];
  }
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  std::size_t segments = 0;
  for (std::size_t begin = 0; begin + length <= values.size(); begin += length / 2, ++segments) {
    double mean = 0;
    for (std::size_t i = 0; i < length; ++i) mean += values[begin + i] / static_cast<double>(length);
    for (std::size_t i = 0; i < length; ++i) segment[i] = window[i] * (values[begin + i] - mean);
    transform.fwd(spectrum, segment);
    for (std::size_t k = 0; k < density.size(); ++k) density[k] += std::norm(spectrum[k]);
  }
  for (double& value : density) value = std::sqrt(2 * value / (rate_hz * power * static_cast<double>(segments)));
  return density;
}

RunErrors compare_runs(const StillRecording& measured, const StillRecording& truth, std::uint64_t count,
                       const std::function<StillRecording(std::uint64_t)>& other) {
  require_same(measured, truth);
  const std::size_t samples = measured.samples(), half = samples / 100;
  RunErrors result;
  result.rate_hz = measured.rate_hz;
  for (std::size_t c = 0; c < measured.channels.size(); ++c) {
    const auto& channel = measured.channels[c];
    result.channels.push_back({channel.number,
                               channel.values.vector(),
                               truth.channels[c].values.vector(),
                               std::vector<double>(samples),
                               std::vector<double>(samples),
                               std::vector<double>(samples),
                               {}});
    for (std::size_t i = 0; i < samples; ++i)
      result.channels[c].error[i] = channel.values[i] - truth.channels[c].values[i];
  }

  // The means, and in `sigma` the sums of squares about them, after each seed (Welford 1962).
  for (std::uint64_t seed = 0; seed < count; ++seed) {
    const StillRecording recording = other(seed);
    require_same(measured, recording);
    for (std::size_t c = 0; c < result.channels.size(); ++c) {
      auto& channel = result.channels[c];
      for (std::size_t i = 0; i < samples; ++i) {
        const double error = recording.channels[c].values[i] - channel.truth[i], before = error - channel.mean[i];
        channel.mean[i] += before / static_cast<double>(seed + 1);
        channel.sigma[i] += before * (error - channel.mean[i]);
      }
    }
  }

  for (auto& channel : result.channels) {
    channel.mean = smoothed(channel.mean, half);
    channel.sigma = smoothed(channel.sigma, half);
    for (double& sigma : channel.sigma) sigma = std::sqrt(std::max(0.0, sigma / static_cast<double>(count - 1)));
    channel.density = root_density(channel.error, result.rate_hz);
    // The mean of each segment is subtracted; therefore the density at frequency 0 is 0.
    channel.density.erase(channel.density.begin());
  }
  const std::size_t frequencies = result.channels.front().density.size();
  for (std::size_t k = 1; k <= frequencies; ++k)
    result.frequencies_hz.push_back(static_cast<double>(k) * result.rate_hz / static_cast<double>(2 * frequencies));
  return result;
}

}  // namespace imud
