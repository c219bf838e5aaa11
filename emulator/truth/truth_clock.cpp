#include "emulator/truth/truth_clock.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

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

constexpr double recent_s = 1;                 // the arrivals that may contradict the offset of the whole window
constexpr double steady_s = 50e-6;             // by which they do not, beside half of the mean latency
constexpr double offset_time_constant_s = 10;  // with which the offset of the whole window rises

constexpr Nanoseconds shortest_settling = std::chrono::milliseconds(200), longest_settling = std::chrono::seconds(1);
constexpr std::size_t settling_truths = 16;
constexpr double little_jitter_s = 1e-3;
constexpr double margin_s = 0.5e-3, margin_of_jitter = 0.25;
constexpr double few_outliers = 5;
constexpr double raise_within_s = 1, slowest_raise = 0.002;
constexpr double lowered_s_per_s = 50e-6, too_long = 1.25;

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
  step_s_ = 0;
  need_count_ = 0;
  followed_host_s_ = 0;
  has_steady_offset_ = false;
  fitted_host_s_ = 0;
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
  const double known_s = std::exchange(last_truth_s_, point.truth_s);
  step_s_ = step_s_ > 0 ? std::min(step_s_, point.truth_s - known_s) : point.truth_s - known_s;
  if (add(point) || count_ == 1) fit();
  add_need(point.host_s, known_s);
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

void TruthClock::observe_inserted(TruthTime truth, HostTime arrival) noexcept {
  if (step_s_ > 0) add_need(seconds(arrival - host_origin_), seconds(truth - truth_origin_) - step_s_);
}

void TruthClock::set(const Options& options) noexcept {
  const bool was_automatic = options_.automatic_percent > 0;
  options_ = options;
  delay_slew_ = largest_slew;
  if (options.automatic_percent == 0) {
    delay_s_ = seconds(options.delay);
    is_settled_ = true;
  } else if (!was_automatic && need_count_ >= between_evaluations) {
    const Enough now = enough(0);
    delay_s_ = std::min(now.delay_s + now.margin_s, longest_delay_s);
  }
}

bool TruthClock::is_settled(HostTime now) noexcept {
  if (options_.automatic_percent == 0 || is_settled_) return true;
  const Nanoseconds since_begin = now - host_origin_;
  if (since_begin >= longest_settling) return true;
  return since_begin >= shortest_settling && need_count_ + 1 >= settling_truths &&
         enough_to_settle().jitter_s <= little_jitter_s;
}

// Computes the needs again, because the line may have moved since the arrivals.
TruthClock::Enough TruthClock::enough_to_settle() noexcept {
  const std::size_t count = std::min(need_count_, needs_.size());
  for (std::size_t i = 0; i < count; ++i) needs_[i] = need_s(arrivals_[i].host_s, arrivals_[i].known_s);
  return enough(count + 1 >= settling_truths ? 1 : 0);
}

TruthClock::Settled TruthClock::settle(TruthTime truth, HostTime now) noexcept {
  Enough known = {longest_delay_s, 0, 0};
  if (!is_settled_) {
    if (need_count_ > 0) known = enough_to_settle();
    is_settled_ = true;
    delay_s_ = std::min(known.delay_s + known.margin_s, longest_delay_s);
  }
  const double truth_s = seconds(truth - truth_origin_);
  anchor_ = std::max(now, host_origin_ + nanoseconds(intercept_s_ + slope_ * (truth_s + delay_s_)));
  rate_ = 1 / slope_;
  line_s_ = (seconds(anchor_ - host_origin_) - intercept_s_) / slope_;
  applied_delay_s_ = line_s_ - truth_s;
  correction_s_ = 0;
  slew_s_ = time_constant_s;
  return {anchor_, step_s_, known.jitter_s, seconds(now - host_origin_)};
}

double TruthClock::delay_at(HostTime time) const noexcept {
  const double most_s = delay_slew_ * std::max(0.0, seconds(time - anchor_));
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

bool TruthClock::add(const Point& arrival) noexcept {
  const auto block = [](const Point& p) { return std::floor(p.host_s / block_s); };
  if (count_ > 0) {
    Point& newest = points_[(first_ + count_ - 1) % points_.size()];
    if (block(newest) == block(arrival)) {
      const bool is_lower = arrival.host_s - newest.host_s < slope_ * (arrival.truth_s - newest.truth_s);
      if (is_lower) newest = arrival;
      return is_lower;
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
  return true;
}

void TruthClock::fit() noexcept {
  const double slope_before = slope_;
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
  const auto intercept = [this](const Point& p) { return p.host_s - slope_ * p.truth_s; };
  const Point& newest = point(count_ - 1);
  double quick_s = intercept(newest), last_s = quick_s, least_s = quick_s, sum_s = quick_s;
  for (std::size_t n = 2; n <= count_; ++n) {
    const Point& p = point(count_ - n);
    const double at_p_s = intercept(p);
    sum_s += at_p_s;
    least_s = std::min(least_s, at_p_s);
    if (n <= fewest_points || p.host_s >= newest.host_s - recent_s) last_s = std::min(last_s, at_p_s);
    if (n <= fewest_points || p.host_s >= newest.host_s - offset_window_s) quick_s = std::min(quick_s, at_p_s);
  }
  const double mean_latency_s = sum_s / static_cast<double>(count_) - least_s;
  const double since_s = newest.host_s - std::exchange(fitted_host_s_, newest.host_s);
  const bool is_steady = slope_ == 1.0 && last_s - least_s <= steady_s + 0.5 * mean_latency_s;
  const bool was_steady = std::exchange(has_steady_offset_, is_steady) && slope_ == slope_before;
  if (!is_steady)
    intercept_s_ = quick_s;
  else if (!was_steady || least_s < intercept_s_)
    intercept_s_ = least_s;
  else
    intercept_s_ += (least_s - intercept_s_) * std::min(1.0, since_s / offset_time_constant_s);
}

void TruthClock::add_need(double host_s, double known_s) noexcept {
  const std::size_t i = need_count_++ % needs_.size();
  arrivals_[i] = {host_s, known_s};
  needs_[i] = need_s(host_s, known_s);
  if (options_.automatic_percent > 0 && is_settled_ && need_count_ % between_evaluations == 0) follow_needs(host_s);
}

// `outliers`: the number of the longest needs that are left out.
TruthClock::Enough TruthClock::enough(std::size_t outliers) const noexcept {
  const std::size_t known = std::min(need_count_, needs_.size());
  std::array<double, 512> sorted = needs_;
  const auto end = sorted.begin() + static_cast<std::ptrdiff_t>(known);
  const auto longest = end - 1 - static_cast<std::ptrdiff_t>(std::min(outliers, known - 1));
  std::nth_element(sorted.begin(), longest, end);
  const double jitter_s = *longest - *std::min_element(sorted.begin(), end);
  return {*longest, margin_s + margin_of_jitter * jitter_s, jitter_s};
}

void TruthClock::follow_needs(double host_s) noexcept {
  const double since_s = host_s - std::exchange(followed_host_s_, host_s);
  const auto known = static_cast<double>(std::min(need_count_, needs_.size()));
  const double share = 1 - options_.automatic_percent / 100;
  // At the beginning a single late arrival is no reason to move the motion.
  const double few = std::min(few_outliers, share * static_cast<double>(needs_.size()));
  const Enough now = enough(static_cast<std::size_t>(std::max(share * known, few) + 0.5));
  const double wanted_s = std::min(now.delay_s + now.margin_s, longest_delay_s);
  if (std::min(now.delay_s, longest_delay_s) > delay_s_) {
    ++delay_raises_;
    delay_slew_ = std::clamp((wanted_s - delay_s_) / raise_within_s, slowest_raise, largest_slew);
    delay_s_ = wanted_s;
  } else if (delay_s_ > too_long * wanted_s) {
    delay_s_ -= std::min(lowered_s_per_s * since_s, delay_s_ - wanted_s);
  }
}

}  // namespace imud
