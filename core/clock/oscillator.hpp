// Oscillator: the frequency of a sensor's clock, which wanders and depends on the temperature.
#pragma once

#include <cstdint>
#include <optional>

#include "core/environment/temperature.hpp"
#include "core/numbers/random.hpp"
#include "core/time.hpp"

namespace imud {

// Frequencies are relative: 1e-6 is 1 ppm. The default of every member switches its part off.
struct OscillatorModel {
  double phase_random_walk = 0;      // N, s/sqrt(s), not negative: white noise of the frequency
  double frequency_random_walk = 0;  // K, 1/sqrt(s), not negative
  double temperature_linear = 0;     // a, 1/K
  double temperature_quadratic = 0;  // b, 1/K^2; a crystal's is negative, with reference_c where its parabola turns
  double reference_c = 25;           // T0, degrees Celsius
};

// The clock runs 1 + y times as fast as the clock of its Grid:
//   y = x + N n/sqrt(t) + a (T - T0) + b (T - T0)^2,   dx = K dw,   |y| <= 0.1
// where w is a Wiener process, x is 0 at sample 0, and T is the temperature at the begin of a period. Periods have
// the exact mean of x over them, so that the Allan variance is N^2/tau + K^2 tau/3 at every tau from one period on.
// (The two-state model of a clock: C. Zucca and P. Tavella, "The clock model and its relationship with the Allan and
// related variances", IEEE Trans. UFFC 52(2), 2005.)
//
// The temperature model counts from the first power on; its warm-up does not follow later losses of power. Every
// result follows from the model, the seed, the number of the sample and the truth's temperature. No allocation once
// made; nothing throws. Not thread-safe.
class Oscillator {
 public:
  static constexpr double most = 0.1;  // the limit of |y|

  // `grid` is the grid of the samples. `temperature` and `constant_c` are the arguments of Temperature.
  Oscillator(const OscillatorModel& model, const TemperatureModel& temperature, double constant_c, const Grid& grid);

  // Returns false if the clock has the frequency of its grid.
  bool is_on() const noexcept { return is_on_; }
  // Returns true if next() needs the truth's temperature.
  bool follows_truth() const noexcept { return temperature_.follows_truth(); }
  // Returns the period after sample `k` less the grid's period. Must be called once for each sample, in their order.
  // The remainder of the rounding to ns is added to the next period. `truth_c`: degrees Celsius, of the surroundings.
  Nanoseconds next(const Normals& normals, std::uint64_t k, std::optional<double> truth_c) noexcept;
  // Goes on from the wander and the time since power on of `before`.
  void continue_from(const Oscillator& before) noexcept;

 private:
  OscillatorModel model_;
  Temperature temperature_;
  double counted_s_, true_s_;  // a period as the clock counts it, and the grid's
  bool is_on_;
  double wander_ = 0;          // x
  double rest_ns_ = 0;         // the remainder of the rounding
  double since_s_ = 0;         // from the power on to the first of `periods_`
  std::uint64_t periods_ = 0;  // so far, since the construction or continue_from()
};

}  // namespace imud
