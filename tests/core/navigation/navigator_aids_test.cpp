// The aids of a unit's own filter beside fixes and magnetic headings.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>

#include "tests/core/navigation/navigating.hpp"

namespace imud {
namespace {

NavigatingUnit unit_with_barometer(double rate_hz = 10) {
  NavigatingUnit model = mems_unit();
  model.barometer.noise = 5;  // Pa: 0.4 m
  model.barometer.bias = 900;
  model.navigator.barometer_rate_hz = rate_hz;
  return model;
}

// In an outage of four minutes the free vertical channel drifts by tens of metres; the barometer holds it, whatever
// the weather.
TEST(NavigatorAids, TheBarometerHoldsTheHeight) {
  const auto outage = [](Sample& sample, double t) {
    if (t > 60 && t < 300) lose_fix(sample);
  };
  const auto largest = [&](const NavigatingUnit& model) {
    double height = 0;
    fly(model, 300, outage, [&](const Sample& sample, const Errors& errors, double t) {
      if (t < 60) return;
      height = std::max(height, std::abs(errors.position.z()));
      EXPECT_LT(std::abs(errors.position.z()), 5 * static_cast<double>(sample.solution->position.z())) << t;
    });
    return height;
  };
  EXPECT_GT(largest(unit_with_barometer(0)), 20);
  EXPECT_LT(largest(unit_with_barometer()), 5);
}

// With the random walk of the weather for which the filter allows, its covariance is the one of its errors.
TEST(NavigatorAids, HeightsAreConsistent) {
  NavigatingUnit model = unit_with_barometer();
  model.barometer.noise = 12;  // Pa: 1 m
  MeanSquares mean = mean_squares(model, 10, 40);
  EXPECT_LT(mean.height, 1.6);
  EXPECT_GT(mean.height, 0.4);
}

// A barometer that leaps by 100 m is rejected, and accepted with another offset: the height stays.
TEST(NavigatorAids, ALeapOfTheBarometerIsRejected) {
  const auto leap = [](Sample& sample, double t) {
    if (t > 60) sample.pressure -= 1200;
  };
  double used = 0, rejected = 0;
  const auto look = [&](const Sample& sample, const Errors& errors, double t) {
    if (t < 20) return;
    EXPECT_LT(std::abs(errors.position.z()), 5) << t;
    if (std::abs(t - 60) < 0.2 || std::abs(t - 70) < 0.3) return;
    const bool is_rejected = t > 60 && t < 70;
    EXPECT_EQ(sample.solution->rejected & aid::pressure, is_rejected ? aid::pressure : 0) << t;
    EXPECT_EQ(sample.solution->used & aid::pressure, is_rejected ? 0 : aid::pressure) << t;
  };
  fly(unit_with_barometer(), 100, leap, look, 1, in_time, turn_at, [&](const Navigator& navigator) {
    used = static_cast<double>(navigator.heights().used);
    rejected = static_cast<double>(navigator.heights().rejected);
  });
  EXPECT_NEAR(rejected, 101, 2);
  EXPECT_NEAR(used, 889, 4);
}

// Where the pressure is unknown no height is used.
TEST(NavigatorAids, NoPressureIsNoHeight) {
  const auto lose = [](Sample& sample, double) { sample.pressure = 0; };
  const auto look = [](const Sample&, const Errors&, double) {};
  fly(unit_with_barometer(), 5, lose, look, 1, in_time, turn_at,
      [](const Navigator& navigator) { EXPECT_EQ(navigator.heights().used + navigator.heights().rejected, 0U); });
}

// At rest for a minute, then straight on at 30 m/s, without a rotation or a vibration.
Truth stop_and_go(TruthTime time) {
  constexpr double begin = 60, end = 70, acceleration = 3;
  const double t = seconds(time - TruthTime{}), moved = std::clamp(t, begin, end) - begin;
  Truth truth;
  truth.time = time;
  truth.has_position = truth.has_velocity = truth.has_specific_force = true;
  truth.v_BN_N = {acceleration * moved, 0, 0};
  truth.r_BN_N = {0.5 * acceleration * moved * moved + acceleration * moved * std::max(0.0, t - end), 0, -100};
  truth.specific_force_B = {t > begin && t < end ? acceleration : 0, 0, -units::standard_gravity};
  return truth;
}

struct Stop {
  double error = 0;  // m, the largest of the position at rest
  std::uint64_t used_at_rest = 0, used = 0, rejected = 0;
};
Stop stop(bool zero_velocity, bool has_fixes) {
  NavigatingUnit model = mems_unit();
  model.navigator.zero_velocity = zero_velocity;
  Stop result;
  const auto outage = [&](Sample& sample, double t) {
    if (t > 10 && !has_fixes) lose_fix(sample);
  };
  const auto look = [&](const Sample&, const Errors& errors, double t) {
    if (t > 10 && t < 60) result.error = std::max(result.error, errors.position.norm());
  };
  const auto end = [&](const Navigator& navigator) {
    result.used = navigator.rests().used;
    result.rejected = navigator.rests().rejected;
  };
  fly(
      model, 59, outage, [](const Sample&, const Errors&, double) {}, 1, in_time, stop_and_go, end);
  result.used_at_rest = result.used;
  fly(model, 120, outage, look, 1, in_time, stop_and_go, end);
  return result;
}

// Fifty seconds without a fix: a vehicle that is found to be at rest stays where it is. In the smooth flight after it
// none is found at rest, where the receiver has its velocity, and where the solution alone has it.
TEST(NavigatorAids, RestHasNoVelocity) {
  const Stop without = stop(false, false), with = stop(true, false), fixed = stop(true, true);
  EXPECT_GT(without.error, 10);
  EXPECT_LT(with.error, 4);
  EXPECT_EQ(without.used, 0U);
  for (const Stop& one : {with, fixed}) {
    EXPECT_NEAR(static_cast<double>(one.used_at_rest), 58, 1);
    EXPECT_LE(one.used, one.used_at_rest + 1);
    EXPECT_GT(one.rejected, 40U);  // the sensors alone take it for rest
  }
}

// A unit at rest has coasted for 40 s, and its receiver comes back with a velocity, at a place that is rejected:
// by its own solution alone it would be at rest.
TEST(NavigatorAids, TheReceiverContradictsRest) {
  NavigatingUnit model = mems_unit();
  model.navigator.zero_velocity = true;
  const auto moving = [](Sample& sample, double t) {
    if (t > 10 && t < 50) return lose_fix(sample);
    if (t < 50) return;
    move(sample.navigation, {5000, 0, 0});
    sample.navigation.v_L.x() += 1;
  };
  const auto look = [](const Sample& sample, const Errors&, double t) {
    if (t > 20 && t < 50) {
      EXPECT_EQ(sample.solution->used & aid::zero_velocity, aid::zero_velocity) << t;
    } else if (t > 51.1) {
      EXPECT_EQ(sample.solution->rejected & aid::zero_velocity, aid::zero_velocity) << t;
    }
  };
  fly(model, 59, moving, look, 1, in_time, stop_and_go);
}

// Five minutes of smooth flight without a fix, by poor sensors: the velocity is off by tens of metres per second, so
// that its uncertainty alone would allow for rest.
TEST(NavigatorAids, AFastSolutionIsNotAtRest) {
  NavigatingUnit model = mems_unit();
  model.gyro.turn_on_bias = Vector3::Constant(0.01);
  model.accelerometer.turn_on_bias = Vector3::Constant(0.2);
  tune(model.navigator, model);
  model.navigator.zero_velocity = true;
  const auto outage = [](Sample& sample, double t) {
    if (t > 60) lose_fix(sample);
  };
  const auto fast = [](TruthTime time) {
    Truth truth = stop_and_go(time + std::chrono::seconds(80));
    truth.time = time;
    return truth;
  };
  const auto look = [](const Sample& sample, const Errors&, double t) {
    if (t > 3) {
      EXPECT_EQ(sample.solution->used & aid::zero_velocity, 0) << t;
    }
  };
  fly(model, 360, outage, look, 1, in_time, fast,
      [](const Navigator& navigator) { EXPECT_GT(navigator.rests().rejected, 200U); });
}

// A receiver whose errors are the same for ten minutes: the fixes together are no better than one.
TEST(NavigatorAids, SlowErrorsOfTheReceiverAreConsistent) {
  NavigatingUnit model = mems_unit();
  model.navigation.position = model.navigator.slow_position = {1.5, 1.5, 3};
  model.navigation.velocity = model.navigator.slow_velocity = {0.1, 0.1, 0.1};
  model.navigation.position_noise = model.navigator.position = {0.2, 0.2, 0.4};
  model.navigation.velocity_noise = model.navigator.velocity = {0.02, 0.02, 0.02};
  const auto look = [](const Sample& sample, const Errors&, double t) {
    if (t < 50) return;
    EXPECT_NEAR(static_cast<double>(sample.solution->position.x()), 1.5, 0.05) << t;
  };
  fly(model, 60, nullptr, look);
  const MeanSquares mean = mean_squares(model, 10, 60);
  // Two components of eight units, which hardly change: 16 squares.
  EXPECT_GT(mean.position, 0.3);
  EXPECT_LT(mean.position, 2.5);
  EXPECT_LT(mean.velocity, 2);
  EXPECT_LT(mean.tilt, 2);
  model.navigator.slow_position.setZero();
  EXPECT_GT(mean_squares(model, 10, 60).position, 10);
}

NavigatingUnit unit_with_antennas() {
  NavigatingUnit model = mems_unit();
  model.navigation.antennas_heading = 0.2 * units::degree;
  return model;
}

// At rest, without a magnetic field and without a course, two antennas give the heading; a unit with one never
// aligns.
TEST(NavigatorAids, AntennasGiveTheHeading) {
  const auto no_field = [](Sample& sample, double) { sample.magnetic_field.setZero(); };
  int aligned = 0;
  const auto look = [&](const Sample& sample, const Errors& errors, double t) {
    if (!sample.navigation.is_known) return;
    ++aligned;
    EXPECT_LT(std::abs(errors.attitude.z()), (t > 10 ? 0.2 : 1.0) * units::degree) << t;
    if (t < 1.5) return;
    EXPECT_LT(static_cast<double>(sample.solution->attitude.z()), 0.2 * units::degree) << t;
    EXPECT_TRUE(sample.solution->used & aid::antennas_heading) << t;
  };
  const auto end = [](const Navigator& navigator) {
    EXPECT_NEAR(static_cast<double>(navigator.antenna_headings().used), 145, 2);
    EXPECT_EQ(navigator.antenna_headings().rejected, 0U);
  };
  fly(unit_with_antennas(), 30, no_field, look, 1, in_time, stop_and_go, end);
  EXPECT_EQ(aligned, 1451);
  fly(mems_unit(), 30, no_field, look, 1, in_time, stop_and_go);
  EXPECT_EQ(aligned, 1451);
}

TEST(NavigatorAids, AntennasAreConsistent) {
  NavigatingUnit model = unit_with_antennas();
  model.navigator.magnetic_rate_hz = 0;
  const MeanSquares mean = mean_squares(model, 2, 30);
  EXPECT_GT(mean.heading, 0.4);
  EXPECT_LT(mean.heading, 1.7);
}

// Without a fix there is no heading either.
TEST(NavigatorAids, AntennasNeedAFix) {
  const auto outage = [](Sample& sample, double t) {
    if (t > 5) lose_fix(sample);
  };
  const auto look = [](const Sample& sample, const Errors&, double t) {
    if (t > 6) {
      EXPECT_EQ((sample.solution->used | sample.solution->rejected) & aid::antennas_heading, 0) << t;
    }
  };
  fly(unit_with_antennas(), 10, outage, look);
}

// Headings that are off for two minutes are accepted then, and the attitude has them; before, they are rejected. Two
// antennas, and a field that has turned, at rest without another heading.
TEST(NavigatorAids, HeadingsAreAcceptedInTheEnd) {
  constexpr double off = 0.5;  // rad
  for (const bool by_antennas : {true, false}) {
    SCOPED_TRACE(by_antennas);
    NavigatingUnit model = by_antennas ? unit_with_antennas() : mems_unit();
    if (by_antennas) model.navigator.magnetic_rate_hz = 0;
    const std::uint16_t heading = by_antennas ? aid::antennas_heading : aid::magnetic_heading;
    const auto turn = [&](Sample& sample, double t) {
      if (t <= 20) return;
      if (by_antennas) {
        AntennaLine& line = sample.navigation.antennas;
        line.direction_L = exp(Vector3(0, 0, off)) * line.direction_L;
      } else {
        sample.magnetic_field = exp(Vector3(0, 0, -off)) * sample.magnetic_field;
      }
    };
    const auto look = [&](const Sample& sample, const Errors& errors, double t) {
      if (t < 5 || std::abs(t - 20) < 0.3 || std::abs(t - 140) < 3) return;
      const bool is_rejected = t > 20 && t < 140;
      EXPECT_EQ(sample.solution->rejected & heading, is_rejected ? heading : 0) << t;
      EXPECT_NEAR(errors.attitude.z(), t < 140 ? 0 : off, t < 140 ? 0.1 : 0.05) << t;
      EXPECT_LT(errors.attitude.head<2>().norm(), 0.02) << t;
    };
    const auto stand = [](TruthTime time) {
      Truth truth = stop_and_go(TruthTime{});
      truth.time = time;
      return truth;
    };
    fly(model, 170, turn, look, 1, in_time, stand);
  }
}

}  // namespace
}  // namespace imud
