#include "tools/stream_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "protocols/wire/bits.hpp"

namespace imud {
namespace {

constexpr std::size_t half_window = 4096;
constexpr std::size_t shortest_line = 8;  // points; a fit through fewer is meaningless

// A narrower counter overflows so often that a step of half its range does not indicate a restart.
constexpr std::uint64_t wide_counter = 0xFFFF;

// The largest relative difference of two clocks' rates at which missing samples are still counted correctly and
// are not mistaken for a jump.
constexpr double clock_tolerance = 1e-3;

// Returns the upper median of at least one number.
template <class Number>
double median(std::vector<Number> numbers) {
  const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
  std::nth_element(numbers.begin(), middle, numbers.end());
  return static_cast<double>(*middle);
}

}  // namespace

std::optional<double> StreamStatistics::Rate::hz() const {
  if (steps == 0 || time <= Nanoseconds{}) return std::nullopt;
  return static_cast<double>(steps) / seconds(time);
}

StreamStatistics::StreamStatistics(const Protocol& protocol)
    : counter_mask_(low_bits(protocol.counter_bits)),
      counts_unsent_(protocol.sends_some_samples),
      time_period_ns_(protocol.time_period_ns),
      time_resolution_ns_(protocol.resolution.time_s * 1e9) {
  window_.reserve(2 * half_window);
}

void StreamStatistics::add(const Measurement& measurement, std::optional<HostTime> arrival) {
  ++samples_;
  Entry entry;
  entry.fields = measurement.fields & (Measurement::time | (counter_mask_ != 0 ? Measurement::counter : 0U));
  entry.time_ns = measurement.sample.time.ns;
  entry.counter = measurement.sample.counter & counter_mask_;
  if (arrival) entry.arrival_ns = arrival->ns;
  has_time_ = has_time_ || arrival || (entry.fields & Measurement::time) != 0;

  if (!window_.empty()) {
    const Entry& before = window_.back();
    if (entry.arrival_ns && before.arrival_ns) {
      ++arrival_.steps;
      arrival_.time += Nanoseconds(*entry.arrival_ns - *before.arrival_ns);
    }
    unwrap(entry, before);
    if (goes_back(entry, before)) {
      ++back_;
      evaluate_window();
      window_.clear();
      evaluated_ = 0;
    }
  }
  if (window_.size() == 2 * half_window) {
    evaluate_window();
    window_.erase(window_.begin(), window_.begin() + half_window);
    evaluated_ = window_.size();
  }
  window_.push_back(entry);
}

void StreamStatistics::finish() {
  evaluate_window();
  evaluated_ = window_.size();
}

// Unwraps the entry's time: of the times that agree with the time on the wire, the one nearest to the sample before.
void StreamStatistics::unwrap(Entry& entry, const Entry& before) const noexcept {
  if (time_period_ns_ <= 0 || !carried(Measurement::time, entry, before)) return;
  std::int64_t step = (entry.time_ns - before.time_ns) % time_period_ns_;
  if (step < -time_period_ns_ / 2) step += time_period_ns_;
  if (step >= time_period_ns_ / 2) step -= time_period_ns_;
  entry.time_ns = before.time_ns + step;
}

bool StreamStatistics::goes_back(const Entry& entry, const Entry& before) const noexcept {
  if (carried(Measurement::time, entry, before) && entry.time_ns < before.time_ns) return true;
  const std::uint64_t step = (entry.counter - before.counter) & counter_mask_;
  return carried(Measurement::counter, entry, before) && counter_mask_ >= wide_counter && step > counter_mask_ / 2;
}

void StreamStatistics::evaluate_window() {
  const double period_ns = median_step();
  if (counts_unsent_) counter_step_ = median_counter_step();
  for (std::size_t i = std::max<std::size_t>(evaluated_, 1); i < window_.size(); ++i)
    evaluate(window_[i], window_[i - 1], period_ns);
  for (std::size_t begin = 0; begin < window_.size();) {
    std::size_t end = begin + 1;
    while (end < window_.size() && !window_[end].starts_line) ++end;
    fit(begin, end, period_ns > 0);
    begin = end;
  }
}

// Returns the step in ns; 0 if the device's time stamps are absent, or too coarse to distinguish two samples.
double StreamStatistics::median_step() const {
  std::vector<std::int64_t> steps;
  steps.reserve(window_.size());
  for (std::size_t i = 1; i < window_.size(); ++i)
    if (carried(Measurement::time, window_[i], window_[i - 1]) && window_[i].time_ns != window_[i - 1].time_ns)
      steps.push_back(window_[i].time_ns - window_[i - 1].time_ns);
  if (steps.empty()) return 0;
  const double step = median(std::move(steps));
  return step > 2 * time_resolution_ns_ ? step : 0;
}

double StreamStatistics::median_counter_step() const {
  std::vector<std::uint64_t> steps;
  for (std::size_t i = 1; i < window_.size(); ++i)
    if (carried(Measurement::counter, window_[i], window_[i - 1]))
      steps.push_back((window_[i].counter - window_[i - 1].counter) & counter_mask_);
  return steps.empty() ? 1 : std::max(1.0, median(std::move(steps)));
}

void StreamStatistics::evaluate(Entry& entry, const Entry& before, double period_ns) {
  const bool has_counter = carried(Measurement::counter, entry, before);
  const bool has_time = carried(Measurement::time, entry, before);
  const double step_ns = has_time ? static_cast<double>(entry.time_ns - before.time_ns) : 0;
  // A shortcut for the usual case, the next sample a period later: the rest of the function would give the same
  // result.
  if (has_counter && has_time && period_ns > 0 && counter_step_ == 1 &&
      ((entry.counter - before.counter) & counter_mask_) == 1 && std::abs(step_ns - period_ns) < 0.5 * period_ns) {
    can_detect_gaps_ = true;
    entry.number = before.number + 1;
    ++device_.steps;
    device_.time += Nanoseconds(entry.time_ns - before.time_ns);
    return;
  }
  const double steps_by_time = has_time && period_ns > 0 ? std::round(step_ns / period_ns) : 1;

  double steps = std::max(steps_by_time, 1.0);
  if (has_counter) {
    steps = static_cast<double>((entry.counter - before.counter) & counter_mask_);
    const double wrap = static_cast<double>(counter_mask_) + 1;
    steps += wrap * std::max(0.0, std::round((steps_by_time - steps) / wrap));
    steps = std::round(steps / counter_step_);
  } else if (has_time && step_ns == 0 && period_ns > 0) {
    steps = 0;
  }

  can_detect_gaps_ = can_detect_gaps_ || has_counter || (has_time && period_ns > 0);
  if (steps == 0) ++repeated_;
  if (steps > 1) {
    ++gaps_;
    missing_ += static_cast<std::uint64_t>(steps) - 1;
  }
  entry.number = before.number + static_cast<std::uint64_t>(steps);

  const double tolerance_ns = 0.5 * period_ns + time_resolution_ns_ + clock_tolerance * steps * period_ns;
  if (has_time && period_ns > 0 && std::abs(step_ns - steps * period_ns) > tolerance_ns) {
    ++time_jumps_;
    entry.starts_line = true;
  } else if (has_time && steps > 0) {
    ++device_.steps;
    device_.time += Nanoseconds(entry.time_ns - before.time_ns);
  }
}

double StreamStatistics::x(const Entry& entry, bool by_time) const noexcept {
  const Entry& origin = window_.front();
  return by_time ? static_cast<double>(entry.time_ns - origin.time_ns)
                 : static_cast<double>(entry.number - origin.number);
}

// Fits the entries from `begin` to `end`, which no jump separates, and counts the deviations of
// entries not yet evaluated.
void StreamStatistics::fit(std::size_t begin, std::size_t end, bool by_time) {
  if (end <= evaluated_) return;
  std::size_t count = 0;
  std::int64_t origin_ns = 0;
  for (std::size_t i = begin; i < end; ++i) {
    by_time = by_time && (window_[i].fields & Measurement::time) != 0;
    if (!window_[i].arrival_ns) continue;
    if (count++ == 0) origin_ns = *window_[i].arrival_ns;
  }
  if (count < shortest_line) return;

  const auto y = [&](const Entry& entry) { return static_cast<double>(*entry.arrival_ns - origin_ns); };
  double mean_x = 0, mean_y = 0;
  for (std::size_t i = begin; i < end; ++i) {
    if (!window_[i].arrival_ns) continue;
    mean_x += x(window_[i], by_time) / static_cast<double>(count);
    mean_y += y(window_[i]) / static_cast<double>(count);
  }
  double xx = 0, xy = 0;
  for (std::size_t i = begin; i < end; ++i) {
    if (!window_[i].arrival_ns) continue;
    const double dx = x(window_[i], by_time) - mean_x;
    xx += dx * dx;
    xy += dx * (y(window_[i]) - mean_y);
  }
  const double slope = xx > 0 ? xy / xx : 0;
  for (std::size_t i = std::max(begin, evaluated_); i < end; ++i) {
    if (!window_[i].arrival_ns) continue;
    const double line = mean_y + slope * (x(window_[i], by_time) - mean_x);
    jitter_.add(std::abs(y(window_[i]) - line) * 1e-9);
  }
}

}  // namespace imud
