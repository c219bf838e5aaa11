// Samples before their nominal instants: values are those of the true instants, and increments still add up.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/imu.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr double acceleration = 3;  // rad/s^2: the rate gives the true instant

Truth turntable(TruthTime time) {
  const double t = seconds(time - TruthTime{});
  Truth truth;
  truth.time = time;
  truth.q_NB = Quaternion(Eigen::AngleAxisd(0.5 * acceleration * t * t, Vector3::UnitX()));
  truth.omega_BN_B = {acceleration * t, 0, 0};
  truth.omegaDot_BN_B = {acceleration, 0, 0};
  truth.has_angular_acceleration = true;
  truth.has_specific_force = true;
  return truth;
}

ImuModel jittering(Nanoseconds jitter) {
  ImuModel model;
  model.sampling_jitter = jitter;
  return model;
}

// The truth of 3.2 ms before, with the stamp of the nominal instant, and before the first truth its motion.
TEST(SamplingDelay, IsTheAgeOfASample) {
  const std::vector<TruthTime> times = instants(1000, 1s);
  ImuModel model;
  model.sampling_delay = 3200us;
  const std::vector<Sample> samples = drive(model, turntable, times, times);
  ASSERT_EQ(samples.size(), times.size());
  double sum = 0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const double true_time = std::max(0.0, seconds(times[k] - TruthTime{}) - 3.2e-3);
    EXPECT_NEAR(samples[k].rate.x(), acceleration * true_time, 1e-9) << k;
    EXPECT_EQ(samples[k].time.ns, times[k].ns);
    sum += samples[k].delta_angle.x();
    EXPECT_NEAR(sum, 0.5 * acceleration * true_time * true_time, 1e-8) << k;
  }
}

TEST(SamplingJitter, IsUniformBeforeTheNominalInstant) {
  const std::vector<TruthTime> times = instants(1000, 10s);
  const std::vector<Sample> samples = drive(jittering(800us), turntable, times, times);
  ASSERT_EQ(samples.size(), 10'001U);
  EXPECT_EQ(samples[0].rate.x(), 0) << "the first sample is not moved";
  double mean = 0, square = 0, least = 1, most = 0, sum = 0;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const double true_time = samples[k].rate.x() / acceleration;
    const double early = seconds(times[k] - TruthTime{}) - true_time;
    mean += early / 10'000;
    square += early * early / 10'000;
    least = std::min(least, early);
    most = std::max(most, early);
    EXPECT_EQ(samples[k].time.ns, times[k].ns);  // the stamp is nominal
    EXPECT_EQ(samples[k].status, 0U);
    // The increments are those between true instants.
    sum += samples[k].delta_angle.x();
    EXPECT_NEAR(sum, 0.5 * acceleration * true_time * true_time, 1e-8);
  }
  // 4.9 standard deviations of the means: a false alarm of 1e-6. The variance of u is 1/12, that of u^2 is 4/45.
  EXPECT_NEAR(mean / 800e-6, 0.5, 4.9 * std::sqrt(1 / 12.0 / 10'000));
  EXPECT_NEAR(square / (800e-6 * 800e-6), 1 / 3.0, 4.9 * std::sqrt(4 / 45.0 / 10'000));
  EXPECT_GE(least, -1e-9);  // never later, but for rounding to ns
  EXPECT_LE(most, 800e-6 + 1e-9);
}

TEST(SamplingJitter, IsTheSameForTheSameSampleAlone) {
  const std::vector<TruthTime> times = instants(100, 1s);
  const std::vector<Sample> samples = drive(jittering(5ms), turntable, times, times);
  Timeline timeline;
  for (const TruthTime t : times) timeline.push(turntable(t));
  Imu imu(jittering(5ms), 1, stream_id("imu"));
  imu.seek(49);
  imu.sample(timeline, times[49], {});  // the first of its run
  EXPECT_EQ(imu.sample(timeline, times[50], {}).rate, samples[50].rate);
  EXPECT_NE(samples[50].rate, turntable(times[50]).omega_BN_B);
}

// A sensor that is much slower than its truth, whose motion is integrated before it samples.
TEST(SamplingJitter, LeavesTheIntegralsOfASlowSensorWhole) {
  ImuModel model = jittering(400ms);
  model.delta_angle = DeltaAngle::integral;
  std::vector<TruthTime> sensor = {TruthTime{}, TruthTime{} + 500ms, TruthTime{} + 1s, TruthTime{} + 1500ms};
  Timeline timeline;
  Imu imu(model, 7, 1);
  std::size_t due = 0;
  double sum = 0;
  for (const TruthTime t : instants(1000, 1500ms)) {
    timeline.push(turntable(t));
    if (t == sensor[due]) {
      const Sample sample = imu.sample(timeline, sensor[due++], {});
      sum += sample.delta_angle.x();
      const double true_time = sample.rate.x() / acceleration;
      EXPECT_NEAR(sum, 0.5 * acceleration * true_time * true_time, 1e-8);
    } else {
      imu.advance(timeline, t);
      EXPECT_LE(imu.advanced_to().ns, std::max<std::int64_t>(sensor[due].ns - 400'000'000, sensor[due - 1].ns));
    }
  }
  EXPECT_EQ(due, 4U);
}

}  // namespace
}  // namespace imud
