#include "emulator/truth_clock.hpp"

#include <algorithm>
#include <cmath>

namespace imud {

namespace {

constexpr double window_s = 4;
constexpr double offset_window_s = 0.5;
constexpr double block_s = window_s / 64;
constexpr std::size_t fewest_points = 8;  // kept beyond the window, up to oldest_s, for a low truth rate
constexpr double oldest_s = 60;
constexpr double shortest_span_s = 0.2;  // the shortest span of arrivals from which a rate is estimated
constexpr double time_constant_s = 0.5;  // of slewing
constexpr double first_automatic_delay_s = 0.05;
constexpr double longest_delay_s = 1;
constexpr std::size_t between_evaluations = 32;

}  // namespace

TruthClock::TruthClock(const Options& options) noexcept
    : options_(options), delay_s_(options.automatic_percent > 0 ? first_automatic_delay_s : seconds(options.delay)) {}

HostTime TruthClock::begin(TruthTime truth, HostTime arrival, double rate) noexcept {
  truth_origin_ = truth;
  host_origin_ = arrival;
  first_ = count_ = 0;
  rate_ = measured_rate_ = rate;
  slope_ = 1 / rate;
  intercept_s_ = 0;
  offset_s_ = 0;
  lateness_s_ = 0;
  last_truth_s_ = 0;
  add({});
  anchor_ = arrival + nanoseconds(delay_s_ * slope_);
  line_s_ = delay_s_;
  correction_s_ = 0;
  slew_s_ = time_constant_s;
  applied_delay_s_ = delay_s_;
  return anchor_;
}

void TruthClock::observe(TruthTime truth, HostTime arrival, HostTime now) noexcept {
  const Point point{seconds(truth - truth_origin_), seconds(arrival - host_origin_)};
  if (options_.automatic_percent > 0) add_sufficient_delay(line_at(arrival) - last_truth_s_);
  last_truth_s_ = point.truth_s;
  add(point);
  fit();
  lateness_s_ = std::max(0.0, point.host_s - (slope_ * point.truth_s + intercept_s_));
  offset_s_ = (slope_ - 1) * point.truth_s + intercept_s_;

  move_anchor(std::max(now, anchor_));
  correction_s_ = (seconds(anchor_ - host_origin_) - intercept_s_) / slope_ - line_s_;
  slew_s_ = std::max(time_constant_s, std::abs(correction_s_) / largest_slew);
  rate_ = 1 / slope_;
}

double TruthClock::line_at(HostTime time) const noexcept {
  const double since_s = seconds(time - anchor_);
  return line_s_ + rate_ * since_s + correction_s_ * std::clamp(since_s / slew_s_, 0.0, 1.0);
}

void TruthClock::set(const Options& options) noexcept {
  options_ = options;
  if (options.automatic_percent == 0) delay_s_ = seconds(options.delay);
}

double TruthClock::delay_at(HostTime time) const noexcept {
  const double most_s = largest_slew * std::max(0.0, seconds(time - anchor_));
  return applied_delay_s_ + std::clamp(delay_s_ - applied_delay_s_, -most_s, most_s);
}

TruthTime TruthClock::truth(HostTime time) const noexcept {
  return truth_origin_ + nanoseconds(line_at(time) - delay_at(time));
}

void TruthClock::move_anchor(HostTime time) noexcept {
  const double since_s = seconds(time - anchor_);
  if (since_s <= 0) return;
  line_s_ = line_at(time);
  applied_delay_s_ = delay_at(time);
  correction_s_ *= 1 - std::min(1.0, since_s / slew_s_);
  slew_s_ = std::max(time_constant_s, slew_s_ - since_s);
  anchor_ = time;
}

TruthTime TruthClock::use(HostTime time) noexcept {
  move_anchor(time);
  return truth(time);
}

void TruthClock::add(const Point& arrival) noexcept {
  const auto block = [](const Point& p) { return std::floor(p.host_s / block_s); };
  if (count_ > 0) {
    Point& newest = points_[(first_ + count_ - 1) % points_.size()];
    if (block(newest) == block(arrival)) {
      if (arrival.host_s - newest.host_s < slope_ * (arrival.truth_s - newest.truth_s)) newest = arrival;
      return;
    }
  }
  if (count_ == points_.size()) {
    first_ = (first_ + 1) % points_.size();
    --count_;
  }
  points_[(first_ + count_++) % points_.size()] = arrival;
  const auto oldest_is_older_than = [&](double age_s) { return arrival.host_s - point(0).host_s > age_s; };
  while (count_ > 2 && oldest_is_older_than(count_ > fewest_points ? window_s : oldest_s)) {
    first_ = (first_ + 1) % points_.size();
    --count_;
  }
}

void TruthClock::fit() noexcept {
  const double span_s = point(count_ - 1).truth_s - point(0).truth_s;
  if (point(count_ - 1).host_s - point(0).host_s >= shortest_span_s && span_s > 0 && count_ > 2) {
    // Lower hull, from left to right (Andrew's monotone chain).
    std::array<Point, 64> hull;
    std::size_t corners = 0;
    double middle_s = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Point& p = point(i);
      middle_s += p.truth_s / static_cast<double>(count_);
      const auto is_above = [&](const Point& a, const Point& b) {
        return (b.truth_s - a.truth_s) * (p.host_s - a.host_s) <= (b.host_s - a.host_s) * (p.truth_s - a.truth_s);
      };
      while (corners > 1 && is_above(hull[corners - 2], hull[corners - 1])) --corners;
      hull[corners++] = p;
    }
    std::size_t right = 1;
    while (right + 1 < corners && hull[right].truth_s < middle_s) ++right;
    const Point& a = hull[right - 1];
    const Point& b = hull[right];
    const double slope = std::clamp((b.host_s - a.host_s) / (b.truth_s - a.truth_s), 0.1, 10.0);
    measured_rate_ = 1 / slope;
    // The uncertainty of the slope follows from the mean distance of the points above the line.
    double lateness_s = 20e-6;
    for (std::size_t i = 0; i < count_; ++i)
      lateness_s +=
          (point(i).host_s - a.host_s - slope * (point(i).truth_s - a.truth_s)) / static_cast<double>(count_);
    const double uncertainty = 2 * lateness_s / span_s;
    slope_ = std::abs(slope - 1) < 2 * uncertainty ? 1.0 : slope;
  }
  const double newest_s = point(count_ - 1).host_s;
  intercept_s_ = newest_s - slope_ * point(count_ - 1).truth_s;
  for (std::size_t n = 2; n <= count_; ++n) {
    const Point& p = point(count_ - n);
    if (n > fewest_points && p.host_s < newest_s - offset_window_s) break;
    intercept_s_ = std::min(intercept_s_, p.host_s - slope_ * p.truth_s);
  }
}

void TruthClock::add_sufficient_delay(double delay_s) noexcept {
  sufficient_delays_[sufficient_delay_count_++ % sufficient_delays_.size()] = delay_s;
  const std::size_t known = std::min(sufficient_delay_count_, sufficient_delays_.size());
  if (sufficient_delay_count_ % between_evaluations != 0) return;
  std::array<double, 512> sorted = sufficient_delays_;
  const auto rank = static_cast<std::size_t>(options_.automatic_percent / 100 * static_cast<double>(known - 1) + 0.5);
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(rank),
                   sorted.begin() + static_cast<std::ptrdiff_t>(known));
  const double enough_s = std::min(sorted[rank], longest_delay_s);
  constexpr double gradually = 0.05;
  delay_s_ += (enough_s > delay_s_ ? 1 : gradually) * (enough_s - delay_s_);
}

}  // namespace imud
