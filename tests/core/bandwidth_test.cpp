// The filter of the sensor: gain and phase of sines that pass through it against closed forms, and what settles it.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "core/triad.hpp"
#include "tests/support/frequency_response.hpp"

namespace imud {
namespace {

constexpr double rate_hz = 2000;
using Complex = std::complex<double>;

struct Unit {
  Triad triad;
  Normals normals{1, 1};
  std::uint64_t k = 0;

  explicit Unit(const SensorFilter& filter, double lsb = 0)
      : triad(errors(filter, lsb), Quantity::rate, 1 / rate_hz) {}
  static TriadErrors errors(const SensorFilter& filter, double lsb) {
    TriadErrors all;
    all.filter = filter;
    all.lsb = lsb;
    all.rounding = Rounding::nearest;
    return all;
  }
  TriadStep take(const Vector3& value, bool begins_run = false) {
    static const Vector3 zero = Vector3::Zero();
    TriadStep step = {.normals = normals,
                      .k = k++,
                      .dt = 1 / rate_hz,
                      .since_power_on = 0,
                      .specific_force = zero,
                      .delta_velocity = zero,
                      .value = lanes(value),
                      .increment = lanes(value / rate_hz),
                      .begins_run = begins_run};
    triad.apply(step);
    return step;
  }
};

SensorFilter low_pass(const Vector3& cut_off_hz, int order) {
  SensorFilter filter;
  filter.cut_off_hz = cut_off_hz;
  filter.order = order;
  return filter;
}
SensorFilter boxcars(int length, int stages) {
  SensorFilter filter;
  filter.length = length;
  filter.stages = stages;
  return filter;
}
const std::vector<SensorFilter>& filters() {
  static const std::vector<SensorFilter> all = {low_pass({262, 33, 0}, 1),
                                                low_pass({262, 33, 0}, 2),
                                                low_pass({262, 33, 0}, 4),
                                                boxcars(4, 1),
                                                boxcars(25, 1),
                                                boxcars(8, 3)};
  return all;
}

// Returns the ratio of output and input of each axis, at a frequency of `cycles` in 2000 samples: the sine is sent
// until it is steady, then compared with sine and cosine over whole periods.
std::array<Complex, 3> measured(const SensorFilter& filter, int cycles) {
  Unit unit(filter);
  constexpr int period = 2000, settling = 10 * period;
  std::array<Complex, 3> ratio = {};
  for (int k = 0; k < settling + period; ++k) {
    const double phase = 2 * M_PI * static_cast<double>(k * cycles % period) / period;
    const Vector3 value = vector_of(unit.take(Vector3::Constant(std::sin(phase))).value);
    if (k >= settling)
      for (std::size_t i = 0; i < 3; ++i)
        ratio[i] += Complex(0, 2.0 / period) * std::polar(1.0, -phase) * value[static_cast<int>(i)];
  }
  return ratio;
}

TEST(Bandwidth, HasTheGainAndThePhaseOfItsFormulaAtFiveFrequencies) {
  int compared = 0;
  for (const SensorFilter& filter : filters())
    for (const int hz : {1, 33, 150, 262, 900}) {
      const std::array<Complex, 3> ratio = measured(filter, hz);
      for (int axis = 0; axis < 3; ++axis, ++compared) {
        const Complex expected = frequency_response(filter, axis, rate_hz, hz),
                      seen = ratio[static_cast<std::size_t>(axis)];
        EXPECT_NEAR(std::abs(seen), std::abs(expected), 1e-6) << hz << " " << axis;
        if (std::abs(expected) > 1e-3) {
          EXPECT_NEAR(std::arg(seen / expected), 0, 1e-6) << hz << " " << axis;
        }
      }
    }
  EXPECT_EQ(compared, 6 * 5 * 3);
}

TEST(Bandwidth, IsThreeDecibelsDownAtTheCutOff) {
  for (const int order : {1, 2, 4})
    for (const int hz : {16, 262, 899})
      EXPECT_NEAR(std::abs(measured(low_pass(Vector3::Constant(hz), order), hz)[0]), std::sqrt(0.5), 1e-9)
          << order << " " << hz;
}

// A ramp is late by the group delay at frequency 0.
TEST(Bandwidth, DelaysARampByItsGroupDelay) {
  for (const SensorFilter& filter : filters()) {
    Unit unit(filter);
    Vector3 value, input;
    for (int k = 0; k < 20'000; ++k) {
      input = Vector3::Constant(k / rate_hz);
      value = vector_of(unit.take(input).value);
    }
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(input[axis] - value[axis], group_delay_s(filter, axis, rate_hz), 1e-11) << filter.order;
  }
  // A second-order filter far below the sample rate: sqrt(2)/(2 pi f_c).
  EXPECT_NEAR(group_delay_s(low_pass({16, 0, 0}, 2), 0, rate_hz) * 2 * M_PI * 16, std::sqrt(2.0), 1e-3);
  EXPECT_EQ(group_delay_s(boxcars(8, 3), 0, rate_hz), 3 * 3.5 / rate_hz);
}

TEST(Bandwidth, SettlesOnTheFirstValueOfARunAndAfterSeek) {
  const Vector3 first(3.3, -1e-7, 0.1), second(-7.7, 5e3, 1.7);
  for (const SensorFilter& filter : filters()) {
    Unit unit(filter);
    const double rounding = filter.length > 1 ? 1e-15 : 0;  // a mean of equal numbers may differ from them
    const auto is_settled_on = [&](const Vector3& value, bool begins_run) {
      for (int k = 0; k < 100; ++k) {
        const Vector3 out = vector_of(unit.take(value, begins_run && k == 0).value);
        for (int axis = 0; axis < 3; ++axis)
          EXPECT_LE(std::abs(out[axis] - value[axis]), rounding * std::abs(value[axis])) << filter.order << " " << k;
      }
    };
    is_settled_on(first, false);  // of power on
    is_settled_on(second, true);  // of a run
    unit.triad.seek(unit.normals, unit.k);
    is_settled_on(first, false);
    // Within a run a step takes time, except on an axis without a filter.
    const Vector3 out = vector_of(unit.take(second).value);
    EXPECT_GT((out - second).cwiseAbs().head<2>().minCoeff(), 1e-9);
  }
}

TEST(Bandwidth, LeavesTheIncrementsAndPrecedesTheRounding) {
  Unit unit(low_pass(Vector3::Constant(33), 2), 0.5);
  unit.take(Vector3::Zero());
  for (int k = 0; k < 100; ++k) {
    const TriadStep step = unit.take(Vector3::Constant(8));
    const double value = step.value[0];
    EXPECT_EQ(value, 0.5 * std::round(value / 0.5));
    // The rounding of the value takes at most half an LSB from the increment, or adds it.
    EXPECT_NEAR(step.increment[0] * rate_hz, 8, 0.25);
  }
}

TEST(Bandwidth, RecoversFromAValueThatIsNotFinite) {
  for (const SensorFilter& filter : filters()) {
    Unit unit(filter);
    for (const double value : {1.0, 1e308, -1e308, std::nan(""), 1.0}) unit.take(Vector3::Constant(value));
    for (int k = 0; k < 20'000; ++k) unit.take(Vector3::Constant(2));
    EXPECT_LT((vector_of(unit.take(Vector3::Constant(2)).value) - Vector3::Constant(2)).norm(), 1e-12)
        << filter.order;
  }
}

TEST(Bandwidth, TakesAnotherFilter) {
  TriadErrors none;
  Bandwidth bandwidth(none, Quantity::rate, 1 / rate_hz);
  EXPECT_FALSE(bandwidth.is_on());
  bandwidth.reserve(16);
  const auto settled_after = [&] {  // the number of samples after which a step is complete within 1e-9
    static const Vector3 zero = Vector3::Zero();
    const Normals normals(1, 1);
    int last = 0;
    for (int k = 0; k < 1000; ++k) {
      TriadStep step = {.normals = normals,
                        .k = 0,
                        .dt = 0,
                        .since_power_on = 0,
                        .specific_force = zero,
                        .delta_velocity = zero,
                        .value = lanes(Vector3::Constant(k == 0 ? 0 : 1)),
                        .increment = lanes(zero)};
      bandwidth.apply(step);
      if (k > 0 && std::abs(step.value[0] - 1) > 1e-9) last = k;
    }
    return last;
  };
  bandwidth.set(boxcars(16, 1));
  EXPECT_TRUE(bandwidth.is_on());
  EXPECT_EQ(settled_after(), 15);
  bandwidth.set(boxcars(5, 1));
  EXPECT_EQ(settled_after(), 4);
  bandwidth.set(boxcars(100, 1));  // more than the memory has
  EXPECT_EQ(settled_after(), 15);
  bandwidth.set(low_pass(Vector3::Constant(262), 2));
  EXPECT_GT(settled_after(), 20);
  bandwidth.set({});
  EXPECT_FALSE(bandwidth.is_on());
}

// A triad that had no effect beyond the memo's, which one test passes over.
TEST(Bandwidth, IsAppliedByATriadThatHadNone) {
  Triad triad(TriadErrors{}, Quantity::rate, 1 / rate_hz);
  triad.reserve_filter(4);
  const auto filtered = [&triad](double value) {
    static const Vector3 zero = Vector3::Zero();
    const Normals normals(1, 1);
    TriadStep step = {.normals = normals,
                      .k = 0,
                      .dt = 0,
                      .since_power_on = 0,
                      .specific_force = zero,
                      .delta_velocity = zero,
                      .value = lanes(Vector3::Constant(value)),
                      .increment = lanes(zero)};
    triad.apply(step);
    return step.value[0];
  };
  EXPECT_EQ(filtered(0), 0);
  EXPECT_EQ(filtered(1), 1);
  triad.set_filter(boxcars(4, 1));
  EXPECT_EQ(filtered(0), 0);
  EXPECT_EQ(filtered(1), 0.25);
  triad.set_filter({});
  EXPECT_EQ(filtered(8), 8);
}

}  // namespace
}  // namespace imud
