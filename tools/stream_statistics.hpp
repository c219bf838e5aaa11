// StreamStatistics: what a stream of measurements was like in time: rate, jitter, gaps. Bounded memory, any length.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/duration_histogram.hpp"
#include "core/time.hpp"
#include "protocols/protocol.hpp"

namespace imud {

class StreamStatistics {
 public:
  // A count of steps, and the time that they took.
  struct Rate {
    std::uint64_t steps = 0;
    Nanoseconds time{};
    std::optional<double> hz() const;
  };

  // `protocol` says how wide its counter is, when its time begins anew, and how fine it is.
  explicit StreamStatistics(const Protocol& protocol);

  // `arrival` is empty where it says nothing: regular files, and what had been waiting before the first look.
  void add(const Measurement& measurement, std::optional<HostTime> arrival);
  // No more will come. What follows is complete only after this.
  void finish();

  std::uint64_t samples() const noexcept { return samples_; }
  // From one sample to the next by the device's time stamps; without the steps where these jumped or went back.
  const Rate& device() const noexcept { return device_; }
  const Rate& arrival() const noexcept { return arrival_; }
  // How far arrivals are from the straight line that fits those of a window best: least squares over arrival against
  // device time, or against the sample's number if there is none fine enough. A window is 4096 to 8192 samples long,
  // so that clocks that drift apart do not count.
  const DurationHistogram& jitter() const noexcept { return jitter_; }

  // Steps over missing samples, and how many are missing: by the counter, whose turns are told by the device time; by
  // the device time alone if there is no counter.
  std::uint64_t gaps() const noexcept { return gaps_; }
  std::uint64_t missing() const noexcept { return missing_; }
  bool can_see_gaps() const noexcept { return can_see_gaps_; }
  // Steps of the device time that are off by more than half the median step of the window, missing samples allowed
  // for.
  std::uint64_t time_jumps() const noexcept { return time_jumps_; }
  // Samples whose counter (without one, whose time) is that of the sample before.
  std::uint64_t repeated() const noexcept { return repeated_; }
  // Samples whose counter or time is before that of the sample before: a restart of the device, or disorder.
  std::uint64_t back() const noexcept { return back_; }

 private:
  struct Entry {
    std::uint32_t fields = 0;   // time, counter, or both
    std::int64_t time_ns = 0;   // turns of the protocol's time added
    std::uint64_t counter = 0;  // its low counter_bits
    std::uint64_t number = 0;   // of the sample, missing ones counted
    std::optional<std::int64_t> arrival_ns;
    bool starts_line = false;  // no line leads from the sample before to this one
  };

  bool carried(Measurement::Field field, const Entry& a, const Entry& b) const noexcept {
    return (a.fields & b.fields & field) != 0;
  }
  void unwrap(Entry& entry, const Entry& before) const noexcept;
  bool goes_back(const Entry& entry, const Entry& before) const noexcept;
  void settle();
  double median_step() const;
  double median_counter_step() const;
  void judge(Entry& entry, const Entry& before, double period_ns);
  double x(const Entry& entry, bool by_time) const noexcept;
  void fit(std::size_t begin, std::size_t end, bool by_time);

  const std::uint64_t counter_mask_;
  const bool counts_unsent_;  // samples, too
  double counter_step_ = 1;   // from one that is sent to the next: the median
  const std::int64_t time_period_ns_;
  const double time_resolution_ns_;

  std::vector<Entry> window_;  // judged ones, then those that are not
  std::size_t judged_ = 0;

  std::uint64_t samples_ = 0;
  Rate device_;
  Rate arrival_;
  DurationHistogram jitter_;
  std::uint64_t gaps_ = 0;
  std::uint64_t missing_ = 0;
  std::uint64_t time_jumps_ = 0;
  std::uint64_t repeated_ = 0;
  std::uint64_t back_ = 0;
  bool can_see_gaps_ = false;
};

}  // namespace imud
