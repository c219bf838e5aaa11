#include "core/numbers/duration_histogram.hpp"

#include <algorithm>
#include <boost/histogram/axis/regular.hpp>
#include <cmath>

namespace imud {
namespace {
using Axis = boost::histogram::axis::regular<double, boost::histogram::axis::transform::log>;

constexpr double shortest = 1e-7;
constexpr double longest = 1e3;
constexpr int buckets = 2000;
const Axis axis(buckets, shortest, longest);
}  // namespace

// The buckets of the axis, and one on each side.
DurationHistogram::DurationHistogram() : cells_(buckets + 2) {}

DurationHistogram::DurationHistogram(const DurationHistogram& other) : DurationHistogram() { *this = other; }

DurationHistogram& DurationHistogram::operator=(const DurationHistogram& other) {
  for (int i = -1; i <= buckets; ++i) cell(i).store(other.count_of(i), std::memory_order_relaxed);
  count_.store(other.count(), std::memory_order_relaxed);
  max_.store(other.max(), std::memory_order_relaxed);
  return *this;
}

void DurationHistogram::add(double seconds) noexcept {
  const int index = axis.index(seconds);
  cell(index).store(count_of(index) + 1, std::memory_order_relaxed);
  count_.store(count() + 1, std::memory_order_relaxed);
  if (seconds > max()) max_.store(seconds, std::memory_order_relaxed);
}

DurationHistogram DurationHistogram::since(const DurationHistogram& before) const {
  DurationHistogram rest(*this);
  std::uint64_t count = 0;
  double highest = 0;
  for (int i = -1; i <= buckets; ++i) {
    const std::uint64_t n = count_of(i) - before.count_of(i);
    rest.cell(i) = n;
    count += n;
    if (n > 0 && i >= 0) highest = axis.bin(i).upper();
  }
  rest.count_ = count;
  rest.max_ = max() > before.max() ? max() : std::min(highest, max());
  return rest;
}

double DurationHistogram::percentile(double percent) const {
  // Multiplied before it is divided, so that whole ranks are exact.
  const double rank = percent * static_cast<double>(count()) / 100.0;
  if (rank > static_cast<double>(count()) - 0.5) return max();
  double cumulative = 0;
  for (int i = -1; i <= buckets; ++i) {
    const double inside = static_cast<double>(count_of(i));
    cumulative += inside;
    if (cumulative < rank || cumulative == 0) continue;
    if (i < 0) return 0;
    const double lower = axis.bin(i).lower(), upper = std::min(axis.bin(i).upper(), max());
    if (lower >= longest || upper <= lower) break;
    // The durations of a bucket are taken as spread evenly over its logarithm: each in the middle of its own part.
    const double share = std::max(rank - (cumulative - inside) - 0.5, 0.5) / inside;
    return lower * std::pow(upper / lower, share);
  }
  return max();
}

std::vector<std::uint64_t> DurationHistogram::counts_up_to(std::span<const double> limits) const {
  const double half_bucket = std::pow(longest / shortest, 0.5 / buckets);
  std::vector<std::uint64_t> counts;
  std::uint64_t cumulative = 0;
  int next = -1;  // the bucket of durations below the shortest
  for (const double limit : limits) {
    const int end = std::isinf(limit) ? buckets + 1 : axis.index(limit * half_bucket);
    for (; next < end; ++next) cumulative += count_of(next);
    counts.push_back(cumulative);
  }
  return counts;
}

double DurationHistogram::sum() const {
  double sum = 0;
  for (int i = 0; i <= buckets; ++i)
    if (const std::uint64_t n = count_of(i); n > 0)
      sum += static_cast<double>(n) * (i < buckets ? axis.bin(i).center() : longest);
  return sum;
}

}  // namespace imud
