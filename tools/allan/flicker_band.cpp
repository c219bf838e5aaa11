#include "tools/allan/flicker_band.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <vector>

#include "core/effects/flicker.hpp"

namespace imud {

using std::numbers::pi;

double allan_response(AllanKind kind, double f, double period, double m) noexcept {
  const double s = std::sin(pi * f * period * m);
  const double average = std::pow(s / (m * std::sin(pi * f * period)), 2);
  if (kind == AllanKind::modified) return 2 * s * s * average * average;
  return is_hadamard(kind) ? 8.0 / 3 * std::pow(s, 4) * average : 2 * s * s * average;
}

namespace {

// The density of a process relative to its variance and correlation time T, at 2 pi f T = x, if it is a sequence of
// so many nodes in T: `transition` from one to the next.
double sequence_density(double x, double nodes, double transition, double cosine) noexcept {
  return x * (1 - transition) * (1 + transition) / (1 - 2 * transition * cosine + transition * transition) / nodes;
}

double process_variance(int number) noexcept {
  return Flicker::variance(static_cast<std::size_t>(std::min(number, 1)), Flicker::max_octaves);
}

// The density of processes that are linear between their nodes, over 2 pi f T of the first.
class LinearDensity {
 public:
  LinearDensity() {
    // imud has 16 to 32 nodes, depending on the period. With 20 nodes the error of the deviation at short times is
    // below 1 % of the flat part.
    constexpr double nodes = 20;
    const double transition = std::exp(-1 / nodes);
    for (int i = 0; i < std::ssize(table_); ++i) {
      double x = std::exp2(lowest + static_cast<double>(i) / per_octave);
      for (int number = 0; number == 0 || x < 1000; ++number, x *= 2) {
        // The squared transform of the triangle that makes a sequence linear.
        const double half = x / nodes / 2, triangle = std::pow(std::sin(half) / half, 4);
        table_[static_cast<std::size_t>(i)] +=
            process_variance(number) * triangle * sequence_density(x, nodes, transition, std::cos(x / nodes));
      }
    }
  }
  double at(double x) const noexcept {
    const double last = static_cast<double>(table_.size()) - 1.001;
    const double place = std::clamp((std::log2(x) - lowest) * per_octave, 0.0, last);
    const auto i = static_cast<std::size_t>(place);
    return table_[i] + (place - static_cast<double>(i)) * (table_[i + 1] - table_[i]);
  }

 private:
  static constexpr double lowest = -20, highest = 16;  // octaves of x
  static constexpr int per_octave = 100;
  std::vector<double> table_ = std::vector<double>(static_cast<std::size_t>((highest - lowest) * per_octave));
};

}  // namespace

FlickerBand::FlickerBand(double from_s, double period) noexcept
    : time_(from_s > 0 ? Flicker::first_correlation_time(from_s) : 0), period_(period) {}

double FlickerBand::density(double f) const noexcept {
  if (time_ == 0) return 1;
  double x = 2 * pi * f * time_;
  if (period_ * Flicker::nodes <= time_) {
    static const LinearDensity linear;
    return linear.at(x);
  }
  const double cosine = std::cos(2 * pi * f * period_);
  double sum = 0, nodes = time_ / period_, transition = std::exp(-1 / nodes);
  for (int number = 0; number == 0 || x < 1000; ++number, x *= 2, nodes *= 2, transition = std::sqrt(transition))
    sum += process_variance(number) * sequence_density(x, nodes, transition, cosine);
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
