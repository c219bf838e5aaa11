#include "tools/allan/allan_curve.hpp"

#include <algorithm>

namespace imud {

std::size_t largest_curve_factor(AllanKind kind, std::size_t samples) noexcept {
  return samples / (kind == AllanKind::total ? 2 : order_of(kind) + 1);
}

namespace {

// Every so many points of a phase: the averages over a multiple of them read no other points.
constexpr std::size_t coarse_step = 64;

std::vector<double> coarse_points(std::span<const double> phase, const ResidentPages& resident) {
  std::vector<double> points;
  points.reserve(phase.size() / coarse_step + 1);
  for (std::size_t i = 0; i < phase.size(); i += coarse_step) {
    points.push_back(phase[i]);
    resident.touched(coarse_step * sizeof(double));
  }
  return points;
}

}  // namespace

AllanCurve allan_curve(AllanKind kind, const SampleStore& rates, double rate_hz, unsigned per_decade,
                       double confidence) {
  AllanCurve curve{kind, 1 / rate_hz, static_cast<double>(rates.size()) / rate_hz, rates.size(), {}};
  const SampleStore phase = stored_phase_of(rates);
  const auto resident = phase.pages();
  const auto factors = averaging_factors(largest_curve_factor(kind, rates.size()), per_decade);
  const auto coarse = coarse_points(phase, resident);
  const auto deviations = allan_deviations(kind, phase, factors, resident);
  constexpr std::size_t few_averages = 300;
  int noise = 0;
  for (std::size_t i = 0; i < factors.size(); ++i) {
    const std::size_t factor = factors[i];
    AllanCurve::Point point;
    point.factor = factor;
    point.tau_s = static_cast<double>(factor) / rate_hz;
    point.deviation = deviations[i];
    const int identified = (factor % coarse_step == 0 ? identify_noise(kind, coarse, factor / coarse_step)
                                                      : identify_noise(kind, phase, factor, resident))
                               .value_or(noise);
    noise = rates.size() / factor < few_averages ? std::min(identified, noise) : identified;
    point.noise = noise;
    point.degrees = degrees_of_freedom(kind, noise, phase.size(), factor);
    point.bounds = deviation_bounds(point.deviation, point.degrees, confidence);
    curve.points.push_back(point);
  }
  return curve;
}

}  // namespace imud
