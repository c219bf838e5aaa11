#include "core/numbers/duration_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace imud {

namespace {
constexpr double shortest = 1e-7;
constexpr double longest = 1e3;
constexpr unsigned buckets = 2000;
}  // namespace

DurationHistogram::DurationHistogram()
    : histogram_(boost::histogram::make_histogram_with(Storage(), Axis(buckets, shortest, longest))) {}

DurationHistogram::DurationHistogram(const DurationHistogram& other)
    : histogram_(other.histogram_), count_(other.count()), max_(other.max()) {}

DurationHistogram& DurationHistogram::operator=(const DurationHistogram& other) {
  histogram_ = other.histogram_;
  count_.store(other.count(), std::memory_order_relaxed);
  max_.store(other.max(), std::memory_order_relaxed);
  return *this;
}

void DurationHistogram::add(double seconds) noexcept {
  histogram_(seconds);
  count_.store(count() + 1, std::memory_order_relaxed);
  if (seconds > max()) max_.store(seconds, std::memory_order_relaxed);
}

DurationHistogram DurationHistogram::since(const DurationHistogram& before) const {
  DurationHistogram rest(*this);
  std::uint64_t count = 0;
  double highest = 0;
  for (auto&& bucket : boost::histogram::indexed(rest.histogram_, boost::histogram::coverage::all)) {
    const std::uint64_t n = *bucket - before.histogram_.at(bucket.index());
    rest.histogram_.at(bucket.index()) = n;
    count += n;
    if (n > 0 && bucket.index() >= 0) highest = bucket.bin().upper();
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
  for (auto&& bucket : boost::histogram::indexed(histogram_, boost::histogram::coverage::all)) {
    const double inside = static_cast<double>(std::uint64_t{*bucket});
    cumulative += inside;
    if (cumulative < rank || cumulative == 0) continue;
    if (bucket.index() < 0) return 0;
    const double lower = bucket.bin().lower(), upper = std::min(bucket.bin().upper(), max());
    if (lower >= longest || upper <= lower) break;
    // The durations of a bucket are taken as spread evenly over its logarithm: each in the middle of its own part.
    const double share = std::max(rank - (cumulative - inside) - 0.5, 0.5) / inside;
    return lower * std::pow(upper / lower, share);
  }
  return max();
}

std::vector<std::uint64_t> DurationHistogram::counts_up_to(std::span<const double> limits) const {
  const Axis& axis = histogram_.axis();
  const double half_bucket = std::pow(longest / shortest, 0.5 / buckets);
  std::vector<std::uint64_t> counts;
  std::uint64_t cumulative = 0;
  int next = -1;  // the bucket of durations below the shortest
  for (const double limit : limits) {
    const int end = std::isinf(limit) ? axis.size() + 1 : axis.index(limit * half_bucket);
    for (; next < end; ++next) cumulative += std::uint64_t{histogram_.at(next)};
    counts.push_back(cumulative);
  }
  return counts;
}

double DurationHistogram::sum() const {
  const Axis& axis = histogram_.axis();
  double sum = 0;
  for (int i = 0; i <= axis.size(); ++i)
    if (const std::uint64_t n = histogram_.at(i); n > 0)
      sum += static_cast<double>(n) * (i < axis.size() ? axis.bin(i).center() : longest);
  return sum;
}

}  // namespace imud
