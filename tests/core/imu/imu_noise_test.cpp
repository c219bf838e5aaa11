// The errors of an Imu as random numbers: which inputs they depend on.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"
#include "tests/core/drive.hpp"
#include "tests/core/hash.hpp"
#include "tests/core/statistics.hpp"
#include "tools/truth/motion.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

TriadErrors every_error(double sigma) {
  TriadErrors errors;
  errors.scale_factor = {1.01, 0.98, 1.003};
  errors.bias = {5.0 * sigma, -3.0 * sigma, sigma};
  errors.walk_transition << 0.95, 0.02, 0.0, -0.01, 0.9, 0.0, 0.0, 0.03, 0.97;
  errors.walk_sqrt_cov << sigma, 0, 0, 0.1 * sigma, sigma, 0, 0, 0.2 * sigma, sigma;
  errors.walk_bound = Vector3::Constant(4.0 * sigma);
  errors.lsb = 0.05 * sigma;
  errors.rounding = Rounding::nearest;
  errors.carry = true;
  errors.max = 1200.0 * sigma;
  return errors;
}

ImuModel every_effect() {
  ImuModel model;
  model.r_SB_B = {0.5, -0.3, 0.8};
  model.dcm_PB = dcm_from_yaw_pitch_roll(0.5, -0.3, 2.0);
  model.gyro = every_error(1e-3);
  model.accelerometer = every_error(1e-2);
  return model;
}

// Truth at 100 Hz of a motion in all axes, sensor at 333 Hz: no instants coincide.
std::vector<Sample> run(const ImuModel& model, std::uint64_t seed = 1, Nanoseconds duration = 3s) {
  MotionParameters parameters;
  parameters.half_angle_rad = 0.1;
  parameters.frequency_hz = 1.3;
  return drive(
      model, [&](TruthTime t) { return find_motion("coning")->at(t, parameters); }, instants(100.0, duration),
      instants(333.0, duration), seed);
}

std::uint64_t fingerprint(const std::vector<Sample>& samples) {
  Hash hash;
  for (const Sample& sample : samples) {
    hash.add(sample.rate);
    hash.add(sample.specific_force);
    hash.add(sample.delta_angle);
    hash.add(sample.delta_velocity);
    hash.add(std::uint64_t{sample.status});
    hash.add(sample.counter);
  }
  return hash.value();
}

// At rest each sample consists of the errors alone.
std::vector<Sample> errors_alone(const ImuModel& model, std::size_t count, std::uint64_t seed = 1,
                                 std::uint32_t stream = 1) {
  Timeline::Limits limits;
  limits.extrapolate = 24h;
  Timeline timeline(limits);
  timeline.push(Truth{});
  Imu imu(model, seed, stream);
  std::vector<Sample> samples;
  for (std::size_t k = 0; k < count; ++k)
    samples.push_back(imu.sample(timeline, TruthTime{} + static_cast<std::int64_t>(k) * 10ms, {}));
  return samples;
}

ImuModel white() {
  ImuModel model;
  model.gyro.walk_transition = model.accelerometer.walk_transition = Matrix3::Zero();
  model.gyro.walk_sqrt_cov = 1e-3 * Matrix3::Identity();
  model.accelerometer.walk_sqrt_cov = 1e-2 * Matrix3::Identity();
  return model;
}

TEST(ImuNoise, SameRunSameBits) { EXPECT_EQ(fingerprint(run(every_effect())), fingerprint(run(every_effect()))); }

// The same bits on every machine: any compiler, optimisation and processor.
TEST(ImuNoise, PinnedBits) {
  ImuModel model = every_effect();
  std::vector<Sample> samples = run(model, 12345, 31s);
  EXPECT_GT(samples.size(), 10'000U);
  EXPECT_EQ(fingerprint(samples), 5538986782629117435U);
  model.delta_angle = DeltaAngle::integral;
  model.delta_velocity = DeltaVelocity::end_frame;
  EXPECT_EQ(fingerprint(run(model, 12345, 31s)), 11182752540490567438U);
}

TEST(ImuNoise, SeedsAndNamesDiffer) {
  const std::vector<Sample> one = errors_alone(white(), 100, 1, stream_id("imu1"));
  EXPECT_NE(fingerprint(one), fingerprint(errors_alone(white(), 100, 2, stream_id("imu1"))));
  EXPECT_NE(fingerprint(one), fingerprint(errors_alone(white(), 100, 1, stream_id("imu2"))));
  EXPECT_EQ(fingerprint(one), fingerprint(errors_alone(white(), 100, 1, stream_id("imu1"))));
}

// Eq. 15-18: an error of the rate, times the step, is added to the delta-angle, except to the first, which has no
// step.
TEST(ImuNoise, IncrementsHaveTheErrorTimesTheStep) {
  ImuModel model = every_effect();
  model.gyro.lsb = model.accelerometer.lsb = 0.0;
  const std::vector<Sample> samples = errors_alone(model, 1000);
  GaussMarkov gyro(model.gyro, Quantity::rate), accelerometer(model.accelerometer, Quantity::specific_force);
  const Normals normals(1, 1);
  for (const Sample& sample : samples) {
    const double dt = sample.counter > 0 ? 0.01 : 0.0;
    const Vector3 rate_error = model.gyro.bias + gyro.next(normals, sample.counter);
    const Vector3 force_error = model.accelerometer.bias + accelerometer.next(normals, sample.counter);
    ASSERT_EQ(sample.rate, rate_error);
    ASSERT_EQ(sample.specific_force, force_error);
    ASSERT_LT((sample.delta_angle - dt * rate_error).norm(), 1e-18);
    ASSERT_LT((sample.delta_velocity - dt * force_error).norm(), 1e-17);
  }
}

// The reference module gives both triads, and every sensor of the same seed, one and the same noise.
TEST(ImuNoise, TriadsAxesAndImusAreUncorrelated) {
  constexpr std::size_t n = 20'000;
  std::vector<std::vector<double>> all;
  for (const char* name : {"imu1", "imu2"}) {
    const std::vector<Sample> samples = errors_alone(white(), n, 1, stream_id(name));
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> rate, force;
      for (const Sample& sample : samples) {
        rate.push_back(sample.rate[axis]);
        force.push_back(sample.specific_force[axis]);
      }
      // 4.9 standard errors of 1/sqrt(2n): 1e-6 each.
      EXPECT_LT(std::abs(std::sqrt(Moments(rate).variance) / 1e-3 - 1.0), 4.9 / std::sqrt(2.0 * n));
      EXPECT_LT(std::abs(std::sqrt(Moments(force).variance) / 1e-2 - 1.0), 4.9 / std::sqrt(2.0 * n));
      all.push_back(std::move(rate));
      all.push_back(std::move(force));
    }
  }
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_LT(std::abs(correlation(all[i], all[j])), 4.9 / std::sqrt(double{n})) << i << " " << j;
}

// --- Effects do not shift one another's numbers
// ---------------------------------------------------------------------

struct Effect {
  std::string name;
  std::function<void(TriadErrors&)> off;
};
const std::vector<Effect> effects = {
    {"scale_factor", [](TriadErrors& e) { e.scale_factor = Vector3::Ones(); }},
    {"bias", [](TriadErrors& e) { e.bias = Vector3::Zero(); }},
    {"walk", [](TriadErrors& e) { e.walk_sqrt_cov = Matrix3::Zero(); }},
    {"walk_bound", [](TriadErrors& e) { e.walk_bound = Vector3::Zero(); }},
    {"lsb", [](TriadErrors& e) { e.lsb = 0.0; }},
    {"carry", [](TriadErrors& e) { e.carry = false; }},
    {"max", [](TriadErrors& e) { e.max = 1e6; }},
};

TEST(Effects, OfOneTriadLeaveTheOtherAlone) {
  const std::vector<Sample> all = run(every_effect());
  for (const Effect& effect : effects) {
    ImuModel without_gyro = every_effect(), without_accelerometer = every_effect();
    effect.off(without_gyro.gyro);
    effect.off(without_accelerometer.accelerometer);
    const std::vector<Sample> a = run(without_gyro), b = run(without_accelerometer);
    for (std::size_t k = 0; k < all.size(); ++k) {
      ASSERT_EQ(a[k].specific_force, all[k].specific_force) << effect.name;
      ASSERT_EQ(a[k].delta_velocity, all[k].delta_velocity) << effect.name;
      ASSERT_EQ(b[k].rate, all[k].rate) << effect.name;
      ASSERT_EQ(b[k].delta_angle, all[k].delta_angle) << effect.name;
    }
  }
}

// Within a triad: with one effect off, noise is still the same noise.
TEST(Effects, LeaveTheNoiseOfTheirTriadAlone) {
  const Vector3 bias(5e-3, -3e-3, 1e-3);
  for (const Effect& effect : effects) {
    if (effect.name == "walk" || effect.name == "walk_bound") continue;
    ImuModel model = every_effect();
    effect.off(model.gyro);
    model.gyro.lsb = 0.0;
    GaussMarkov walk(model.gyro, Quantity::rate);
    for (const Sample& sample : errors_alone(model, 500)) {
      const Vector3 noise = walk.next(Normals(1, 1), sample.counter);
      ASSERT_EQ(sample.rate, (effect.name == "bias" ? Vector3(Vector3::Zero()) : bias) + noise) << effect.name;
    }
  }
}

// --- Any sample alone
// -----------------------------------------------------------------------------------------------

TEST(Seek, SampleKAloneIsSampleKOfTheSequence) {
  ImuModel walking = every_effect();
  walking.gyro.carry = walking.accelerometer.carry = false;
  ImuModel random_walk = walking;
  random_walk.gyro.walk_transition = Matrix3::Identity();
  for (const ImuModel& model : {walking, white(), random_walk}) {
    const std::vector<Sample> all = errors_alone(model, 1000);
    Timeline timeline;
    timeline.push(Truth{});
    for (const std::uint64_t k : {0U, 1U, 500U, 999U}) {
      Imu imu(model, 1, 1);
      imu.seek(k);
      EXPECT_EQ(imu.next(), k);
      const Sample alone = imu.sample(timeline, {}, {});
      EXPECT_EQ(alone.counter, k);
      EXPECT_EQ(alone.rate, all[k].rate);
      EXPECT_EQ(alone.specific_force, all[k].specific_force);
    }
  }
}

TEST(Seek, BackAndForth) {
  const std::vector<Sample> all = errors_alone(white(), 100);
  Timeline timeline;
  timeline.push(Truth{});
  Imu imu(white(), 1, 1);
  for (const std::uint64_t k : {50U, 3U, 99U, 0U}) {
    imu.seek(k);
    EXPECT_EQ(imu.sample(timeline, {}, {}).rate, all[k].rate);
  }
}

// --- A restart
// -----------------------------------------------------------------------------------------

TEST(NewRun, HasNoIncrementsAndCountsOn) {
  const ImuModel model = every_effect();
  Timeline timeline;
  Imu imu(model, 1, 1), undisturbed(model, 1, 1);
  const auto sample = [&](Imu& of, std::int64_t ms) {
    Truth truth;
    truth.time.ns = ms * 1'000'000;
    timeline.push(truth);
    return of.sample(timeline, truth.time, DeviceTime{truth.time.ns});
  };
  const Sample first = sample(imu, 0);
  EXPECT_EQ(first.delta_angle, Vector3::Zero());
  EXPECT_EQ(first.delta_velocity, Vector3::Zero());
  EXPECT_EQ(first.counter, 0U);
  EXPECT_NE(sample(imu, 10).delta_angle, Vector3::Zero());
  imu.begin_run();
  Truth restart;
  restart.new_run = true;
  restart.time.ns = -7'000'000'000;
  ASSERT_EQ(timeline.push(restart), Admission::new_run);
  const Sample again = imu.sample(timeline, restart.time, DeviceTime{20'000'000});
  EXPECT_EQ(again.delta_angle, Vector3::Zero());
  EXPECT_EQ(again.delta_velocity, Vector3::Zero());
  EXPECT_EQ(again.counter, 2U);
  EXPECT_EQ(again.time.ns, 20'000'000);
  const Sample next = imu.sample(timeline, restart.time + 10ms, {});
  EXPECT_EQ(next.counter, 3U);
  EXPECT_NE(next.delta_angle, Vector3::Zero());
  EXPECT_LT(next.delta_angle.norm(), 1e-3) << "the step is 10 ms, not the way back of 7 s";
  // The errors go on as in a device that was not disturbed: at rest all four rates are errors alone.
  Truth rest;
  rest.new_run = true;
  timeline.push(rest);
  Sample fourth = sample(undisturbed, 0);
  for (int k = 1; k < 4; ++k) fourth = sample(undisturbed, 10 * k);
  EXPECT_EQ(next.rate, fourth.rate);
  EXPECT_EQ(next.specific_force, fourth.specific_force);
}

}  // namespace
}  // namespace imud
