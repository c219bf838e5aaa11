// DurationHistogram: percentiles of durations, in bounded memory however many there are.
#pragma once

#include <boost/histogram.hpp>
#include <cstdint>
#include <tuple>

namespace imud {

// Durations from 100 ns to 1000 s in buckets 2.3 % wide; shorter ones count as 0, the longest is kept exactly.
class DurationHistogram {
 public:
  DurationHistogram();

  void add(double seconds);  // not negative

  std::uint64_t count() const noexcept { return count_; }
  double max() const noexcept { return max_; }  // s; 0 if there is none
  // The duration, s, that `percent` of them do not exceed, within half a bucket; 0 if there is none.
  double percentile(double percent) const;

 private:
  using Axis = boost::histogram::axis::regular<double, boost::histogram::axis::transform::log>;
  using Storage = boost::histogram::dense_storage<std::uint64_t>;
  boost::histogram::histogram<std::tuple<Axis>, Storage> histogram_;
  std::uint64_t count_ = 0;
  double max_ = 0;
};

}  // namespace imud
