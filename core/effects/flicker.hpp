#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// Bias instability: flicker noise, of the two-sided spectral density B^2/(2 pi f) (IEEE Std 952-1997, C.1.2), whose
// Allan deviation is flat at sqrt(2 ln2/pi) B = 0.664 B.
//
// It is the sum of independent exponentially correlated processes, whose correlation times are an octave apart: as
// many as make the Allan deviation flat within 5 % from `flicker_from_s` to `flicker_to_s`. Each has the variance
// B^2 ln2/pi, because the density of such a sum is then B^2/(2 pi f); the first and the last have twice this
// variance, because they stand for the octaves beyond them, too. The processes are stationary from the first sample.
//
// A process of correlation time Tc is computed at most every Tc/16, and linear between: its standard deviation is
// 1 % less there. Thus a sample costs little more than one addition, with any number of octaves. At averaging times
// below two thirds of the first Tc the Allan deviation is more than 2 % smaller than the one of the processes. Where
// the sensor samples the first process less often than every Tc/16, a process is computed every Tc/64, or for each
// sample, of which the mean over the step is exact then (MeanOfStep): the deviation is right down to one sample.
class Flicker {
 public:
  static constexpr std::string_view name = "bias instability";
  static constexpr EffectTraits traits = {};
  static constexpr std::size_t max_octaves = 32;
  static constexpr double nodes = 16;  // the least number of nodes of a process in its correlation time
  Flicker(const TriadErrors& errors, Quantity quantity, double period_s);
  bool is_on() const noexcept { return on_; }
  // The step of a sample lies within one segment: a segment has `stride` samples after the one at its begin.
  void apply(TriadStep& step) noexcept {
    const std::uint64_t before = std::max<std::uint64_t>(step.k, 1) - 1, within = before % octaves_[0].stride;
    if (step.k == 0 || (within == 0 && before > 0)) begin_segment(step.normals, before);
    const auto samples = static_cast<double>(static_cast<std::int64_t>(step.k == 0 ? 0 : within + 1));
    const Lanes slope = lanes(slope_), now = lanes(segment_begin_) + samples * slope;
    Lanes mean = now - 0.5 * slope;
    if (within_ > 0 && step.k > 0) mean += lanes(beyond_ends(step.normals, step.k));
    step.error += now;
    step.mean_error += mean;
  }
  // The run time is proportional to k.
  void seek(const Normals& normals, std::uint64_t k) noexcept;
  void power_on(std::uint64_t) noexcept {}
  // Each process goes on if it has the same correlation time and stride; otherwise it restarts, stationary.
  void continue_from(const Flicker& before, const Normals& normals, std::uint64_t k) noexcept;

  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    for (std::size_t i = 0; i < first_.size(); ++i) visit(first_[i], octaves_[i].stride);
  }

  // Returns the number of processes that the averaging times need, and the correlation time of the first, s.
  static std::size_t octaves(double from_s, double to_s) noexcept;
  static double first_correlation_time(double from_s) noexcept;
  // Returns the variance of process `index` of so many, for B = 1.
  static double variance(std::size_t index, std::size_t count) noexcept;

 private:
  // Returns the mean over the step of sample k beyond the mean of its ends.
  Vector3 beyond_ends(const Normals& normals, std::uint64_t k) const noexcept;
  // One process. Its values at the samples j * stride and (j + 1) * stride are `begin` and `end`.
  struct Octave {
    double transition = 0, driving = 0, stationary = 0;  // for B = 1
    std::uint64_t stride = 1;
    double mean_of_ends = 0;  // of their sum, beyond one half; 0 where the process is linear
    Vector3 begin = Vector3::Zero(), end = Vector3::Zero();
  };
  void advance(Octave& octave, std::size_t index, const Normals& normals, std::uint64_t node) noexcept;
  void begin_segment(const Normals& normals, std::uint64_t first) noexcept;
  void add_up(std::uint64_t first) noexcept;

  Vector3 instability_;
  Quantity quantity_;
  bool on_;
  std::size_t count_;
  std::array<Octave, max_octaves> octaves_;
  std::array<NormalSequence, 3> first_;  // of the first processes, which take most numbers
  Vector3 segment_begin_ = Vector3::Zero(), slope_ = Vector3::Zero();  // of the sum, from sample to sample
  // Where samples are further apart than Tc/16 of the first process: the difference of the mean over a step
  // from the mean of its ends, for B = 1. `mean_beyond_` is its expected value, `within_` its standard deviation.
  Vector3 mean_beyond_ = Vector3::Zero();
  double within_ = 0;
};

}  // namespace imud
