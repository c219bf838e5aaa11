// The effects that are no noise, against closed forms: on a turntable, a centrifuge, a shaker, and from one power on
// to the next.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "core/imu.hpp"
#include "core/units.hpp"
#include "tests/core/drive.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

// Samples at 100 Hz of a vehicle that turns at a constant rate with a specific force that is constant in its axes.
std::vector<Sample> steady(const ImuModel& model, const Vector3& rate, const Vector3& force, int count = 3) {
  std::vector<TruthTime> times;
  for (int k = 0; k < count; ++k) times.push_back(TruthTime{} + k * 10ms);
  return drive(
      model,
      [&](TruthTime t) {
        Truth truth;
        truth.time = t;
        const double angle = seconds(t - TruthTime{}) * rate.norm();
        truth.q_NB =
            rate.isZero(0.0) ? Quaternion::Identity() : Quaternion(Eigen::AngleAxisd(angle, rate.normalized()));
        truth.omega_BN_B = rate;
        truth.specific_force_B = force;
        truth.has_specific_force = true;
        return truth;
      },
      times, times);
}

// A turntable about each axis in turn: what each sensor shows is a column of the matrix.
TEST(Misalignment, IsTheMatrixOfATurntableCalibration) {
  ImuModel model;
  model.gyro.misalignment << 1, 2e-3, -3e-3, 4e-4, 1, 5e-4, -6e-3, 7e-3, 0.999;
  model.gyro.scale_factor = {1.01, 1, 0.98};
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 rate = 1.5 * Vector3::Unit(axis);
    const Sample sample = steady(model, rate, Vector3::Zero())[1];
    const Vector3 expected = model.gyro.scale_factor.cwiseProduct(1.5 * model.gyro.misalignment.col(axis));
    EXPECT_LT((sample.rate - expected).norm(), 1e-14) << axis;
    EXPECT_LT((sample.delta_angle - 0.01 * expected).norm(), 1e-14) << axis;
  }
}

TEST(Nonlinearity, OfATurntableInBothDirections) {
  ImuModel model;
  model.gyro.scale_factor_asymmetry = {1e-3, 0, 0};
  model.gyro.quadratic = {0, 2e-4, 0};
  model.gyro.cubic = {0, 0, 3e-5};
  for (const double rate : {-4.0, -1.0, 0.0, 2.0, 5.0}) {
    const Sample sample = steady(model, Vector3::Constant(rate), Vector3::Zero())[2];
    const Vector3 expected(rate + 0.5e-3 * std::abs(rate), rate + 2e-4 * rate * rate,
                           rate + 3e-5 * rate * rate * rate);
    EXPECT_LT((sample.rate - expected).norm(), 1e-12) << rate;
    EXPECT_LT((sample.delta_angle - 0.01 * expected).norm(), 1e-12) << rate;
  }
}

// A centrifuge: the gyros respond to a force that the arm gives, not only to the rate.
TEST(AccelerationSensitivity, OnACentrifuge) {
  ImuModel model;
  const double per_g = units::degree / 3600 / units::standard_gravity;  // deg/h/g
  model.gyro.g_sensitivity << 5, 0, 0, 0, 7, 1, 0, 0, -3;
  model.gyro.g_sensitivity *= per_g;
  model.gyro.g_squared_sensitivity = 0.2 * per_g / units::standard_gravity * Matrix3::Identity();
  model.gyro.scale_factor = {2, 2, 2};  // acts on the truth alone
  model.r_SB_B = {2, 0, 0};
  const Vector3 rate(0, 0, 5);
  const Vector3 force = Vector3(-50, 0, 0) + Vector3(0, 0, -units::standard_gravity);  // centripetal: 2 m * 25/s^2
  const Sample sample = steady(model, rate, Vector3(0, 0, -units::standard_gravity))[2];
  EXPECT_LT((sample.specific_force - force).norm(), 1e-12);
  const Vector3 expected =
      2 * rate + model.gyro.g_sensitivity * force + model.gyro.g_squared_sensitivity * force.cwiseProduct(force);
  EXPECT_LT((sample.rate - expected).norm(), 1e-12);
  EXPECT_GT((sample.rate - 2 * rate).norm(), 5e-5);
  // The increments have the mean force of their step, which turns with the vehicle.
  EXPECT_LT((sample.delta_angle - 0.01 * expected).norm(), 1e-4 * (sample.delta_angle - 0.02 * rate).norm() + 1e-9);
}

// A shaker: the quadratic term of an accelerometer rectifies a vibration of amplitude a to q a^2/2.
TEST(Nonlinearity, RectifiesTheVibrationOfAShaker) {
  ImuModel model;
  model.accelerometer.quadratic = Vector3::Constant(1e-5);
  constexpr double amplitude = 30;
  std::vector<TruthTime> times;
  for (int k = 0; k < 1000; ++k) times.push_back(TruthTime{} + k * 1ms);
  Vector3 sum = Vector3::Zero();
  const std::vector<Sample> samples = drive(
      model,
      [&](TruthTime t) {
        Truth truth;
        truth.time = t;
        truth.specific_force_B = Vector3::Constant(amplitude * std::sin(2 * M_PI * 50 * seconds(t - TruthTime{})));
        truth.has_specific_force = true;
        return truth;
      },
      times, times);
  ASSERT_EQ(samples.size(), 1000U);
  for (const Sample& sample : samples) sum += sample.specific_force / 1000;
  EXPECT_LT((sum - Vector3::Constant(1e-5 * amplitude * amplitude / 2)).norm(), 1e-9);
}

TEST(TurnOnBias, IsDrawnAtEachPowerOnAndStaysUntilTheNext) {
  ImuModel model;
  model.gyro.turn_on_bias = {1, 2, 3};
  Timeline timeline;
  timeline.push(Truth{});
  const auto biases = [&](std::uint64_t seed) {
    Imu imu(model, seed, 1);
    std::vector<Vector3> all;
    for (std::uint64_t number = 0; number < 2000; ++number) {
      imu.power_on(number);
      all.push_back(imu.sample(timeline, {}, {}).rate);
      imu.begin_run();  // does not draw
      EXPECT_EQ(imu.sample(timeline, {}, {}).rate, all.back());
      imu.begin_run();
    }
    return all;
  };
  const std::vector<Vector3> all = biases(1);
  Vector3 sum = Vector3::Zero(), squares = Vector3::Zero();
  for (const Vector3& bias : all) {
    sum += bias / 2000;
    squares += bias.cwiseProduct(bias) / 2000;
  }
  for (int i = 0; i < 3; ++i) {
    const double sigma = model.gyro.turn_on_bias[i];
    EXPECT_LT(std::abs(sum[i]), 4.9 * sigma / std::sqrt(2000.0));  // 1e-6
    EXPECT_NEAR(squares[i] / (sigma * sigma), 1, 4.9 * std::sqrt(2.0 / 2000));
  }
  EXPECT_EQ(biases(1)[7], all[7]);
  EXPECT_NE(biases(2)[7], all[7]);
}

// The next increment contains the remainder of the one before: over 1e6 samples the sum stays within half an LSB.
TEST(IncrementRounding, LosesNothing) {
  constexpr double lsb = 1e-6;
  TriadErrors errors;
  errors.increment_lsb = lsb;
  Triad triad(errors, Quantity::rate, 0.01);
  const Normals normals(1, 1);
  const Vector3 zero = Vector3::Zero();
  // Integers of 2^-60 rad, whose sums are exact.
  std::int64_t exact = 0;
  double largest = 0;
  std::int64_t counts = 0;
  for (std::uint64_t k = 0; k < 1'000'000; ++k) {
    const auto units = static_cast<std::int64_t>(1e12 * std::sin(0.001 * static_cast<double>(k)) + 3.3e11);
    exact += units;
    TriadStep step = {.normals = normals,
                      .k = k,
                      .dt = 0.01,
                      .since_power_on = 0,
                      .specific_force = zero,
                      .delta_velocity = zero,
                      .value = lanes(zero),
                      .increment = lanes(Vector3(static_cast<double>(units) * 0x1p-60, 0, 0))};
    triad.apply(step);
    const double count = step.increment[0] / lsb;
    ASSERT_NEAR(count, std::round(count), 1e-6);
    counts += static_cast<std::int64_t>(std::llround(count));
    largest = std::max(largest, std::abs(static_cast<double>(counts) * lsb - static_cast<double>(exact) * 0x1p-60));
  }
  EXPECT_LE(largest, 0.5 * lsb * (1 + 1e-6));
  EXPECT_GT(largest, 0.4 * lsb);
  EXPECT_GT(counts, 100'000);
}

// The table of the errors in core/README.md has the names of TriadEffects.
TEST(TriadEffects, AreThoseOfTheReadme) {
  std::ifstream file(IMUD_SOURCE_DIR "/core/README.md");
  std::vector<std::string> documented;
  const std::regex row(R"(\| (\d+) \| ([^|]+) \|.*)");
  std::smatch match;
  for (std::string line; std::getline(file, line);)
    if (std::regex_match(line, match, row)) {
      documented.push_back(match[2]);
      EXPECT_EQ(match[1], std::to_string(documented.size()));
    }
  EXPECT_EQ(documented, std::vector<std::string>(triad_effect_names.begin(), triad_effect_names.end()));
}

TEST(TriadEffects, AreAllThatHaveAFile) {
  std::set<std::string> found;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(IMUD_SOURCE_DIR "/core/effects")) {
    std::ifstream file(entry.path());
    std::smatch match;
    for (std::string line; std::getline(file, line);)
      if (std::regex_search(line, match, std::regex(R"rx(string_view name = "([^"]+)";)rx"))) found.insert(match[1]);
  }
  EXPECT_EQ(found, std::set<std::string>(triad_effect_names.begin(), triad_effect_names.end()));
}

}  // namespace
}  // namespace imud
