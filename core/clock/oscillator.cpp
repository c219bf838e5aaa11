#include "core/clock/oscillator.hpp"

#include <algorithm>
#include <cmath>

#include "core/vector.hpp"

namespace imud {

Oscillator::Oscillator(const OscillatorModel& model, const TemperatureModel& temperature, double constant_c,
                       const Grid& grid)
    : model_(model),
      temperature_(temperature, constant_c),
      counted_s_(grid.nominal_period_s()),
      true_s_(grid.period_s()),
      is_on_(model.phase_random_walk > 0 || model.frequency_random_walk > 0 || model.temperature_linear != 0 ||
             model.temperature_quadratic != 0) {}

Nanoseconds Oscillator::next(const Normals& normals, std::uint64_t k, std::optional<double> truth_c) noexcept {
  const double t = since_s_ + static_cast<double>(periods_++) * counted_s_;
  const double x = temperature_.at(t, truth_c) - model_.reference_c;
  double y = wander_ + (model_.temperature_linear + model_.temperature_quadratic * x) * x;
  if (model_.phase_random_walk > 0 || model_.frequency_random_walk > 0) {
    const Vector3 n = normals(Quantity::rate, Process::clock_wander, k);
    // The mean of a Wiener process over a period, given its end, has the variance K^2 T/12.
    const double step = model_.frequency_random_walk * std::sqrt(counted_s_);
    y += step * (0.5 * n[0] + n[1] / std::sqrt(12.0)) + model_.phase_random_walk / std::sqrt(counted_s_) * n[2];
    wander_ = std::clamp(wander_ + step * n[0], -most, most);
  }
  y = std::clamp(y, -most, most);
  rest_ns_ -= 1e9 * true_s_ * (y / (1.0 + y));
  const double whole = std::round(rest_ns_);
  rest_ns_ -= whole;
  return Nanoseconds{static_cast<std::int64_t>(whole)};
}

void Oscillator::continue_from(const Oscillator& before) noexcept {
  wander_ = before.wander_;
  rest_ns_ = before.rest_ns_;
  since_s_ = before.since_s_ + static_cast<double>(before.periods_) * before.counted_s_;
  periods_ = 0;
}

}  // namespace imud
