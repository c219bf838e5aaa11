// DurationHistogram: percentiles of durations, in bounded memory however many there are.
#pragma once

#include <atomic>
#include <boost/histogram.hpp>
#include <cstdint>
#include <tuple>

namespace imud {

// Durations from 100 ns to 1000 s in buckets 2.3 % wide; shorter ones count as 0, the longest is kept exactly. One
// thread adds, without a lock; any may copy it meanwhile and look at the copy.
class DurationHistogram {
 public:
  DurationHistogram();
  DurationHistogram(const DurationHistogram& other);
  DurationHistogram& operator=(const DurationHistogram& other);

  void add(double seconds) noexcept;  // not negative

  // What was added since `before`, an earlier copy of the same one. Its longest is then known to a bucket only,
  // unless it is the longest of all.
  DurationHistogram since(const DurationHistogram& before) const;

  std::uint64_t count() const noexcept { return count_.load(std::memory_order_relaxed); }
  double max() const noexcept { return max_.load(std::memory_order_relaxed); }  // s; 0 if there is none
  // The duration, s, that `percent` of them do not exceed, within half a bucket; 0 if there is none.
  double percentile(double percent) const;

 private:
  using Axis = boost::histogram::axis::regular<double, boost::histogram::axis::transform::log>;
  using Storage = boost::histogram::dense_storage<boost::histogram::accumulators::thread_safe<std::uint64_t>>;
  boost::histogram::histogram<std::tuple<Axis>, Storage> histogram_;
  std::atomic<std::uint64_t> count_ = 0;
  std::atomic<double> max_ = 0;
};

}  // namespace imud
