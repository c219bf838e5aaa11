// DurationHistogram: percentiles of any number of durations in constant memory.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace imud {

// Counts durations from 100 ns to 1000 s in 64 buckets to an octave. Shorter ones count as 0, longer ones as the
// maximum, which is kept exactly. While one thread adds, others may copy the histogram without a lock; they must
// query only the copy. Only construction and copying allocate.
class DurationHistogram {
 public:
  DurationHistogram();
  DurationHistogram(const DurationHistogram& other);
  DurationHistogram& operator=(const DurationHistogram& other);

  // Counts one duration, s, not negative.
  void add(double seconds) noexcept;

  // Returns the histogram of the durations added since `before`, an earlier copy of this one. Its maximum is exact
  // if it is the maximum of all, otherwise rounded up to the end of its bucket.
  DurationHistogram since(const DurationHistogram& before) const;

  // The number of durations.
  std::uint64_t count() const noexcept { return count_.load(std::memory_order_relaxed); }
  // The longest duration, s; 0 if there is none.
  double max() const noexcept { return max_.load(std::memory_order_relaxed); }
  // Returns the duration, s, that `percent` of all durations do not exceed, interpolated within its bucket; 0 if
  // there is none. `percent` is in [0, 100].
  double percentile(double percent) const;
  // Returns for each of `limits`, s, ascending, the number of durations that do not exceed it, within half a bucket.
  // For infinity it is the number of all durations.
  std::vector<std::uint64_t> counts_up_to(std::span<const double> limits) const;
  // The sum of all durations, s.
  double sum() const noexcept { return sum_.load(std::memory_order_relaxed); }

 private:
  // Returns the number of durations in a bucket. Bucket -1 has the durations below the first bucket; the bucket whose
  // number is the number of buckets has the durations above the last.
  std::atomic<std::uint64_t>& cell(int index) noexcept { return cells_[static_cast<std::size_t>(index + 1)]; }
  std::uint64_t count_of(int index) const noexcept {
    return cells_[static_cast<std::size_t>(index + 1)].load(std::memory_order_relaxed);
  }

  std::vector<std::atomic<std::uint64_t>> cells_;
  std::atomic<std::uint64_t> count_ = 0;
  std::atomic<double> sum_ = 0;
  std::atomic<double> max_ = 0;
};

}  // namespace imud
