#include "core/duration_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace imud {

namespace {
constexpr double shortest = 1e-7;
constexpr double longest = 1e3;
constexpr unsigned buckets = 1000;
}  // namespace

DurationHistogram::DurationHistogram()
    : histogram_(boost::histogram::make_histogram_with(Storage(), Axis(buckets, shortest, longest))) {}

void DurationHistogram::add(double seconds) {
  histogram_(seconds);
  ++count_;
  max_ = std::max(max_, seconds);
}

double DurationHistogram::percentile(double percent) const {
  const double rank = percent / 100.0 * static_cast<double>(count_);
  double reached = 0;
  for (auto&& bucket : boost::histogram::indexed(histogram_, boost::histogram::coverage::all)) {
    reached += static_cast<double>(*bucket);
    if (reached < rank || reached == 0) continue;
    if (bucket.index() < 0) return 0;
    return std::min(max_, std::sqrt(bucket.bin().lower() * bucket.bin().upper()));
  }
  return max_;
}

}  // namespace imud
