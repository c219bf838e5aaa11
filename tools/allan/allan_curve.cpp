#include "tools/allan/allan_curve.hpp"

#include <algorithm>

namespace imud {

std::size_t largest_curve_factor(AllanKind kind, std::size_t samples) noexcept {
  return samples / (kind == AllanKind::total ? 2 : order_of(kind) + 1);
}

AllanCurve allan_curve(AllanKind kind, std::span<const double> rates, double rate_hz, unsigned per_decade,
                       double confidence) {
  AllanCurve curve{kind, 1 / rate_hz, static_cast<double>(rates.size()) / rate_hz, rates.size(), {}};
  const auto phase = phase_of(rates);
  constexpr std::size_t few_averages = 300;
  int noise = 0;
  for (const std::size_t factor : averaging_factors(largest_curve_factor(kind, rates.size()), per_decade)) {
    AllanCurve::Point point;
    point.factor = factor;
    point.tau_s = static_cast<double>(factor) / rate_hz;
    point.deviation = allan_deviation(kind, phase, factor);
    const int identified = identify_noise(kind, phase, factor).value_or(noise);
    noise = rates.size() / factor < few_averages ? std::min(identified, noise) : identified;
    point.noise = noise;
    point.degrees = degrees_of_freedom(kind, noise, phase.size(), factor);
    point.bounds = deviation_bounds(point.deviation, point.degrees, confidence);
    curve.points.push_back(point);
  }
  return curve;
}

}  // namespace imud
