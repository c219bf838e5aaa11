#include "core/navigation/attitude_reference.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

using State = Solution::State;

constexpr double unit_dt = 0.02;
const Vector3 field_of_test(2e-5, 0, 4.4e-5);  // T, magnetic north, east, down

// The samples of a platform that turns at a constant rate in its own axes, in a field with a declination. `disturb`
// changes each sample before the unit has it.
struct AhrsFlight {
  Quaternion q_LP = exp(Vector3(0.1, -0.2, 0)) * exp(Vector3(0, 0, 1));
  Vector3 rate = Vector3::Zero();  // rad/s
  double declination = 0;          // rad
  std::function<void(Sample&, double)> disturb = nullptr;
  std::uint64_t k = 0;

  Sample next() {
    Sample sample;
    sample.time = DeviceTime{} + nanoseconds(unit_dt * static_cast<double>(k));
    sample.counter = k;
    const Vector3 up_L(0, 0, -units::standard_gravity);
    if (k > 0) {
      sample.delta_angle = unit_dt * rate;
      sample.delta_velocity = unit_dt * ((q_LP * exp(0.5 * sample.delta_angle)).conjugate() * up_L);
      q_LP = (q_LP * exp(sample.delta_angle)).normalized();
    }
    sample.rate = rate;
    sample.specific_force = q_LP.conjugate() * up_L;
    sample.q_LP = q_LP;
    sample.magnetic_field = q_LP.conjugate() * (exp(Vector3(0, 0, declination)) * field_of_test);
    if (disturb) disturb(sample, unit_dt * static_cast<double>(k));
    ++k;
    return sample;
  }
};

struct AhrsUnit : ImuModel {
  NavigatorModel navigator;
};

AhrsUnit ahrs_unit() {
  AhrsUnit unit;
  unit.rate_hz = 1 / unit_dt;
  unit.gyro.white_density = Vector3::Constant(1e-4);
  unit.gyro.turn_on_bias = Vector3::Constant(1e-3);
  unit.accelerometer.white_density = Vector3::Constant(1e-3);
  unit.gyro.random_walk_density = Vector3::Constant(1e-5);
  tune(unit.navigator, unit);
  unit.navigator.kind = NavigatorModel::Kind::attitude;
  return unit;
}

// Calls `look` with each sample of so long, the error of its attitude, rad about north, east, down, and the time, s.
void reckon(AttitudeReference& unit, AhrsFlight& flight, double seconds_long,
            const std::function<void(const Sample&, const Vector3&, double)>& look = nullptr) {
  for (int i = 0; i < seconds_long / unit_dt; ++i) {
    Sample sample = flight.next();
    const std::uint64_t allocated = allocations();
    unit.take(sample);
    EXPECT_EQ(allocations(), allocated);
    ASSERT_TRUE(sample.solution);
    if (look) look(sample, log(sample.q_LP * flight.q_LP.conjugate()), seconds(sample.time - DeviceTime{}));
  }
}

void add_bias(Sample& sample, const Vector3& bias) {
  sample.rate += bias;
  sample.delta_angle += unit_dt * bias;
}

TEST(AttitudeReference, AlignsAndFollows) {
  const AhrsUnit model = ahrs_unit();
  AttitudeReference unit(model.navigator, model);
  AhrsFlight flight;
  flight.rate = {0.3, -0.2, 0.1};
  flight.disturb = [](Sample& sample, double) { sample.navigation.r_E = {1, 2, 3}; };
  int aligning = 0;
  reckon(unit, flight, 60, [&](const Sample& sample, const Vector3& error, double t) {
    const Solution& solution = *sample.solution;
    EXPECT_EQ(sample.navigation.r_E, Vector3(1, 2, 3));  // its place stays
    EXPECT_EQ(solution.receiver.r_E, Vector3(1, 2, 3));
    EXPECT_LT(error.norm(), 0.02) << t;
    if (solution.state == State::aligning) {
      ++aligning;
      EXPECT_GT(solution.attitude.minCoeff(), 3);
      return;
    }
    EXPECT_EQ(solution.state, State::levelled);
    EXPECT_EQ(solution.used & aid::gravity, aid::gravity);
    if (t > 1.2) {
      EXPECT_EQ(solution.used, aid::gravity | aid::magnetic_heading);
    }
    EXPECT_EQ(solution.rejected, 0);
    for (int i = 0; i < 3; ++i)
      EXPECT_LT(std::abs(error[i]), 3 * static_cast<double>(solution.attitude[i]) + 1e-3) << t;
  });
  EXPECT_EQ(aligning, 50);
  EXPECT_EQ(unit.headings().used, 589U);
  EXPECT_EQ(unit.headings().rejected, 0U);
}

TEST(AttitudeReference, EstimatesTheBiasAtRest) {
  const AhrsUnit model = ahrs_unit();
  AttitudeReference unit(model.navigator, model);
  AhrsFlight flight;
  const Vector3 bias(1e-3, -2e-3, 1.5e-3);
  flight.disturb = [&](Sample& sample, double) { add_bias(sample, bias); };
  Eigen::Vector3f sigma;
  reckon(unit, flight, 300,
         [&](const Sample& sample, const Vector3&, double) { sigma = sample.solution->gyro_bias_sigma; });
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(unit.filter().gyro_bias_P()[i], bias[i], 5e-5) << i;
    EXPECT_LT(sigma[i], 3e-4F);
  }
}

// A step of 1 deg/s of a gyro's bias: the tilt rises for some tens of seconds, and falls as the filter learns it.
TEST(AttitudeReference, ABiasStepShowsAndDecays) {
  const AhrsUnit model = ahrs_unit();
  AttitudeReference unit(model.navigator, model);
  AhrsFlight flight;
  flight.q_LP = Quaternion::Identity();
  const double step = 1 * units::degree;
  flight.disturb = [&](Sample& sample, double t) {
    if (t > 300) add_bias(sample, {step, 0, 0});
  };
  double before = 0, largest = 0, at = 0, last = 0;
  reckon(unit, flight, 900, [&](const Sample&, const Vector3& error, double t) {
    last = error.head<2>().norm();
    if (t <= 300) {
      before = last;
    } else if (last > largest) {
      largest = last;
      at = t - 300;
    }
    if (t > 300 && t < 301) {
      EXPECT_NEAR(last, step * (t - 300), 0.1 * step);  // at first as the gyros have it
    }
  });
  EXPECT_LT(before, 1e-4);
  EXPECT_GT(largest, 5 * units::degree);
  EXPECT_LT(largest, 40 * units::degree);
  EXPECT_GT(at, 10);
  EXPECT_LT(at, 100);
  EXPECT_LT(last, 0.2 * units::degree);
  EXPECT_NEAR(unit.filter().gyro_bias_P().x(), step, 0.02 * step);
}

// A field that another turns by 60 degrees is rejected for ten seconds, and accepted then; so is one of twice the
// strength, whatever its direction.
TEST(AttitudeReference, RejectsADisturbedFieldAtFirst) {
  for (const bool turns : {true, false}) {
    const AhrsUnit model = ahrs_unit();
    AttitudeReference unit(model.navigator, model);
    AhrsFlight flight;
    flight.disturb = [&](Sample& sample, double t) {
      if ((t <= 60 || t > 68) && t <= 120) return;
      if (turns)
        sample.magnetic_field = sample.q_LP.conjugate() * (exp(Vector3(0, 0, -60 * units::degree)) * field_of_test);
      else
        sample.magnetic_field *= 2;
    };
    double largest = 0, last = 0;
    reckon(unit, flight, 140, [&](const Sample& sample, const Vector3& error, double t) {
      const bool is_disturbed = (t > 60.2 && t < 68) || (t > 120.2 && t < 130);
      const unsigned rejected = sample.solution->rejected;
      if (t > 2 && t < 130) {
        const bool is_at_edge = (t > 60 && t < 60.3) || (t > 67.9 && t < 68.3) || (t > 120 && t < 120.3);
        if (!is_at_edge) {
          EXPECT_EQ(rejected, is_disturbed ? unsigned{aid::magnetic_heading} : 0U) << t;
        }
        largest = std::max(largest, std::abs(error.z()));
      }
      last = error.z();
      if (t > 131) {
        EXPECT_EQ(rejected, 0U) << t;
      }
    });
    EXPECT_LT(largest, 0.5 * units::degree);
    EXPECT_NEAR(last, turns ? 60 * units::degree : 0, 3 * units::degree);
    EXPECT_NEAR(static_cast<double>(unit.headings().rejected), 180, 4);
  }
}

// Without a field the x axis points north at first, and the heading follows the gyros, bias and all.
TEST(AttitudeReference, DriftsFreelyWithoutAField) {
  const AhrsUnit model = ahrs_unit();
  AttitudeReference unit(model.navigator, model);
  AhrsFlight flight;
  flight.disturb = [](Sample& sample, double) {
    sample.magnetic_field.setZero();
    add_bias(sample, {0, 0, 1e-3});
  };
  const double first = yaw_pitch_roll_from_dcm(flight.q_LP.conjugate().toRotationMatrix())[0];
  reckon(unit, flight, 201, [&](const Sample& sample, const Vector3& error, double t) {
    const double heading = yaw_pitch_roll_from_dcm(sample.q_LP.conjugate().toRotationMatrix())[0];
    const double drift = t > 1 ? 1e-3 * (t - 1) : 0;
    EXPECT_NEAR(heading, drift, 0.02) << t;
    EXPECT_NEAR(error.z(), drift - first, 0.05) << t;
    EXPECT_GT(sample.solution->attitude.z(), 3);
    EXPECT_EQ(sample.solution->used & aid::magnetic_heading, 0);
  });
  EXPECT_EQ(unit.headings().used + unit.headings().rejected, 0U);
  // A field that comes later turns it at once.
  flight.disturb = nullptr;
  reckon(unit, flight, 5, [&](const Sample& sample, const Vector3& error, double t) {
    if (t > 202) {
      EXPECT_NEAR(error.z(), 0, 0.02) << t;
    }
    if (t > 204) {
      EXPECT_LT(sample.solution->attitude.z(), 0.03);
    }
  });
}

// A heading is magnetic where there is no place, and true where there is one.
TEST(AttitudeReference, KnowsTheDeclinationOfItsPlace) {
  AhrsUnit model = ahrs_unit();
  model.earth.frame = EarthModel::Frame::local;
  Navigation place;
  place.is_known = true;
  place.latitude = 40 * units::degree;
  place.longitude = -70 * units::degree;
  place.r_E = r_E_of({place.latitude, place.longitude, 0});
  const Vector3 field_L = Earth(model.earth).magnetic_field_L(place);
  const double declination = std::atan2(field_L.y(), field_L.x());
  EXPECT_LT(declination, -10 * units::degree);
  for (const bool is_known : {true, false}) {
    AttitudeReference unit(model.navigator, model);
    AhrsFlight flight;
    flight.declination = declination;
    flight.disturb = [&](Sample& sample, double) {
      if (is_known) sample.navigation = place;
    };
    reckon(unit, flight, 10, [&](const Sample&, const Vector3& error, double t) {
      EXPECT_NEAR(error.z(), is_known ? 0 : -declination, 0.01) << t;
    });
  }
}

// A new run, a power on and a long hold of the truth begin the alignment; a short hold does not.
TEST(AttitudeReference, AlignsAgain) {
  const AhrsUnit model = ahrs_unit();
  AttitudeReference unit(model.navigator, model);
  AhrsFlight flight;
  const auto aligning_in = [&](double seconds_long) {
    int aligning = 0;
    reckon(unit, flight, seconds_long, [&](const Sample& sample, const Vector3& error, double) {
      aligning += sample.solution->state == State::aligning ? 1 : 0;
      EXPECT_LT(error.norm(), 0.02);
    });
    return aligning;
  };
  EXPECT_EQ(aligning_in(5), 50);
  EXPECT_EQ(aligning_in(5), 0);
  unit.restart();
  EXPECT_EQ(aligning_in(5), 50);
  const auto hold = [&](double seconds_long) {
    flight.disturb = [](Sample& sample, double) { sample.status |= status::truth_stale; };
    EXPECT_EQ(aligning_in(seconds_long), 0);
    flight.disturb = nullptr;
    return aligning_in(5);
  };
  EXPECT_EQ(hold(0.9), 0);
  EXPECT_EQ(hold(1.2), 50);
}

// In free fall nothing is level: it aligns as soon as there is weight. A platform whose x axis is upright aligns as
// well, with a field and without.
TEST(AttitudeReference, AlignsInAnyAttitude) {
  const AhrsUnit model = ahrs_unit();
  AttitudeReference unit(model.navigator, model);
  AhrsFlight flight;
  flight.disturb = [](Sample& sample, double t) {
    if (t > 10) return;
    sample.specific_force.setZero();
    sample.delta_velocity.setZero();
  };
  reckon(unit, flight, 15, [&](const Sample& sample, const Vector3&, double t) {
    EXPECT_TRUE(std::abs(sample.q_LP.norm() - 1) < 1e-12) << t;
    if (t < 10.5) {
      EXPECT_EQ(sample.solution->state, State::aligning) << t;
    }
    if (t > 12.1) {
      EXPECT_EQ(sample.solution->state, State::levelled) << t;
    }
  });
  for (const bool has_field : {true, false}) {
    AttitudeReference upright(model.navigator, model);
    AhrsFlight on_the_pad;
    on_the_pad.q_LP = exp(Vector3(0, units::pi / 2, 0));
    on_the_pad.disturb = [&](Sample& sample, double) {
      if (!has_field) sample.magnetic_field.setZero();
    };
    reckon(upright, on_the_pad, 5, [&](const Sample& sample, const Vector3& error, double t) {
      EXPECT_LT(error.head<2>().norm(), 0.02) << t;
      if (has_field) {
        EXPECT_LT(error.norm(), 0.02) << t;
      }
      EXPECT_NEAR((sample.q_LP * Vector3::UnitX()).z(), -1, 1e-3);
    });
  }
}

TEST(AttitudeReference, BeginsAtTheTruth) {
  AhrsUnit model = ahrs_unit();
  model.navigator.alignment = NavigatorModel::Alignment::truth;
  AttitudeReference unit(model.navigator, model);
  AhrsFlight flight;
  flight.declination = 0.2;  // which it then knows
  flight.rate = {0.1, 0.2, 0.3};
  reckon(unit, flight, 30, [](const Sample& sample, const Vector3& error, double t) {
    EXPECT_EQ(sample.solution->state, State::levelled);
    EXPECT_LT(error.norm(), 2e-3) << t;
  });
}

}  // namespace
}  // namespace imud
