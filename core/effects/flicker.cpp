#include "core/effects/flicker.hpp"

#include <algorithm>
#include <cmath>

#include "core/numbers/correlated_noise.hpp"
#include "core/numbers/dispatch.hpp"
#include "core/numbers/elementary.hpp"
#include "core/numbers/lanes.hpp"

namespace imud {
namespace {
// With the first and the last process of double variance, the Allan deviation is flat within 5 % from 3.1 times the
// first correlation time to the last one, with eight processes or more.
constexpr double flat_from = 3.1;
constexpr std::size_t min_octaves = 8;
constexpr double ln2_over_pi = 0.22063560015265482;
constexpr double nodes_at_a_low_rate = 64;  // where the first process has a sample less often than these
}  // namespace

double Flicker::variance(std::size_t index, std::size_t count) noexcept {
  return index == 0 || index + 1 == count ? 2 * ln2_over_pi : ln2_over_pi;
}

double Flicker::first_correlation_time(double from_s) noexcept { return from_s / flat_from; }

std::size_t Flicker::octaves(double from_s, double to_s) noexcept {
  std::size_t count = min_octaves;
  for (double last = first_correlation_time(from_s) * 0x1p7; last < to_s && count < max_octaves; last *= 2) ++count;
  return count;
}

Flicker::Flicker(const TriadErrors& errors, Quantity quantity, double period_s)
    : instability_(errors.bias_instability),
      quantity_(quantity),
      on_(!errors.bias_instability.isZero(0.0)),
      count_(octaves(errors.flicker_from_s, errors.flicker_to_s)),
      first_{NormalSequence(quantity, octave_of(Process::flicker, 0)),
             NormalSequence(quantity, octave_of(Process::flicker, 1)),
             NormalSequence(quantity, octave_of(Process::flicker, 2))} {
  std::uint64_t stride = 1;
  double time = first_correlation_time(errors.flicker_from_s), within = 0;
  const bool is_low_rate = period_s * nodes > time;
  const double least_nodes = is_low_rate ? nodes_at_a_low_rate : nodes;
  for (std::size_t i = 0; i < count_; ++i, time *= 2) {
    while (2.0 * static_cast<double>(stride) * period_s * least_nodes <= time) stride *= 2;
    Octave& octave = octaves_[i];
    const double step = static_cast<double>(stride) * period_s / time;
    octave.stride = stride;
    octave.transition = elementary::exp(-step);
    octave.stationary = std::sqrt(variance(i, count_));
    octave.driving = octave.stationary * std::sqrt(1.0 - octave.transition * octave.transition);
    if (is_low_rate && stride == 1) {
      const MeanOfStep mean = mean_of_step(step);
      octave.mean_of_ends = mean.ends - 0.5;
      within += variance(i, count_) * mean.within * mean.within;
    }
  }
  within_ = std::sqrt(within);
}

// Computes the process at the end of the stride that begins at node `node`.
void Flicker::advance(Octave& octave, std::size_t index, const Normals& normals, std::uint64_t node) noexcept {
  const auto number = [&](std::uint64_t k) {
    return index < first_.size()
               ? first_[index].at(normals, k)
               : normals(quantity_, octave_of(Process::flicker, static_cast<std::uint32_t>(index)), k);
  };
  octave.begin = node == 0 ? Vector3(octave.stationary * number(0)) : octave.end;
  octave.end = octave.transition * octave.begin + octave.driving * number(node + 1);
}

// Begins the stride of the first process that begins at sample `first`. The sum is linear over this stride.
void Flicker::begin_segment(const Normals& normals, std::uint64_t first) noexcept {
  for (std::size_t i = 0; i < count_; ++i)
    if (first % octaves_[i].stride == 0) advance(octaves_[i], i, normals, first / octaves_[i].stride);
  add_up(first);
}

IMUD_DISPATCHED void Flicker::add_up(std::uint64_t first) noexcept {
  Lanes begin = {}, slope = {}, beyond = {};
  for (std::size_t i = 0; i < count_; ++i) {
    const Octave& octave = octaves_[i];
    const auto within = static_cast<double>(static_cast<std::int64_t>(first % octave.stride));
    const auto stride = static_cast<double>(static_cast<std::int64_t>(octave.stride));
    const Lanes octave_begin = lanes(octave.begin), octave_end = lanes(octave.end);
    const Lanes per_sample = (octave_end - octave_begin) / stride;
    begin += octave_begin + within * per_sample;
    slope += per_sample;
    if (octave.mean_of_ends != 0) beyond += octave.mean_of_ends * (octave_begin + octave_end);
  }
  segment_begin_ = vector_of(lanes(instability_) * begin);
  slope_ = vector_of(lanes(instability_) * slope);
  mean_beyond_ = vector_of(beyond);
}

Vector3 Flicker::beyond_ends(const Normals& normals, std::uint64_t k) const noexcept {
  return instability_.cwiseProduct(mean_beyond_ + within_ * normals(quantity_, Process::flicker_within_step, k));
}

void Flicker::seek(const Normals& normals, std::uint64_t k) noexcept {
  if (!on_ || k == 0) return;
  for (std::uint64_t first = 0; first == 0 || first + 1 < k; first += octaves_[0].stride)
    begin_segment(normals, first);
}

// The step of sample k lies in the segment that ends with sample k - 1, or begins there.
void Flicker::continue_from(const Flicker& before, const Normals& normals, std::uint64_t k) noexcept {
  if (!on_ || k == 0) return;
  const std::uint64_t last = std::max<std::uint64_t>(k, 2) - 2, first = last - last % octaves_[0].stride;
  const bool has_same_segments = before.on_ && before.octaves_[0].stride == octaves_[0].stride;
  for (std::size_t i = 0; i < count_; ++i) {
    Octave& octave = octaves_[i];
    const Octave& other = before.octaves_[i];
    if (has_same_segments && i < before.count_ && other.stride == octave.stride &&
        other.transition == octave.transition) {
      octave.begin = other.begin;
      octave.end = other.end;
      continue;
    }
    const Process process = octave_of(Process::flicker, static_cast<std::uint32_t>(i));
    const std::uint64_t node = first / octave.stride;
    octave.begin = octave.stationary * normals(quantity_, process, node);
    octave.end = octave.transition * octave.begin + octave.driving * normals(quantity_, process, node + 1);
  }
  add_up(first);
}

}  // namespace imud
