// DurationHistogram: percentiles of any number of durations in constant memory.
#pragma once

#include <atomic>
#include <boost/histogram.hpp>
#include <cstdint>
#include <tuple>

namespace imud {

// Counts durations from 100 ns to 1000 s in buckets 2.3 % wide. Shorter ones count as 0, longer ones as the maximum,
// which is kept exactly. One thread may add() without a lock while others copy the histogram; they must query the
// copy. Only construction and copying allocate.
class DurationHistogram {
 public:
  DurationHistogram();
  DurationHistogram(const DurationHistogram& other);
  DurationHistogram& operator=(const DurationHistogram& other);

  // Counts one duration, s, not negative.
  void add(double seconds) noexcept;

  // Returns the histogram of what was added since `before`, an earlier copy of this one. Its maximum is exact if it
  // is the maximum of all, otherwise rounded up to the end of its bucket.
  DurationHistogram since(const DurationHistogram& before) const;

  // The number of durations.
  std::uint64_t count() const noexcept { return count_.load(std::memory_order_relaxed); }
  // The longest duration, s; 0 if there is none.
  double max() const noexcept { return max_.load(std::memory_order_relaxed); }
  // Returns the duration, s, that `percent` of them, in [0, 100], do not exceed, within half a bucket; 0 if there is
  // none.
  double percentile(double percent) const;

 private:
  using Axis = boost::histogram::axis::regular<double, boost::histogram::axis::transform::log>;
  using Storage = boost::histogram::dense_storage<boost::histogram::accumulators::thread_safe<std::uint64_t>>;
  boost::histogram::histogram<std::tuple<Axis>, Storage> histogram_;
  std::atomic<std::uint64_t> count_ = 0;
  std::atomic<double> max_ = 0;
};

}  // namespace imud
