#include "core/numbers/duration_histogram.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace imud {
namespace {
constexpr double shortest = 1e-7;
constexpr double longest = 1e3;

// A bucket has all numbers with the same exponent and the same first six bits of the fraction.
constexpr int dropped_bits = 52 - 6;
constexpr std::uint64_t number_of(double seconds) noexcept {
  return std::bit_cast<std::uint64_t>(seconds) >> dropped_bits;
}
constexpr double lower(int index) noexcept {
  return std::bit_cast<double>((number_of(shortest) + static_cast<std::uint64_t>(index)) << dropped_bits);
}
constexpr double upper(int index) noexcept { return lower(index + 1); }
constexpr int buckets = static_cast<int>(number_of(longest) - number_of(shortest));
static_assert(lower(buckets) == longest);

// Returns -1 for durations below the buckets, `buckets` for durations above.
int index_of(double seconds) noexcept {
  if (!(seconds >= shortest)) return -1;
  return seconds < longest ? static_cast<int>(number_of(seconds) - number_of(shortest)) : buckets;
}
}  // namespace

// The buckets, and one on each side.
DurationHistogram::DurationHistogram() : cells_(buckets + 2) {}

DurationHistogram::DurationHistogram(const DurationHistogram& other) : DurationHistogram() { *this = other; }

DurationHistogram& DurationHistogram::operator=(const DurationHistogram& other) {
  for (int i = -1; i <= buckets; ++i) cell(i).store(other.count_of(i), std::memory_order_relaxed);
  count_.store(other.count(), std::memory_order_relaxed);
  sum_.store(other.sum(), std::memory_order_relaxed);
  max_.store(other.max(), std::memory_order_relaxed);
  return *this;
}

void DurationHistogram::add(double seconds) noexcept {
  const int index = index_of(seconds);
  cell(index).store(count_of(index) + 1, std::memory_order_relaxed);
  count_.store(count() + 1, std::memory_order_relaxed);
  sum_.store(sum() + seconds, std::memory_order_relaxed);
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
    if (n > 0 && i >= 0) highest = upper(i);
  }
  rest.count_ = count;
  rest.sum_ = sum() - before.sum();
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
    const double begin = lower(i), end = std::min(upper(i), max());
    if (begin >= longest || end <= begin) break;
    // The durations of a bucket are taken as spread evenly over its logarithm: each in the middle of its own part.
    const double share = std::max(rank - (cumulative - inside) - 0.5, 0.5) / inside;
    return begin * std::pow(end / begin, share);
  }
  return max();
}

std::vector<std::uint64_t> DurationHistogram::counts_up_to(std::span<const double> limits) const {
  std::vector<std::uint64_t> counts;
  std::uint64_t cumulative = 0;
  int next = -1;  // the bucket of durations below the shortest
  for (const double limit : limits) {
    int end = std::isinf(limit) ? buckets + 1 : index_of(limit);
    if (0 <= end && end < buckets && upper(end) - limit < limit - lower(end)) ++end;
    for (; next < end; ++next) cumulative += count_of(next);
    counts.push_back(cumulative);
  }
  return counts;
}

}  // namespace imud
