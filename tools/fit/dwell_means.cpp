#include "tools/fit/dwell_means.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>

namespace imud {
namespace {

constexpr std::size_t blocks = 16, least_samples = 32;

double mean_of(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value - values.front();
  return values.front() + sum / static_cast<double>(values.size());
}

double variance_of(std::span<const double> values) {
  const double mean = mean_of(values);
  double sum = 0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return sum / static_cast<double>(values.size() - 1);
}

// Returns the variance of the means of the blocks, times the number of samples of a block.
double white_variance(std::span<const double> values) {
  const std::size_t length = values.size() / blocks;
  std::array<double, blocks> means{};
  for (std::size_t i = 0; i < blocks; ++i) means[i] = mean_of(values.subspan(i * length, length));
  return variance_of(means) * static_cast<double>(length);
}

// Returns the variance of the mean's rounding, where the noise is too small to spread the values over several digits.
double digit_variance(std::span<const double> values) {
  double lsb = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < values.size(); ++i)
    if (const double step = std::abs(values[i] - values[i - 1]); step > 0) lsb = std::min(lsb, step);
  return std::isfinite(lsb) && variance_of(values) < 0.25 * lsb * lsb ? lsb * lsb / 12 : 0;
}

}  // namespace

double reference_temperature(const std::vector<Dwell>& dwells) {
  double sum = 0, count = 0;
  for (const Dwell& dwell : dwells)
    if (dwell.temperature_c) {
      sum += *dwell.temperature_c;
      ++count;
    }
  return count > 0 ? sum / count : 25;
}

std::vector<DwellMean> dwell_means(const StillRecording& recording, const std::vector<Dwell>& dwells, bool is_rate,
                                   double reference_c) {
  std::array<const StillRecording::Channel*, channels_per_sensor> channels{};
  for (const auto& channel : recording.channels)
    if (channel.is_rate() == is_rate) channels[channel.number % channels_per_sensor] = &channel;
  std::vector<DwellMean> means;
  for (const auto* channel : channels)
    if (channel == nullptr) return means;
  Vector3 white = Vector3::Zero();  // of one sample
  for (std::size_t number = 0; number < dwells.size(); ++number) {
    const Dwell& dwell = dwells[number];
    const std::optional<Vector3>& input = is_rate ? dwell.rate : dwell.force;
    if (!input) continue;
    const auto begin = static_cast<std::size_t>(std::llround(dwell.begin_s * recording.rate_hz));
    const auto end = static_cast<std::size_t>(std::llround(dwell.end_s * recording.rate_hz));
    if (end > recording.samples())
      throw std::runtime_error(fmt::format("dwell {} ends at {} s, and the recording has {:.6g} s", number + 1,
                                           dwell.end_s,
                                           static_cast<double>(recording.samples()) / recording.rate_hz));
    if (end - begin < least_samples)
      throw std::runtime_error(
          fmt::format("dwell {} has {} samples; right would be at least {}", number + 1, end - begin, least_samples));
    DwellMean& mean = means.emplace_back();
    mean.middle_s = 0.5 * (dwell.begin_s + dwell.end_s);
    mean.length_s = dwell.end_s - dwell.begin_s;
    mean.input = *input;
    mean.force = dwell.force.value_or(Vector3::Zero());
    mean.temperature = dwell.temperature_c.value_or(reference_c) - reference_c;
    for (int axis = 0; axis < 3; ++axis) {
      const std::span values =
          std::span(channels[static_cast<std::size_t>(axis)]->values).subspan(begin, end - begin);
      mean.mean[axis] = mean_of(values);
      mean.white[axis] = digit_variance(values);
      white[axis] += white_variance(values);
    }
  }
  for (DwellMean& mean : means)
    mean.white += white / static_cast<double>(means.size()) / (mean.length_s * recording.rate_hz);
  return means;
}

}  // namespace imud
