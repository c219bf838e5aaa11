// PoseFit: the choice of the window.
#include <algorithm>

#include "core/pose/pose_fit.hpp"

namespace imud {
namespace {

// 2^(k/2)
constexpr std::array<double, 9> factors = {1.0, 1.4142135623730951, 2.0, 2.8284271247461903, 4.0, 5.656854249492381,
                                           8.0, 11.313708498984761, 16.0};
constexpr double neighbourhood = 16.0;      // delays
constexpr double widest_window_turn = 2.5;  // rad, from a truth to the ends of its window, as without a choice

}  // namespace

double PoseFit::widest_factor(int widest) noexcept { return factors[static_cast<std::size_t>(widest)]; }

// Returns the end of the next truth's segment, as far as it has come.
std::size_t PoseFit::segment_end() const noexcept {
  if (newest_segment_ <= next_) return count_;
  std::size_t end = next_ + 1;
  while (!item(end).begins_segment) ++end;
  return end;
}

// Returns the shortest delay that is chosen: three mean steps, if that is longer than the option.
double PoseFit::shortest_s() const noexcept {
  const std::size_t end = segment_end(), steps = end - 1 - segment_;
  if (steps == 0) return delay_s_;
  return std::max(delay_s_, 3.0 * (since_s(end - 1) - since_s(segment_)) / static_cast<double>(steps));
}

// Returns true if all truths on which the choice depends have come.
bool PoseFit::has_all_ahead() const noexcept {
  const std::size_t end = segment_end(), after = end - 1 - next_;
  if (end < count_ || ended_ || after >= 3 * most) return true;
  const double widest_s = factors[static_cast<std::size_t>(options_.widest)] * shortest_s();
  const double from = std::max(0.0, since_s(segment_) + widest_s);
  return after > least_at_end && since_s(end - 1) >= from + 2.0 * widest_s - shortest_s() / 6.0;  // times may jitter
}

// Chooses the windows for the next truth: at the first of a segment, and once in each half of a delay.
void PoseFit::choose() noexcept {
  const std::int64_t span = options_.delay.count() / 2;
  const auto begins_span = [&](std::size_t i) {
    return i == segment_ || item(i).truth.time.ns / span != item(i - 1).truth.time.ns / span;
  };
  if (!begins_span(next_)) return;
  const std::size_t end = segment_end();
  const bool is_complete = end < count_ || ended_;
  const double delay_s = shortest_s(), widest_s = factors[static_cast<std::size_t>(options_.widest)] * delay_s;
  for (probed_ = std::max(probed_, segment_); probed_ < end; ++probed_) {
    if (!is_complete && end - 1 - probed_ < most && since_s(end - 1) - since_s(probed_) < widest_s + delay_s) break;
    for (const Quantity quantity : quantities) {
      probes_[quantity][(oldest_ + probed_) % capacity].known = 0;
      probes_[quantity][(oldest_ + probed_) % capacity].is_rejected = false;
      if (begins_span(probed_) && item(probed_).derives(quantity)) probe(quantity, probed_, end, delay_s);
    }
  }
  for (const Quantity quantity : quantities) {
    if (!item(next_).derives(quantity)) continue;
    const std::size_t level = choose(quantity, end, delay_s);
    chosen_s_[quantity] = level == 0 ? delay_s_ : factors[level] * delay_s;
  }
}

// Fits the windows of each level around number `i`, as far as they are within the segment.
void PoseFit::probe(Quantity quantity, std::size_t i, std::size_t end, double delay_s) noexcept {
  Probe& probe = probes_[quantity][(oldest_ + i) % capacity];
  const double now = since_s(i), half_step = delay_s / 6.0;
  const bool is_second = quantity == place && !item(i).truth.has_velocity;
  // The noise nearby, with which a level is beyond doubt wrong.
  double energy = 0.0, energies = 0.0;
  const std::size_t nearby = 8;
  for (std::size_t k = std::max(segment_ + nearby, i) - nearby; k < std::min(end, i + nearby + 1); ++k)
    if (item(k).noise[quantity] >= 0.0) {
      energy += item(k).noise[quantity];
      energies += 1.0;
    }
  if (energies == 0.0) return;
  energy /= energies;

  std::size_t first = i, last = i;  // the truths whose values are in phi_
  phi_[most].setZero();
  for (std::size_t k = 0; k <= static_cast<std::size_t>(options_.widest); ++k) {
    const double reach = factors[k] * delay_s + half_step;
    if (since_s(segment_) > now - reach + 2.0 * half_step || since_s(end - 1) < now + reach - 2.0 * half_step) return;
    const auto take = [&](std::size_t j) {
      phi_[most + j - i] = value_of(quantity, i, j);
      return quantity == place || phi_[most + j - i].squaredNorm() < widest_window_turn * widest_window_turn;
    };
    while (first > segment_ && (i - first < least || since_s(first - 1) >= now - reach))
      if (i - first == most || !take(--first)) return;
    while (last + 1 < end && (last - i < least || since_s(last + 1) <= now + reach))
      if (last - i == most || !take(++last)) return;
    fit_.clear();
    for (std::size_t j = first; j <= last; ++j) fit_.add(since_s(j) - now, phi_[most + j - i]);
    const PolynomialFit::Derivatives d = fit_.at_0();
    probe.value[k] = is_second ? d.second : d.first;
    probe.gain[k] = is_second ? d.second_gain : d.first_gain;
    constexpr double beyond_doubt = 1000.0;
    probe.is_rejected =
        k > 0 && (probe.value[k] - probe.value[k - 1]).squaredNorm() > beyond_doubt * energy * probe.gain[k - 1];
    if (probe.is_rejected) return;
    probe.known = k + 1;
  }
}

// Returns the level of the next truth.
std::size_t PoseFit::choose(Quantity quantity, std::size_t end, double delay_s) const noexcept {
  // At twice the change by noise, both windows have equal errors. Estimates from so few truths scatter, the more as
  // the noise of time stamps depends on the speed: with 2 in place of 4, some stretches kept windows that are too
  // short.
  constexpr double margin = 4.0, enough_better = 0.7, least_probes = 4.0;
  const double ahead = factors[static_cast<std::size_t>(options_.widest)] * delay_s, before = neighbourhood * delay_s;
  std::size_t level = 0;
  bool is_doubtful = false;  // the level before was no improvement
  for (std::size_t k = 1; k <= static_cast<std::size_t>(options_.widest); ++k) {
    const double reach = factors[k] * delay_s;
    const double latest = since_s(end - 1) - reach, earliest = since_s(segment_) + reach;
    if (latest < earliest) break;
    const double middle = std::clamp(0.0, earliest, latest);
    double change = 0.0, gain = 0.0, wider_gain = 0.0, probes = 0.0, noise = 0.0, noises = 0.0;
    bool is_rejected = false;
    for (std::size_t i = end; i-- > segment_ && since_s(i) >= middle - before;) {
      if (since_s(i) > middle + ahead) continue;
      if (item(i).noise[quantity] >= 0.0) {
        noise += item(i).noise[quantity];
        noises += 1.0;
      }
      if (i >= probed_) continue;
      const Probe& probe = probes_[quantity][(oldest_ + i) % capacity];
      is_rejected = is_rejected || (probe.is_rejected && probe.known <= k);
      if (probe.known <= k) continue;
      change += (probe.value[k] - probe.value[level]).squaredNorm();
      gain += probe.gain[level];
      wider_gain += probe.gain[k];
      probes += 1.0;
    }
    if (is_rejected || probes < least_probes || noises == 0.0) break;
    if (wider_gain > enough_better * gain) continue;
    if (change <= margin * (noise / noises) * (gain - wider_gain)) {
      level = k;
      is_doubtful = false;
    } else if (is_doubtful) {
      break;
    } else {
      is_doubtful = true;
    }
  }
  return level;
}

}  // namespace imud
