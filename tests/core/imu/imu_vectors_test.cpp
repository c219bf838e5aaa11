// The Imu against the Basilisk module's own output (tests/vectors/README.md).
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"
#include "tests/core/vector_table.hpp"

namespace imud {
namespace {

constexpr double bar = 1e-12;

std::vector<Truth> truths_of(const VectorTable& table, AccumulatedDv kind = AccumulatedDv::inertial) {
  std::vector<Truth> truths(table.rows());
  for (std::size_t i = 0; i < table.rows(); ++i) {
    Truth& truth = truths[i];
    truth.time = TruthTime{std::stoll(table.text(i, "time_ns"))};
    truth.r_BN_N = table.vector(i, "r_BN_N_");
    truth.v_BN_N = table.vector(i, "v_BN_N_");
    truth.q_NB = quaternion_from_mrp(table.vector(i, "sigma_BN_", "123"));
    truth.omega_BN_B = table.vector(i, "omega_BN_B_");
    truth.has_angular_acceleration = true;
    truth.omegaDot_BN_B = table.vector(i, "omegaDot_BN_B_");
    truth.has_specific_force = true;
    truth.specific_force_B = table.vector(i, "nonConservativeAccelpntB_B_");
    truth.accumulated_dv = kind;
    truth.accumulated_dv_B = table.vector(i, "TotalAccumDV_BN_B_");
  }
  return truths;
}

std::vector<Sample> samples_of(const ImuModel& model, const std::vector<Truth>& truths) {
  Timeline timeline;
  Imu imu(model, 1, 1);
  std::vector<Sample> samples;
  for (const Truth& truth : truths) {
    timeline.push(truth);
    samples.push_back(imu.sample(timeline, truth.time, DeviceTime{truth.time.ns}));
  }
  return samples;
}

ImuModel clean() {
  ImuModel model;
  model.delta_velocity = DeltaVelocity::end_frame;
  return model;
}
ImuModel lever_rotated() {
  ImuModel model = clean();
  model.r_SB_B = {1.0, 1.0, 2.0};
  model.dcm_PB = dcm_from_yaw_pitch_roll(0.7854, 1.0, 0.1);
  return model;
}
ImuModel bias() {
  ImuModel model = clean();
  model.gyro.bias = {0.01, -0.02, 0.005};
  model.accelerometer.bias = {0.1, -0.05, 0.02};
  return model;
}
ImuModel scale() {
  ImuModel model = clean();
  model.gyro.scale_factor = {1.01, 0.98, 1.003};
  model.accelerometer.scale_factor = {2.0, 0.97, 1.01};
  return model;
}
ImuModel lsb(Rounding rounding) {
  ImuModel model = clean();
  model.gyro.lsb = 0.001;
  model.accelerometer.lsb = 0.01;
  model.gyro.rounding = model.accelerometer.rounding = rounding;
  return model;
}
ImuModel saturation() {
  ImuModel model = clean();
  model.gyro.max = 0.2;
  model.accelerometer.max = 0.5;
  return model;
}
ImuModel all() {
  ImuModel model = lsb(Rounding::toward_zero);
  model.r_SB_B = lever_rotated().r_SB_B;
  model.dcm_PB = lever_rotated().dcm_PB;
  model.gyro.scale_factor = scale().gyro.scale_factor;
  model.accelerometer.scale_factor = scale().accelerometer.scale_factor;
  // The module multiplies its bias by the scale factor, too.
  model.gyro.bias = scale().gyro.scale_factor.cwiseProduct(bias().gyro.bias);
  model.accelerometer.bias = scale().accelerometer.scale_factor.cwiseProduct(bias().accelerometer.bias);
  model.gyro.max = 0.35;
  model.accelerometer.max = 1.5;
  return model;
}

struct Case {
  std::string file;
  ImuModel model;
};

class ReferenceVectors : public ::testing::TestWithParam<Case> {};

TEST_P(ReferenceVectors, AreReproduced) {
  const VectorTable table(GetParam().file);
  ASSERT_EQ(table.rows(), 201U);
  const std::vector<Sample> samples = samples_of(GetParam().model, truths_of(table));
  EXPECT_EQ(samples[0].delta_angle, Vector3::Zero());
  EXPECT_EQ(samples[0].delta_velocity, Vector3::Zero());
  for (std::size_t i = 1; i < samples.size(); ++i) {
    SCOPED_TRACE(i);
    const Sample& sample = samples[i];
    EXPECT_EQ(sample.counter, i);
    EXPECT_LT((sample.rate - table.vector(i, "AngVelPlatform_")).cwiseAbs().maxCoeff(), bar);
    EXPECT_LT((sample.specific_force - table.vector(i, "AccelPlatform_")).cwiseAbs().maxCoeff(), bar);
    EXPECT_LT((sample.delta_angle - table.vector(i, "DRFramePlatform_")).cwiseAbs().maxCoeff(), bar);
    EXPECT_LT((sample.delta_velocity - table.vector(i, "DVFramePlatform_")).cwiseAbs().maxCoeff(), bar);
  }
}

INSTANTIATE_TEST_SUITE_P(Files, ReferenceVectors,
                         ::testing::Values(Case{"clean", clean()}, Case{"lever_rotated", lever_rotated()},
                                           Case{"bias", bias()}, Case{"scale", scale()},
                                           Case{"lsb_tozero", lsb(Rounding::toward_zero)},
                                           Case{"lsb_near", lsb(Rounding::nearest)}, Case{"saturation", saturation()},
                                           Case{"all", all()}),
                         [](const auto& test) { return test.param.file; });

// The table changes to the shadow set in its middle.
TEST(ReferenceModule, VectorsHaveAShadowSwitch) {
  const VectorTable table("clean");
  EXPECT_LT(table.vector(11, "sigma_BN_", "123").dot(table.vector(12, "sigma_BN_", "123")), 0.0);
}

TEST(ReferenceModule, SaturationIsFlaggedPerAxis) {
  const VectorTable table("saturation");
  const std::vector<Sample> samples = samples_of(saturation(), truths_of(table));
  std::uint32_t ever = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    for (unsigned axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<int>(axis);
      const bool gyro = (samples[i].status & status::gyro_saturated_x << axis) != 0;
      const bool accelerometer = (samples[i].status & status::accelerometer_saturated_x << axis) != 0;
      EXPECT_EQ(gyro, std::abs(table.vector(i, "omega_BN_B_")[a]) > 0.2);
      EXPECT_EQ(accelerometer, std::abs(table.vector(i, "nonConservativeAccelpntB_B_")[a]) > 0.5);
    }
    ever |= samples[i].status;
  }
  EXPECT_EQ(ever, 0b101'111U);  // all except y of the accelerometer, whose force stays within +-0.3
}

// Fed with the sum of body-axes increments that Basilisk's spacecraft publishes, the module takes it for an inertial
// vector and adds omega x DV. The same motion must give the same samples here, however its velocity was summed.
TEST(ReferenceModule, SpuriousVelocityIsNotReproduced) {
  const VectorTable clean_table("clean"), table("clean_dv_spacecraft_convention");
  const std::vector<Sample> samples = samples_of(clean(), truths_of(table, AccumulatedDv::body_sum));
  double spurious = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    SCOPED_TRACE(i);
    EXPECT_LT((samples[i].rate - table.vector(i, "AngVelPlatform_")).cwiseAbs().maxCoeff(), bar);
    EXPECT_LT((samples[i].specific_force - table.vector(i, "AccelPlatform_")).cwiseAbs().maxCoeff(), bar);
    EXPECT_LT((samples[i].delta_angle - table.vector(i, "DRFramePlatform_")).cwiseAbs().maxCoeff(), bar);
    EXPECT_LT((samples[i].delta_velocity - clean_table.vector(i, "DVFramePlatform_")).cwiseAbs().maxCoeff(), bar);
    spurious = std::max(spurious, (samples[i].delta_velocity - table.vector(i, "DVFramePlatform_")).norm());
  }
  EXPECT_GT(spurious, 0.01);  // m/s in a step of 0.05 s: the module's largest spurious velocity
}

// The convention matters: each stream, read by the other convention, is wrong by the same amount.
TEST(ReferenceModule, TheConventionMatters) {
  const VectorTable table("clean");
  const std::vector<Sample> right = samples_of(clean(), truths_of(table));
  const std::vector<Sample> wrong = samples_of(clean(), truths_of(table, AccumulatedDv::body_sum));
  double worst = 0;
  for (std::size_t i = 1; i < right.size(); ++i)
    worst = std::max(worst, (right[i].delta_velocity - wrong[i].delta_velocity).norm());
  EXPECT_GT(worst, 0.01);
}

// dr_deadband.csv: through acos, the module loses a step of this angle, or much of it.
TEST(DeadBand, NoAngleIsLost) {
  const VectorTable table("dr_deadband");
  int lost_by_module = 0;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const double angle = table.number(i, "angle_rad");
    lost_by_module += table.number(i, "DR_z") == 0.0;
    Timeline timeline;
    Imu imu(ImuModel{}, 1, 1);
    Truth truth;
    timeline.push(truth);
    imu.sample(timeline, truth.time, {});
    truth.time.ns = 10'000'000;
    truth.q_NB = exp({0.0, 0.0, angle});
    timeline.push(truth);
    EXPECT_NEAR(imu.sample(timeline, truth.time, {}).delta_angle.z() / angle, 1.0, 1e-15) << angle;
  }
  EXPECT_GT(lost_by_module, 50);
}

// A thousandth of a degree per hour at 5 kHz: nothing is lost on the way, from any attitude.
TEST(DeadBand, TinyStepsAddUp) {
  Timeline timeline;
  Imu imu(ImuModel{}, 1, 1);
  const Quaternion start = exp({0.3, -1.1, 0.7});
  Truth truth;
  Vector3 sum = Vector3::Zero();
  constexpr int steps = 20'000;
  for (int k = 0; k <= steps; ++k) {
    truth.time = TruthTime{} + k * std::chrono::milliseconds(1);
    truth.q_NB = start * exp({0.0, 0.0, 1e-12 * k});
    timeline.push(truth);
    sum += imu.sample(timeline, truth.time, {}).delta_angle;
  }
  // Each step is rounded by about 1e-16 rad, which adds up as a random walk: 1e-14. The whole is 2e-8 rad.
  EXPECT_NEAR(sum.z(), 1e-12 * steps, 5e-14);
  EXPECT_NEAR(sum.x(), 0.0, 5e-14);
  EXPECT_NEAR(sum.y(), 0.0, 5e-14);
}

}  // namespace
}  // namespace imud
