#include "core/navigation/navigator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "tests/core/navigation/navigating.hpp"

namespace imud {
namespace {

using State = Solution::State;

TEST(Navigator, AlignsAndConverges) {
  int aligning = 0, aided = 0, outside = 0, judged = 0;
  fly(mems_unit(), 120, nullptr, [&](const Sample& sample, const Errors& errors, double t) {
    aligning += sample.solution->state == State::aligning ? 1 : 0;
    aided += sample.solution->state == State::aided ? 1 : 0;
    EXPECT_EQ(sample.navigation.is_known, sample.solution->state != State::aligning);
    EXPECT_TRUE(sample.fix().is_known);
    if (t < 60) return;
    EXPECT_LT(errors.attitude.head<2>().norm(), 0.5 * units::degree) << t;
    EXPECT_LT(std::abs(errors.attitude.z()), 2 * units::degree) << t;
    EXPECT_LT(errors.velocity.norm(), 0.2) << t;
    EXPECT_LT(errors.position.norm(), 3) << t;
    for (int i = 0; i < 3; ++i) {
      ++judged;
      if (std::abs(errors.position[i]) > 3 * static_cast<double>(sample.solution->position[i])) ++outside;
    }
  });
  EXPECT_EQ(aligning, 50);  // a second of them
  EXPECT_EQ(aided, 5951);
  EXPECT_EQ(judged, 3 * 3001);
  EXPECT_LT(outside, judged / 20);
}

// An outage of 30 s: the solution goes on, its uncertainty grows, and the first fix after it is used.
TEST(Navigator, CoastsThroughAnOutage) {
  const auto outage = [](Sample& sample, double t) {
    if (t > 60 && t < 90) lose_fix(sample);
  };
  int coasting = 0;
  double largest = 0, sigma_before = 0, sigma_in = 0;
  std::int64_t last_gps_ns = 0;
  fly(mems_unit(), 120, outage, [&](const Sample& sample, const Errors& errors, double t) {
    if (sample.solution->state == State::aligning) return;
    ASSERT_TRUE(sample.navigation.is_known) << t;
    EXPECT_GT(sample.navigation.gps_ns, last_gps_ns);
    last_gps_ns = sample.navigation.gps_ns;
    const auto sigma = static_cast<double>(sample.solution->position.head<2>().norm());
    if (t > 61.5 && t < 90) {
      EXPECT_EQ(sample.solution->state, State::coasting) << t;
      EXPECT_EQ(sample.navigation.satellites, 0);
      ++coasting;
      largest = std::max(largest, errors.position.norm());
      sigma_in = sigma;
    } else if (t < 60) {
      sigma_before = sigma;
    } else if (t > 95) {
      EXPECT_EQ(sample.solution->state, State::aided) << t;
      EXPECT_LT(errors.position.norm(), 5) << t;
    }
  });
  EXPECT_NEAR(coasting, 1424, 1);
  EXPECT_GT(sigma_in, 5 * sigma_before);
  EXPECT_GT(largest, 1);
  EXPECT_LT(largest, 8 * sigma_in);
}

// A jump of 300 m is rejected at first, and accepted after ten seconds of rejections alone.
TEST(Navigator, RejectsAJumpAtFirst) {
  const auto jump = [](Sample& sample, double t) {
    if (t > 60) move(sample.navigation, {300, 0, 0});
  };
  fly(mems_unit(), 100, jump, [&](const Sample&, const Errors& errors, double t) {
    if (t > 60 && t < 69.5) {
      EXPECT_LT(errors.position.norm(), 20) << t;
    } else if (t > 80) {
      EXPECT_NEAR(errors.position.x(), 300, 20) << t;
    }
  });
}

// 8 deg/s on a gyro for 8 s: the solution leaves the truth by tens of degrees, so far that it rejects the fixes, and
// begins again with another attitude after ten seconds of rejections. The place has no gap.
TEST(Navigator, AGyroFaultShowsInTheAttitude) {
  const double bias = 8 * units::degree;
  for (int axis = 0; axis < 3; ++axis) {
    const auto fault = [&](Sample& sample, double t) {
      if (t <= 60 || t > 68) return;
      sample.rate[axis] += bias;
      sample.delta_angle[axis] += 0.02 * bias;
    };
    double before = 0, largest = 0, after = 0, far = 0;
    int aligning = 0;
    fly(mems_unit(), 130, fault, [&](const Sample& sample, const Errors& errors, double t) {
      aligning += t > 2 && !sample.navigation.is_known ? 1 : 0;
      if (t > 50 && t <= 60) before = std::max(before, errors.attitude.norm());
      if (t > 60) largest = std::max(largest, errors.attitude.norm());
      if (t > 90) after = std::max(after, errors.attitude.norm());
      if (t > 90) far = std::max(far, errors.position.norm());
    });
    EXPECT_LT(before, 3 * units::degree) << axis;
    EXPECT_GT(largest, 10 * units::degree) << axis;
    EXPECT_LT(after, 5 * units::degree) << axis;
    EXPECT_LT(far, 10) << axis;
    EXPECT_EQ(aligning, 0) << axis;
  }
}

// A late fix is compared with the motion of its time: at 20 m/s a latency of 0.2 s would be 4 m.
TEST(Navigator, AllowsForLatency) {
  NavigatingUnit model = ideal_unit();
  model.navigation.latency = std::chrono::milliseconds(200);
  tune(model.navigator, model);
  fly(model, 60, nullptr, [&](const Sample&, const Errors& errors, double t) {
    EXPECT_LT(errors.position.norm(), t > 40 ? 0.3 : 1e9) << t;
  });
}

// Five fixes a second, each a second late: what one has corrected is no error in the next.
TEST(Navigator, LateFixesCountOnce) {
  NavigatingUnit model = mems_unit();
  model.navigation.latency = std::chrono::seconds(1);
  const MeanSquares mean = mean_squares(model, 20, 60);
  EXPECT_LT(mean.position, 2);
  EXPECT_LT(mean.velocity, 3);
  EXPECT_LT(mean.tilt, 2);
}

// In the turn the velocity changes by 1 m/s in half a second.
TEST(Navigator, BeginsWithTheVelocityOfNow) {
  NavigatingUnit model = mems_unit();
  model.navigation.latency = std::chrono::milliseconds(500);
  bool has_begun = false;
  fly(model, 2, nullptr, [&](const Sample& sample, const Errors& errors, double t) {
    if (!sample.navigation.is_known || has_begun) return;
    has_begun = true;
    EXPECT_LT(errors.velocity.norm(), 0.4) << t;
    EXPECT_LT(errors.position.norm(), 6) << t;
  });
  EXPECT_TRUE(has_begun);
}

// Where the field is steep, a tilt turns its horizontal part by a multiple of itself.
TEST(Navigator, AllowsForTiltInHeadings) {
  NavigatingUnit model = mems_unit();
  model.earth.latitude = 75 * units::degree;
  model.navigator.heading = 0.2 * units::degree;
  model.magnetometer.white_density = Vector3::Constant(2e-9);
  const MeanSquares mean = mean_squares(model, 1, 10);
  EXPECT_LT(mean.heading, 2);
  EXPECT_LT(mean.tilt, 2);
}

// The uncertainty after an outage is the covariance's: a fix that it does not allow is no better than before.
TEST(Navigator, RejectsALeapAfterAnOutage) {
  const auto leap = [](Sample& sample, double t) {
    if (t > 60 && t < 80) return lose_fix(sample);
    if (t >= 80) move(sample.navigation, {2000, 0, 0});
  };
  fly(mems_unit(), 95, leap, [&](const Sample&, const Errors& errors, double t) {
    if (t > 60 && t < 89.5) {
      EXPECT_LT(errors.position.norm(), 500) << t;
    } else if (t > 93) {
      EXPECT_NEAR(errors.position.x(), 2000, 100) << t;
    }
  });
}

// Truth stops for three seconds: the solution is held after the first, and aligns again.
TEST(Navigator, HoldsWithTheTruth) {
  const auto stop = [](Sample& sample, double t) {
    if (t >= 30 && t < 33) sample.status |= status::truth_stale;
  };
  std::optional<Vector3> held;
  int aligning = 0;
  fly(mems_unit(), 40, stop, [&](const Sample& sample, const Errors&, double t) {
    if (t >= 31.1 && t < 33) {
      EXPECT_TRUE(sample.navigation.is_known);
      EXPECT_EQ(sample.navigation.r_E, held.value_or(sample.navigation.r_E)) << t;
      held = sample.navigation.r_E;
    }
    if (t > 2 && sample.solution->state == State::aligning) ++aligning;
  });
  EXPECT_TRUE(held);
  EXPECT_NEAR(aligning, 50, 1);
}

// The simulator stands still for half a second: the unit has gone on by 10 m meanwhile, which no fix would allow for
// ten seconds. It aligns again.
TEST(Navigator, AlignsAfterAPauseOfTheSimulator) {
  const auto simulated = [](Nanoseconds time) -> Nanoseconds {
    const Nanoseconds begin = std::chrono::seconds(30), pause = std::chrono::milliseconds(500);
    return time < begin ? time : std::max(begin, time - pause);
  };
  int aligning = 0, judged = 0;
  const auto look = [&](const Sample& sample, const Errors& errors, double t) {
    if (t > 2 && sample.solution->state == State::aligning) ++aligning;
    if (t < 32 || t > 39) return;
    ++judged;
    EXPECT_LT(errors.position.norm(), 6) << t;
  };
  fly(mems_unit(), 40, nullptr, look, 1, simulated);
  EXPECT_NEAR(aligning, 50, 1);
  EXPECT_EQ(judged, 351);
}

// A solution that has left the Earth is none, and the true attitude does not take its place.
TEST(Navigator, NoTruthShowsWhereTheSolutionIsLost) {
  const auto fall = [](Sample& sample, double t) {
    if (t < 5) return;
    lose_fix(sample);
    sample.delta_velocity.z() += 4000;  // m/s in each step
  };
  int lost = 0;
  fly(mems_unit(), 10, fall, [&](const Sample& sample, const Errors&, double t) {
    if (t < 8) return;
    EXPECT_EQ(sample.solution->state, State::aligning);
    EXPECT_FALSE(sample.fix().is_known);
    EXPECT_GT(sample.solution->attitude.x(), 3);
    ++lost;
  });
  EXPECT_EQ(lost, 101);
}

// Without a magnetic field the first heading is the course, and the turn makes it observable.
TEST(Navigator, AlignsByItsCourse) {
  const auto no_field = [](Sample& sample, double) { sample.magnetic_field.setZero(); };
  int known = 0;
  fly(mems_unit(), 60, no_field, [&](const Sample& sample, const Errors& errors, double t) {
    known += sample.navigation.is_known ? 1 : 0;
    EXPECT_LT(std::abs(errors.attitude.z()), (t > 30 ? 3 : 360) * units::degree) << t;
  });
  EXPECT_EQ(known, 2951);
}

// Before a fix there is no place, and the attitude is level by the apparent gravity, which leans by the turn's bank
// of 11.5 degrees.
TEST(Navigator, LevelsWithoutAFix) {
  fly(
      mems_unit(), 10, [](Sample& sample, double) { lose_fix(sample); },
      [](const Sample& sample, const Errors& errors, double t) {
        EXPECT_FALSE(sample.navigation.is_known);
        EXPECT_EQ(sample.solution->state, State::aligning);
        EXPECT_NEAR(errors.attitude.head<2>().norm(), 11.5 * units::degree, 2 * units::degree) << t;
      });
}

TEST(Navigator, BeginsAtTheTruth) {
  NavigatingUnit model = ideal_unit();
  model.navigator.alignment = NavigatorModel::Alignment::truth;
  model.navigator.gnss_rate_hz = model.navigator.magnetic_rate_hz = 0;
  tune(model.navigator, model);
  fly(model, 60, nullptr, [&](const Sample& sample, const Errors& errors, double t) {
    EXPECT_EQ(sample.solution->state, State::coasting);
    EXPECT_LT(errors.position.norm(), 1e-3 + 1e-5 * t * t) << t;
    EXPECT_LT(errors.attitude.norm(), 1e-6) << t;
  });
}

TEST(Navigator, TunesBySensors) {
  NavigatingUnit model = mems_unit();
  EXPECT_DOUBLE_EQ(model.navigator.noise.gyro, 1e-4);
  EXPECT_DOUBLE_EQ(model.navigator.noise.accelerometer, 1e-3);
  EXPECT_DOUBLE_EQ(model.navigator.gyro_bias, 1e-3);
  model.gyro.random_walk_density = Vector3(1e-6, 3e-6, 2e-6);
  model.gyro.bias = {0, 0, 2e-3};
  tune(model.navigator, model);
  EXPECT_DOUBLE_EQ(model.navigator.noise.gyro_walk, 3e-6);
  EXPECT_DOUBLE_EQ(model.navigator.gyro_bias, std::sqrt(5e-6));
  // Scale factors, misalignments and g-sensitivity, with their biases in gravity.
  model.accelerometer.unit_sigma.scale_factor = Vector3::Constant(3e-3);
  model.accelerometer.unit_sigma.misalignment(1, 2) = 4e-3;
  model.gyro.g_sensitivity(0, 2) = 1e-3;
  model.gyro.scale_factor.x() = 1.002;
  tune(model.navigator, model);
  EXPECT_DOUBLE_EQ(model.navigator.noise.accelerometer_scale, 5e-3);
  EXPECT_NEAR(model.navigator.noise.gyro_scale, 2e-3, 1e-15);
  EXPECT_DOUBLE_EQ(model.navigator.noise.g_sensitivity, 1e-3);
  const double g = units::standard_gravity;
  EXPECT_NEAR(model.navigator.accelerometer_bias, std::hypot(0.02, 5e-3 * g), 1e-12);
  EXPECT_NEAR(model.navigator.gyro_bias, std::sqrt(5e-6 + 1e-6 * g * g), 1e-12);
  // A filter that estimates the scale factors has the rest for noise and bias.
  EXPECT_NEAR(model.navigator.gyro_scale_factor, 2e-3, 1e-15);
  EXPECT_DOUBLE_EQ(model.navigator.accelerometer_scale_factor, 3e-3);
  EXPECT_DOUBLE_EQ(model.navigator.noise.gyro_misalignment, 0);
  EXPECT_DOUBLE_EQ(model.navigator.noise.accelerometer_misalignment, 4e-3);
  EXPECT_NEAR(model.navigator.accelerometer_bias_beside_scale, std::hypot(0.02, 4e-3 * g), 1e-12);
}

}  // namespace
}  // namespace imud
