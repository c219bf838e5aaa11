// SensorFilter: the low-pass filter between a sensor and its output, as numbers. bandwidth.hpp applies it.
#pragma once

#include <span>

#include "core/vector.hpp"

namespace imud {

// At most one kind: a Butterworth filter, or boxcars in cascade. The default is none.
//
// The Butterworth filter is the bilinear transform of H(s) = 1/(1 + k s + s^2), or of two such sections (order 4), or
// of 1/(1 + s) (order 1); s = j tan(pi f/rate)/tan(pi f_c/rate), so that its gain at the cut-off f_c is 1/sqrt(2) at
// any rate. (A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 3rd ed., 7.3.)
//
// One boxcar is the mean of the newest `length` samples; `stages` of them in cascade are a CIC of that order, whose
// decimation is done by whoever takes the output (E. B. Hogenauer, IEEE Trans. ASSP 29(2), 1981):
//   H(z) = ((1 - z^-R)/(R (1 - z^-1)))^N, R = length, N = stages
struct SensorFilter {
  static constexpr int max_stages = 8, max_length = 4096;

  Vector3 cut_off_hz = Vector3::Zero();  // per axis, below half of the sample rate; 0: none
  int order = 2;                         // 1, 2 or 4
  // k of order 2, above 0; 0: sqrt(2), the Butterworth filter. The gain at the cut-off is 1/k: below sqrt(2) there is
  // a peak, of 1/(k sqrt(1 - k^2/4)).
  double damping = 0;
  int length = 1;  // samples; 1: none
  int stages = 1;

  bool is_on() const noexcept { return length > 1 || !cut_off_hz.isZero(0.0); }
  bool operator==(const SensorFilter&) const = default;
};

// Returns the group delay of axis 0 to 2 at frequency 0, s: the delay of a slow motion. `rate_hz`: the rate at
// which the filter runs.
double group_delay_s(const SensorFilter& filter, int axis, double rate_hz);
// Returns the group delay at frequency 0, s, of a filter of taps h(i), whose sum is not 0. In samples it is the sum
// of i h(i) over the sum of h(i).
double group_delay_s(std::span<const double> taps, double rate_hz);

// The filters that a product has set in itself.
struct SensorFilters {
  SensorFilter gyro, accelerometer, magnetometer, inclinometer = {};
  bool operator==(const SensorFilters&) const = default;
};

namespace detail {
// The damping k of each section; `count` is 0 for order 1.
struct Sections {
  int count;
  double damping[2];
};
constexpr Sections sections(const SensorFilter& filter) noexcept {
  if (filter.order == 1) return {0, {}};
  if (filter.order == 2) return {1, {filter.damping > 0 ? filter.damping : 1.4142135623730951}};  // 2 cos(pi/4)
  return {2, {1.8477590650225735, 0.76536686473017954}};  // 2 cos(pi/8), 2 cos(3 pi/8)
}
// Returns tan(pi cut_off/rate).
double prewarped(double cut_off_hz, double rate_hz) noexcept;
}  // namespace detail

}  // namespace imud
