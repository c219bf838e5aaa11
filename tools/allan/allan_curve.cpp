#include "tools/allan/allan_curve.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace imud {

std::size_t largest_curve_factor(AllanKind kind, std::size_t samples) noexcept {
  return samples / (kind == AllanKind::total ? 2 : order_of(kind) + 1);
}

namespace {

// Points of a phase at a constant step: the averages over a multiple of the step read no other points. Also the
// sums of the points at the multiples of each smaller power of 2, from one pass over all points.
class CoarsePhase {
 public:
  static constexpr std::size_t step = 8;

  CoarsePhase(std::span<const double> phase, const ResidentPages& resident) {
    for (std::size_t begin = 0; begin < phase.size(); begin += step) {
      const std::size_t size = std::min(step, phase.size() - begin);
      points_.push_back(phase[begin]);
      if (size == step)
        for (std::size_t i = 0; i < step; ++i) sums_[i] += phase[begin + i];
      else
        for (std::size_t i = 0; i < size; ++i) sums_[i] += phase[begin + i];
      resident.touched(step * sizeof(double));
    }
    points_.finish();
  }
  const SampleStore& points() const noexcept { return points_; }
  // Returns nullopt if the factor does not divide the step.
  std::optional<double> sum_of_points(std::size_t factor) const noexcept {
    if (step % factor != 0) return std::nullopt;
    double sum = 0;
    for (std::size_t i = 0; i < step; i += factor) sum += sums_[i];
    return sum;
  }

 private:
  SampleStore points_;
  std::array<double, step> sums_{};  // of the points whose numbers have the same remainder
};

}  // namespace

AllanCurve allan_curve(AllanKind kind, SampleStore rates, double rate_hz, unsigned per_decade, double confidence) {
  const std::size_t samples = rates.size();
  AllanCurve curve{kind, 1 / rate_hz, static_cast<double>(samples) / rate_hz, samples, {}};
  const SampleStore phase = phase_of(std::move(rates));
  const auto resident = phase.pages();
  const auto factors = averaging_factors(largest_curve_factor(kind, samples), per_decade);
  const CoarsePhase coarse(phase, resident);
  const auto deviations = allan_deviations(kind, phase, factors, resident);
  constexpr std::size_t few_averages = 300;
  int noise = 0;
  for (std::size_t i = 0; i < factors.size(); ++i) {
    const std::size_t factor = factors[i];
    AllanCurve::Point point;
    point.factor = factor;
    point.tau_s = static_cast<double>(factor) / rate_hz;
    point.deviation = deviations[i];
    const bool is_coarse = factor % CoarsePhase::step == 0;
    const auto identified =
        is_coarse ? identify_noise(kind, coarse.points(), factor / CoarsePhase::step, coarse.points().pages())
                  : identify_noise(kind, phase, factor, resident, coarse.sum_of_points(factor));
    const int alpha = identified.value_or(noise);
    noise = samples / factor < few_averages ? std::min(alpha, noise) : alpha;
    point.noise = noise;
    point.degrees = degrees_of_freedom(kind, noise, phase.size(), factor);
    point.bounds = deviation_bounds(point.deviation, point.degrees, confidence);
    curve.points.push_back(point);
  }
  return curve;
}

}  // namespace imud
