// Delta-angle and delta-velocity add up to the whole motion, whatever the rates of truth and sensor.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"
#include "tests/core/body_motion.hpp"
#include "tests/core/drive.hpp"
#include "tools/truth/motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

const IntegratedMotion& smooth() {
  static const IntegratedMotion motion(smooth_motion(), 4.0);
  return motion;
}
Truth smooth_truth(TruthTime t) { return smooth().truth(t); }

ImuModel model_of(DeltaAngle delta_angle, DeltaVelocity delta_velocity) {
  ImuModel model;
  model.r_SB_B = {0.5, -0.3, 0.8};
  model.dcm_PB = dcm_from_yaw_pitch_roll(0.5, -0.3, 2.0);
  model.delta_angle = delta_angle;
  model.delta_velocity = delta_velocity;
  return model;
}

struct SumRates {
  std::string name;
  double truth_hz, sensor_hz;
  bool jitter = false;
};

// The truths' instants: on their grid or scattered about it, and also at the sensor's last instant, so that the sums
// are known exactly.
std::vector<TruthTime> truth_times(const SumRates& rates, TruthTime last) {
  std::vector<TruthTime> times = instants(rates.truth_hz, last - TruthTime{});
  if (rates.jitter) {
    std::mt19937 random(3);
    const auto half = static_cast<std::int64_t>(0.45e9 / rates.truth_hz);
    for (TruthTime& t : times)
      if (t.ns > 0) t.ns += static_cast<std::int64_t>(random()) % (2 * half) - half;
  }
  std::erase_if(times, [&](TruthTime t) { return t >= last; });
  times.push_back(last);
  return times;
}

class Sums : public ::testing::TestWithParam<SumRates> {
 protected:
  const std::vector<TruthTime> sensor = instants(GetParam().sensor_hz, 3s);
  const TruthTime last = sensor.back();
  const double T = seconds(last - TruthTime{});
  // The accuracy of interpolation and quadrature, both of which go from truth to truth.
  const double h = 1.0 / GetParam().truth_hz;

  template <class TruthAt>
  std::vector<Sample> samples(const ImuModel& model, TruthAt truth_at) const {
    std::vector<Sample> result = drive(model, truth_at, truth_times(GetParam(), last), sensor);
    EXPECT_EQ(result.size(), sensor.size());
    return result;
  }
};

TEST_P(Sums, RotationVectorsComposeToTheWholeRotation) {
  const ImuModel model = model_of(DeltaAngle::rotation_vector, DeltaVelocity::end_frame);
  for (const auto truth_at : {smooth_truth, coning_truth}) {
    Quaternion q_NB = truth_at({}).q_NB;
    for (const Sample& sample : samples(model, truth_at))
      q_NB = q_NB * exp(model.dcm_PB.transpose() * sample.delta_angle);
    EXPECT_LT(angle_between(q_NB, truth_at(last).q_NB), 1e-12);
  }
}

// sum of C_NP(t_k) dv_k = V_S(T) - V_S(0), where V_S includes the lever arm's own velocity.
TEST_P(Sums, EndFrameVelocitiesTelescope) {
  const ImuModel model = model_of(DeltaAngle::rotation_vector, DeltaVelocity::end_frame);
  Quaternion q_NB = smooth_truth({}).q_NB;
  Vector3 sum_N = Vector3::Zero();
  for (const Sample& sample : samples(model, smooth_truth)) {
    q_NB = q_NB * exp(model.dcm_PB.transpose() * sample.delta_angle);
    sum_N += q_NB * (model.dcm_PB.transpose() * sample.delta_velocity);
  }
  const auto lever_N = [&](double t) {
    return Vector3(smooth().q_NB(t) * smooth().omega_BN_B(t).cross(model.r_SB_B));
  };
  EXPECT_LT((sum_N - (smooth().dv_N(T) + lever_N(T) - lever_N(0.0))).norm(), 1e-11);
}

TEST_P(Sums, IntegralOfTheRate) {
  const ImuModel model = model_of(DeltaAngle::integral, DeltaVelocity::end_frame);
  Vector3 sum = Vector3::Zero();
  for (const Sample& sample : samples(model, smooth_truth)) sum += model.dcm_PB.transpose() * sample.delta_angle;
  EXPECT_LT((sum - smooth_rate_integral(T)).norm(), 1e-13 + 5e-3 * std::pow(h, 4));
}

TEST_P(Sums, IntegralOfTheForce) {
  ImuModel model = model_of(DeltaAngle::rotation_vector, DeltaVelocity::integral);
  model.r_SB_B.setZero();
  Vector3 sum = Vector3::Zero();
  for (const Sample& sample : samples(model, smooth_truth)) sum += model.dcm_PB.transpose() * sample.delta_velocity;
  EXPECT_LT((sum - smooth_force_integral(T)).norm(), 1e-13 + 1e-2 * std::pow(h, 4));
}

TEST_P(Sums, IntegralOfTheForceOnALeverArm) {
  const ImuModel model = model_of(DeltaAngle::rotation_vector, DeltaVelocity::integral);
  Vector3 sum = Vector3::Zero();
  for (const Sample& sample : samples(model, smooth_truth)) sum += model.dcm_PB.transpose() * sample.delta_velocity;
  Vector3 exact = smooth_force_integral(T) + (smooth().omega_BN_B(T) - smooth().omega_BN_B(0)).cross(model.r_SB_B);
  constexpr int n = 1000;  // Simpson
  for (int i = 0; i <= 2 * n; ++i) {
    const Vector3 omega = smooth().omega_BN_B(T * i / (2 * n));
    const double weight = i == 0 || i == 2 * n ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
    exact += weight * T / (6 * n) * omega.cross(omega.cross(model.r_SB_B));
  }
  EXPECT_LT((sum - exact).norm(), 1e-12 + 1e-2 * std::pow(h, 4));
}

// A strapdown navigator that uses the attitude in the middle of each step finds the velocity of the truth, except for
// the second-order terms that it neglects, such as sculling.
TEST_P(Sums, NavigatedVelocity) {
  ImuModel model = model_of(DeltaAngle::rotation_vector, DeltaVelocity::integral);
  model.r_SB_B.setZero();
  Quaternion q_NB = smooth_truth({}).q_NB;
  Vector3 sum_N = Vector3::Zero();
  for (const Sample& sample : samples(model, smooth_truth)) {
    const Vector3 phi = model.dcm_PB.transpose() * sample.delta_angle;
    sum_N += q_NB * exp(0.5 * phi) * (model.dcm_PB.transpose() * sample.delta_velocity);
    q_NB = q_NB * exp(phi);
  }
  const double step = 1.0 / GetParam().sensor_hz;
  EXPECT_LT((sum_N - smooth().dv_N(T)).norm(), 1e-12 + 0.1 * step * step + 1e-2 * std::pow(h, 4));
}

INSTANTIATE_TEST_SUITE_P(
    Rates, Sums,
    ::testing::Values(SumRates{"equal", 100, 100}, SumRates{"equal_slow", 20, 20},
                      SumRates{"truth_faster", 1000, 100}, SumRates{"truth_much_faster", 1000, 7},
                      SumRates{"truth_slower", 100, 1000}, SumRates{"truth_much_slower", 10, 1000},
                      SumRates{"two_to_three", 200, 300}, SumRates{"incommensurate", 333.333, 77.7},
                      SumRates{"incommensurate_slow", 23.976, 819.2}, SumRates{"jitter", 100, 100, true},
                      SumRates{"jitter_fast_truth", 1000, 59.94, true}, SumRates{"jitter_slow_truth", 50, 400, true}),
    [](const auto& test) { return test.param.name; });

// --- Truth that comes late
// ------------------------------------------------------------------------------------------

// Truths arrive `delay` after their time, and not at all for a while: samples are extrapolated and held, and later
// samples correct the sums.
class LateTruth : public ::testing::TestWithParam<Nanoseconds> {
 protected:
  std::vector<Sample> samples(const ImuModel& model) const {
    Timeline::Limits limits;
    limits.extrapolate = 40ms;
    Timeline timeline(limits);
    Imu imu(model, 1, 1);
    std::vector<Sample> result;
    TruthTime next_truth = {};
    const auto push_until = [&](TruthTime now, Nanoseconds delay) {
      for (; next_truth + delay <= now; next_truth = next_truth + 10ms) {
        const bool outage = next_truth > TruthTime{1'000'000'000} && next_truth < TruthTime{1'300'000'000};
        if (!outage) timeline.push(smooth_truth(next_truth));
      }
    };
    push_until({}, 0ns);
    for (const TruthTime t : instants(400.0, 2s)) {
      push_until(t, t == TruthTime{2'000'000'000} ? 0ns : GetParam());
      result.push_back(imu.sample(timeline, t, {}));
    }
    return result;
  }
};

TEST_P(LateTruth, SumsTelescopeAgain) {
  const ImuModel model = model_of(DeltaAngle::rotation_vector, DeltaVelocity::end_frame);
  Quaternion q_NB = smooth_truth({}).q_NB;
  Vector3 sum_N = Vector3::Zero();
  for (const Sample& sample : samples(model)) {
    q_NB = q_NB * exp(model.dcm_PB.transpose() * sample.delta_angle);
    sum_N += q_NB * (model.dcm_PB.transpose() * sample.delta_velocity);
  }
  const auto lever_N = [&](double t) {
    return Vector3(smooth().q_NB(t) * smooth().omega_BN_B(t).cross(model.r_SB_B));
  };
  EXPECT_LT(angle_between(q_NB, smooth().q_NB(2.0)), 1e-12);
  EXPECT_LT((sum_N - (smooth().dv_N(2.0) + lever_N(2.0) - lever_N(0.0))).norm(), 1e-11);
}

// The integrals have no exact sum here: the error of an outage of 0.3 s in body axes (with the lever arm's
// centripetal force) is corrected by one increment along the chord.
TEST_P(LateTruth, IntegralsAreNearlyRightAgain) {
  ImuModel model = model_of(DeltaAngle::integral, DeltaVelocity::integral);
  model.r_SB_B.setZero();
  Vector3 angle = Vector3::Zero(), velocity = Vector3::Zero();
  for (const Sample& sample : samples(model)) {
    angle += model.dcm_PB.transpose() * sample.delta_angle;
    velocity += model.dcm_PB.transpose() * sample.delta_velocity;
  }
  EXPECT_LT((angle - smooth_rate_integral(2.0)).norm(), 5e-4);
  EXPECT_LT((velocity - smooth_force_integral(2.0)).norm(), 2e-2);
}

TEST_P(LateTruth, IsFlagged) {
  const std::vector<Sample> all = samples(model_of(DeltaAngle::rotation_vector, DeltaVelocity::integral));
  for (const Sample& sample : all) {
    const auto k = static_cast<std::int64_t>(sample.counter);
    const Nanoseconds now = k * 2'500us;
    Nanoseconds newest = (now - (k == 800 ? 0ns : GetParam())) / 10ms * 10ms;
    if (newest < 0ns) newest = 0ns;
    if (newest > 1s && newest < 1300ms) newest = 1s;  // the outage
    EXPECT_EQ((sample.status & status::truth_extrapolated) != 0, now > newest) << now.count();
    EXPECT_EQ((sample.status & status::truth_stale) != 0, now > newest + 40ms) << now.count();
  }
}

INSTANTIATE_TEST_SUITE_P(Delays, LateTruth,
                         ::testing::Values(0ns, Nanoseconds(4ms), Nanoseconds(25ms), Nanoseconds(60ms)));

// Truths every 100 ms, the vehicle nodding by 0.1 rad at 300 ms and back: without that truth nothing moves.
TEST(InsertedTruth, CorrectsTheIncrementsOfTheCurveThatItChanges) {
  const auto nod = [](std::int64_t ms, double angle, double acceleration) {
    Truth truth;
    truth.time.ns = ms * 1'000'000;
    truth.sequence = static_cast<std::uint32_t>(ms / 100);
    truth.q_NB = exp(Vector3(0, angle, 0));
    truth.has_angular_acceleration = true;
    truth.omegaDot_BN_B = {0, acceleration, 0};
    return truth;
  };
  for (const auto angle : {DeltaAngle::rotation_vector, DeltaAngle::integral}) {
    ImuModel model;
    model.delta_angle = angle;
    Imu imu(model, 1, 1);
    Timeline timeline;
    const auto turned = [&](std::int64_t ms) { return imu.sample(timeline, {ms * 1'000'000}, {}).delta_angle.y(); };
    timeline.push(nod(200, 0.0, 60.0));  // of the cubic curve from here to 300 ms
    timeline.push(nod(400, 0.0, 60.0));
    EXPECT_EQ(turned(200), 0.0);
    EXPECT_NEAR(turned(250), 0.0, 1e-15);
    ASSERT_EQ(timeline.push(nod(300, 0.1, -60.0), TruthTime{250'000'000}), Admission::inserted);
    EXPECT_NEAR(turned(350), 0.05, 1e-12) << "0.05 of it should have come with the sample before";
    EXPECT_NEAR(turned(400), -0.05, 1e-12);
  }
}

// --- advance()
// -------------------------------------------------------------------------------------------------------

TEST(Advance, ChangesNothing) {
  for (const auto angle : {DeltaAngle::rotation_vector, DeltaAngle::integral})
    for (const auto velocity : {DeltaVelocity::integral, DeltaVelocity::memo, DeltaVelocity::end_frame}) {
      const ImuModel model = model_of(angle, velocity);
      Timeline timeline;
      Imu with(model, 1, 1), without(model, 1, 1);
      for (std::int64_t ms = 0; ms <= 3000; ++ms) {
        const TruthTime t{ms * 1'000'000};
        timeline.push(smooth_truth(t));
        with.advance(timeline, t);
        if (ms % 9 == 0) with.advance(timeline, t - 500us);  // already there
        if (ms % 50 != 0) continue;
        const Sample a = with.sample(timeline, t, {}), b = without.sample(timeline, t, {});
        ASSERT_EQ(a.delta_angle, b.delta_angle);
        ASSERT_EQ(a.delta_velocity, b.delta_velocity);
      }
    }
}

TEST(Advance, NotBeyondTheNewestTruth) {
  Timeline timeline;
  Imu imu(model_of(DeltaAngle::integral, DeltaVelocity::memo), 1, 1);
  for (const std::int64_t ms : {0, 10, 20}) timeline.push(smooth_truth({ms * 1'000'000}));
  imu.sample(timeline, {}, {});
  imu.advance(timeline, {10'000'000});
  EXPECT_EQ(imu.advanced_to().ns, 10'000'000);
  imu.advance(timeline, {20'000'001});
  EXPECT_EQ(imu.advanced_to().ns, 10'000'000);
}

// More truths in a step than the timeline keeps.
TEST(Advance, ReachesBeyondTheTimeline) {
  const ImuModel model = model_of(DeltaAngle::integral, DeltaVelocity::memo);
  const auto first_step = [&](bool advance) {
    Timeline timeline;
    Imu imu(model, 1, 1);
    for (std::int64_t k = 0; k <= 20'000; ++k) {  // 10 kHz
      const TruthTime t{k * 100'000};
      timeline.push(coning_truth(t));
      if (k == 0) imu.sample(timeline, t, {});
      if (advance && k > 0) imu.advance(timeline, t);
    }
    return imu.sample(timeline, {2'000'000'000}, {});
  };
  // -w (1 - cos a) about z; 20 whole turns of the cone leave nothing about x and y.
  const Vector3 exact(0.0, 0.0, -2.0 * 62.83185307179586 * (1.0 - std::cos(0.02)));
  EXPECT_LT((model.dcm_PB.transpose() * first_step(true).delta_angle - exact).norm(), 1e-12);
  EXPECT_GT((model.dcm_PB.transpose() * first_step(false).delta_angle - exact).norm(), 1e-3);
}

// --- Edges of a run
// -------------------------------------------------------------------------------------------------

TEST(Run, StepsBeforeTheOldestTruthHaveTheirLength) {
  ImuModel model;
  model.gyro.bias = {0.1, 0.2, 0.3};
  Timeline timeline;
  Truth truth;
  truth.time.ns = 1'000'000'000;
  timeline.push(truth);
  Imu imu(model, 1, 1);
  for (std::int64_t ms = 0; ms < 2000; ms += 10) {
    const Sample sample = imu.sample(timeline, {ms * 1'000'000}, {});
    ASSERT_LT((sample.delta_angle - (ms > 0 ? 0.01 : 0.0) * model.gyro.bias).norm(), 1e-16) << ms;
  }
}

}  // namespace
}  // namespace imud
