#include "core/pose/pose_fit.hpp"

#include <algorithm>
#include <cmath>

#include "core/attitude.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

constexpr double widest_turn = 2.5;  // rad, from a truth to the ends of its window

}  // namespace

PoseFit::PoseFit(const Options& options)
    : options_(options), delay_s_(seconds(options.delay)), items_(capacity), phi_(2 * most + 1), fit_(2 * most + 1) {
  if (options.widest > 0)
    for (auto& probes : probes_) probes.resize(capacity);
  chosen_s_.fill(delay_s_);
}

// The product with the delay is 1.03 for a rate from three truths on a side, 1.25 from many; for a force more.
double PoseFit::bandwidth_hz(Nanoseconds delay) noexcept { return 1.0 / seconds(delay); }

void PoseFit::push(const Truth& truth) noexcept {
  if (count_ == capacity) drop_oldest();
  Item& newest = items_[(oldest_ + count_) % capacity];
  newest.truth = truth;
  const auto is_derived = [](Source source, bool is_given) {
    return source == Source::derived || (source == Source::automatic && !is_given);
  };
  newest.derives_rate = is_derived(options_.rate, truth.has_rate);
  newest.derives_force =
      is_derived(options_.specific_force, truth.has_specific_force || truth.accumulated_dv != AccumulatedDv::none) &&
      (truth.has_position || (truth.has_velocity && !options_.gravitation.needs_position()));
  newest.noise = {-1.0, -1.0};
  newest.begins_segment = begins_segment(newest);
  if (newest.begins_segment) {
    if (!ended_) refuse_outliers_at_end();
    newest_segment_ = count_;
  }
  ended_ = false;
  const Item& added = item(count_++);
  if ((added.derives_rate || added.derives_force) && !refuse_outliers()) estimate_noise();
}

void PoseFit::finish() noexcept {
  if (!ended_) refuse_outliers_at_end();
  ended_ = true;
}

// Returns whether a segment begins with the newest truth; marks one that follows a gap.
bool PoseFit::begins_segment(Item& newest) const noexcept {
  if (count_ == 0 || ended_ || newest.truth.new_run) return true;
  const Item& before = item(count_ - 1);
  if (newest.derives_rate != before.derives_rate || newest.derives_force != before.derives_force ||
      newest.truth.has_velocity != before.truth.has_velocity)
    return true;
  const std::size_t steps = count_ - 1 - newest_segment_;
  const double step = seconds(newest.truth.time - before.truth.time);
  newest.truth.follows_gap =
      steps >= least && step > delay_s_ &&
      step * static_cast<double>(steps) > 4.0 * seconds(before.truth.time - item(newest_segment_).truth.time);
  return newest.truth.follows_gap;
}

// Finds the window of the next truth. Returns false if it is not complete.
bool PoseFit::find_window(double delay_s, Window& window) const noexcept {
  const std::size_t begin = segment_, end = segment_end();
  const bool is_complete = end < count_ || ended_;
  const std::size_t before = next_ - begin, after = end - 1 - next_;
  const double oldest = since_s(begin), newest = since_s(end - 1);
  // Times may jitter: half a step more belongs to the window, and half a step less completes it.
  const double half_step = before + after == 0 ? 0.0 : 0.5 * (newest - oldest) / static_cast<double>(before + after);
  double left = -delay_s, right = delay_s;
  const bool at_begin = before < least || oldest > left + half_step;
  const bool at_end = is_complete && (after < least || newest < right - half_step);
  if (at_begin) right = oldest + 2.0 * delay_s;
  if (at_end) left = newest - 2.0 * delay_s;
  const std::size_t least_after = at_begin ? least_at_end - std::min(before, least_at_end) : least;
  if (!is_complete && after < most && (after < least_after || newest < right - half_step)) return false;

  const std::size_t least_before = at_end ? least_at_end - std::min(after, least_at_end) : least;
  window = {next_, next_};
  while (window.first > begin && next_ - window.first < most &&
         (next_ - window.first < least_before || since_s(window.first - 1) >= left - half_step))
    --window.first;
  while (window.last + 1 < end && window.last - next_ < most &&
         (window.last - next_ < least_after || since_s(window.last + 1) <= right + half_step))
    ++window.last;
  return true;
}

// Returns the fit of value(i), a function of the truth's number.
template <class Value>
PolynomialFit::Derivatives PoseFit::fit(const Window& window, Value value) noexcept {
  fit_.clear();
  for (std::size_t i = window.first; i <= window.last; ++i) fit_.add(since_s(i), value(i));
  using Reduce = PolynomialFit::Reduce;
  return fit_.at_0(options_.widest > 0 ? Reduce::always : Reduce::to_one_side);
}

void PoseFit::derive_rate(Window window, Truth& truth) noexcept {
  const Quaternion q_NB = truth.q_NB.normalized();
  const auto q_of = [&](std::size_t i) { return item(i).truth.q_NB.normalized(); };
  const std::size_t offset = most - next_;  // phi_[most]: of the next truth
  phi_[most].setZero();
  // True if the vehicle turns too far from the next truth to number i, whose neighbour `before` on the side of the
  // next truth is not too far. A step turns by less than pi, so that its own rotation vector is unique.
  const auto is_wide = [&](std::size_t i, std::size_t before) {
    const Vector3 phi = phi_[i + offset] = log(q_NB.conjugate() * q_of(i));
    if (before == next_) return false;
    const double turned = phi_[before + offset].norm() + log(q_of(before).conjugate() * q_of(i)).norm();
    return phi.norm() > widest_turn || turned > 2.0 * units::pi - widest_turn;
  };
  for (std::size_t i = next_; i > window.first; --i)
    if (is_wide(i - 1, i)) window.first = i;
  for (std::size_t i = next_; i < window.last; ++i)
    if (is_wide(i + 1, i)) window.last = i;
  const PolynomialFit::Derivatives phi = fit(window, [&](std::size_t i) { return phi_[i + offset]; });
  count_derived(attitude, phi.first_gain);
  truth.q_NB = (q_NB * exp(phi.value)).normalized();
  truth.omega_BN_B = right_jacobian(phi.value, phi.first);
  truth.omegaDot_BN_B = right_jacobian(phi.value, phi.second);
  truth.has_rate = truth.has_angular_acceleration = truth.is_rate_derived = true;
  // A given accumulated velocity is a vector in N, which must not turn with the correction of the attitude.
  if (truth.accumulated_dv == AccumulatedDv::inertial)
    truth.accumulated_dv_B = truth.q_NB.conjugate() * (q_NB * truth.accumulated_dv_B);
}

void PoseFit::derive_force(const Window& window, Truth& truth) noexcept {
  Vector3 a_N;
  if (truth.has_velocity) {
    const Vector3 v_N = truth.v_BN_N;
    const PolynomialFit::Derivatives v =
        fit(window, [&](std::size_t i) { return Vector3(item(i).truth.v_BN_N - v_N); });
    count_derived(place, v.first_gain);
    truth.v_BN_N += v.value;
    a_N = v.first;
  } else {
    const Vector3 r_N = truth.r_BN_N;
    const PolynomialFit::Derivatives r =
        fit(window, [&](std::size_t i) { return Vector3(item(i).truth.r_BN_N - r_N); });
    count_derived(place, r.second_gain);
    truth.r_BN_N += r.value;
    truth.v_BN_N = r.first;
    truth.has_velocity = true;
    a_N = r.second;
  }
  const GravitationModel& gravitation = options_.gravitation;
  if (has_last_) {
    // Two-point Gauss-Legendre along the cubic Hermite curve of the positions.
    const double h = seconds(truth.time - last_time_);
    const Vector3 step = truth.r_BN_N - last_r_N_;
    Vector3 sum = Vector3::Zero();
    for (const double s : {0.21132486540518713, 0.78867513459481287}) {
      const double s2 = s * s, s3 = s2 * s;
      sum += gravitation_N(gravitation, last_r_N_ + (3.0 * s2 - 2.0 * s3) * step +
                                            h * ((s - 2.0 * s2 + s3) * last_v_N_ + (s3 - s2) * truth.v_BN_N));
    }
    dv_N_ += truth.v_BN_N - last_v_N_ - (0.5 * h) * sum;
  }
  has_last_ = true;
  last_time_ = truth.time;
  last_r_N_ = truth.r_BN_N;
  last_v_N_ = truth.v_BN_N;
  const Quaternion q_BN = truth.q_NB.normalized().conjugate();
  truth.specific_force_B = q_BN * (a_N - gravitation_N(gravitation, truth.r_BN_N));
  truth.accumulated_dv_B = q_BN * dv_N_;
  truth.accumulated_dv = AccumulatedDv::inertial;
  truth.has_specific_force = truth.is_force_derived = true;
}

bool PoseFit::next(Truth& truth) noexcept {
  if (next_ == count_) return false;
  const Item& now = item(next_);
  if (now.begins_segment) segment_ = next_;
  std::array<Window, 2> windows{};
  if (now.derives_rate || now.derives_force) {
    if (options_.widest > 0) {
      if (!has_all_ahead()) return false;
      choose();
    }
    for (const Quantity quantity : quantities)
      if (now.derives(quantity) && !find_window(chosen_s_[quantity], windows[quantity])) return false;
  }
  truth = now.truth;
  if (truth.new_run || !now.derives_force) {
    has_last_ = false;
    dv_N_.setZero();
  }
  if (now.derives_rate) derive_rate(windows[attitude], truth);
  if (now.derives_force) derive_force(windows[place], truth);
  if ((now.derives_rate || now.derives_force) && !(is_finite(truth) && is_in_range(truth))) {
    has_last_ = false;  // the accumulated velocity restarts at 0
    dv_N_.setZero();
  }
  advance();
  return true;
}

void PoseFit::drop_oldest() noexcept {
  oldest_ = (oldest_ + 1) % capacity;
  --count_;
  for (std::size_t* index : {&next_, &segment_, &newest_segment_, &probed_})
    *index -= std::min<std::size_t>(*index, 1);
}

// Drops the truths that no later window needs.
void PoseFit::advance() noexcept {
  ++next_;
  if (next_ == count_) {  // the newest truth is needed for the comparison with the next
    while (count_ > 1) drop_oldest();
  } else if (item(next_).begins_segment) {
    while (next_ > 0) drop_oldest();
  } else {
    const double kept_s = 3.0 * (options_.widest > 0 ? 16.0 * shortest_s() : delay_s_);
    while (next_ > least_at_end && since_s(0) < -kept_s) drop_oldest();
  }
}

void PoseFit::count_derived(Quantity quantity, double gain) noexcept {
  Tally& tally = tallies_[quantity];
  const double delay_s = chosen_s_[quantity];
  tally.shortest_s = tally.count == 0 ? delay_s : std::min(tally.shortest_s, delay_s);
  tally.longest_s = std::max(tally.longest_s, delay_s);
  tally.delay_s += delay_s;
  tally.derived += gain * tally.recent;
  ++tally.count;
}

PoseFit::Quality PoseFit::quality(Quantity quantity) const noexcept {
  const Tally& tally = tallies_[quantity];
  const auto rms = [](double energies, std::uint64_t count) {
    return count == 0 ? 0.0 : std::sqrt(energies / (3.0 * static_cast<double>(count)));
  };
  return {tally.count,
          rms(tally.noise, tally.noises),
          rms(tally.derived, tally.count),
          tally.shortest_s,
          tally.count == 0 ? 0.0 : tally.delay_s / static_cast<double>(tally.count),
          tally.longest_s};
}

}  // namespace imud
