// StreamStatistics: rate, jitter and gaps of a stream of measurements of any length, in bounded memory.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/numbers/duration_histogram.hpp"
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

  // `protocol` gives the width of the counter, and period and resolution of the time.
  explicit StreamStatistics(const Protocol& protocol);

  // `arrival` is empty where the time of arrival has no meaning: for regular files, and for samples that the port
  // held before the first receive().
  void add(const Measurement& measurement, std::optional<HostTime> arrival);
  // Ends the stream. The figures below are complete only after this.
  void finish();

  std::uint64_t samples() const noexcept { return samples_; }
  // The steps from sample to sample by the device's time stamps, without steps at which the
  // stamps jumped or went back.
  const Rate& device() const noexcept { return device_; }
  const Rate& arrival() const noexcept { return arrival_; }
  // Whether any sample had a time of the device or of arrival. Rates need one in two adjacent samples.
  bool has_time() const noexcept { return has_time_; }
  // The distances in s of the arrivals from a straight line: the least-squares fit, over a window, of arrival over
  // device time, or over the sample's number if the time is absent or too coarse. A window has 4096 to 8192 samples,
  // so that the drift of the clocks does not count as jitter.
  const DurationHistogram& jitter() const noexcept { return jitter_; }

  // The number of gaps, and the number of samples missing in them. Gaps are found by the counter, together with
  // the device time, which shows overflows of the counter; without a counter, by the device time alone.
  std::uint64_t gaps() const noexcept { return gaps_; }
  std::uint64_t missing() const noexcept { return missing_; }
  bool can_detect_gaps() const noexcept { return can_detect_gaps_; }
  // Steps of the device time that differ from the expected ones by more than half the median step of the window,
  // after missing samples are accounted for.
  std::uint64_t time_jumps() const noexcept { return time_jumps_; }
  // The number of samples whose counter, or without a counter whose time, equals the value in the previous sample.
  std::uint64_t repeated() const noexcept { return repeated_; }
  // Samples whose counter or time goes back: a restart of the device, or reordering.
  std::uint64_t back() const noexcept { return back_; }

 private:
  struct Entry {
    std::uint32_t fields = 0;   // time, counter, or both
    std::int64_t time_ns = 0;   // unwrapped
    std::uint64_t counter = 0;  // the low counter_bits bits
    std::uint64_t number = 0;   // of the sample, with missing samples counted
    std::optional<std::int64_t> arrival_ns;
    bool starts_line = false;  // the sample before belongs to another line
  };

  bool carried(Measurement::Field field, const Entry& a, const Entry& b) const noexcept {
    return (a.fields & b.fields & field) != 0;
  }
  void unwrap(Entry& entry, const Entry& before) const noexcept;
  bool goes_back(const Entry& entry, const Entry& before) const noexcept;
  void evaluate_window();
  double median_step() const;
  double median_counter_step() const;
  void evaluate(Entry& entry, const Entry& before, double period_ns);
  double x(const Entry& entry, bool by_time) const noexcept;
  void fit(std::size_t begin, std::size_t end, bool by_time);

  const std::uint64_t counter_mask_;
  const bool counts_unsent_;  // the counter also counts samples that are not sent
  double counter_step_ = 1;   // median step from one sent sample to the next
  const std::int64_t time_period_ns_;
  const double time_resolution_ns_;

  std::vector<Entry> window_;  // evaluated entries, then entries not yet evaluated
  std::size_t evaluated_ = 0;

  std::uint64_t samples_ = 0;
  Rate device_;
  Rate arrival_;
  bool has_time_ = false;
  DurationHistogram jitter_;
  std::uint64_t gaps_ = 0;
  std::uint64_t missing_ = 0;
  std::uint64_t time_jumps_ = 0;
  std::uint64_t repeated_ = 0;
  std::uint64_t back_ = 0;
  bool can_detect_gaps_ = false;
};

}  // namespace imud
