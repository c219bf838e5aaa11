#include "tools/allan/flicker_band.hpp"

#include <cmath>
#include <numbers>

#include "core/effects/flicker.hpp"

namespace imud {

using std::numbers::pi;

double allan_response(AllanKind kind, double f, double period, double m) noexcept {
  const double s = std::sin(pi * f * period * m);
  const double average = std::pow(s / (m * std::sin(pi * f * period)), 2);
  if (kind == AllanKind::modified) return 2 * s * s * average * average;
  return is_hadamard(kind) ? 8.0 / 3 * std::pow(s, 4) * average : 2 * s * s * average;
}

FlickerBand::FlickerBand(double from_s, double period) noexcept
    : time_(from_s > 0 ? Flicker::first_correlation_time(from_s) : 0) {
  // imud has 16 to 32 nodes, by the period. With 20 the deviation at short times is right within 1 % of the flat
  // part.
  constexpr double usual_nodes = 20;
  is_linear_ = period * Flicker::nodes <= time_;
  nodes_ = is_linear_ ? usual_nodes : time_ / period;
}

double FlickerBand::process(double x, double nodes) const noexcept {
  // The density of a sequence, times the squared transform of the triangle that makes it linear between its nodes.
  const double y = x / nodes, half = y / 2, r = std::exp(-1 / nodes);
  const double triangle = !is_linear_ || half < 1e-4 ? 1 : std::pow(std::sin(half) / half, 4);
  return triangle * (1 - r) * (1 + r) / (1 - 2 * r * std::cos(y) + r * r) / nodes;
}

double FlickerBand::density(double f) const noexcept {
  if (time_ == 0) return 1;
  constexpr double negligible = 1e3;
  constexpr std::size_t endless = Flicker::max_octaves;
  double sum = 0, x = 2 * pi * f * time_, nodes = nodes_;
  for (std::size_t i = 0; i == 0 || x < negligible; ++i, x *= 2) {
    sum += Flicker::variance(i == 0 ? 0 : 1, endless) * x * process(x, nodes);
    if (!is_linear_) nodes *= 2;
  }
  return sum;
}

double flicker_share(AllanKind kind, const AveragingTime& time, double from_s) noexcept {
  if (from_s == 0) return 1;
  constexpr double lowest = 1e-4, highest = 100, ratio = 0.02;  // of the frequency times the averaging time
  const double period = time.tau_s / static_cast<double>(time.factor);
  const FlickerBand band(from_s, period);
  double share = 0, whole = 0;
  for (double x = lowest; x < highest; x *= 1 + ratio) {
    const double f = x / time.tau_s;
    if (f >= 0.5 / period) break;
    const double response = allan_response(kind, f, period, static_cast<double>(time.factor));
    whole += response;
    share += response * band.density(f);
  }
  return share / whole;
}

}  // namespace imud
