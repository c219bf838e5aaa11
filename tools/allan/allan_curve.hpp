// AllanCurve: the deviation of a recording at several averaging times, with its bounds.
#pragma once

#include <cstddef>
#include <vector>

#include "tools/allan/allan_confidence.hpp"
#include "tools/allan/allan_deviation.hpp"
#include "tools/allan/allan_term_list.hpp"
#include "tools/allan/sample_store.hpp"

namespace imud {

struct AllanCurve {
  struct Point {
    std::size_t factor = 0;  // samples
    double tau_s = 0;        // factor/rate
    double deviation = 0;    // in the unit of the rates
    int noise = 0;           // exponent of the density, see identify_noise()
    double degrees = 0;      // of freedom
    DeviationBounds bounds;
  };

  AllanKind kind = AllanKind::overlapping;
  double period_s = 0;       // of a sample
  double record_length = 0;  // s
  std::size_t samples = 0;
  std::vector<Point> points;  // in the order of tau

  AveragingTime time(const Point& point) const noexcept { return {point.factor, point.tau_s, record_length}; }
};

// Returns the largest averaging factor of a curve: a third of the record for the Allan and modified deviations, a
// quarter for the Hadamard and half for the total deviation. Longer averaging times have next to no degrees of
// freedom. 0: there are too few samples.
std::size_t largest_curve_factor(AllanKind kind, std::size_t samples) noexcept;

// Computes the curve of equally spaced rates. Requires at least 4 rates, all finite. per_decade: see
// averaging_factors(). The phase overwrites the rates, in memory or in a temporary file. Where the noise type
// cannot be identified, the type of the previous averaging time is taken; at the first averaging time, white
// noise.
AllanCurve allan_curve(AllanKind kind, SampleStore rates, double rate_hz, unsigned per_decade, double confidence);

}  // namespace imud
