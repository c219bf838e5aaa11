// The magnetic field and the pressure that a truth carries, and the marks of what was derived.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/effects/drawn_errors.hpp"
#include "core/imu.hpp"

namespace imud {
namespace {

class GivenFields : public testing::Test {
 protected:
  static Truth truth_at(std::int64_t ms) {
    Truth truth;
    truth.time.ns = ms * 1'000'000;
    truth.has_magnetic_field = true;
    truth.magnetic_field_B = Vector3(2e-5, -1e-5, 4e-5) * (1.0 + static_cast<double>(ms) * 1e-3);
    truth.has_pressure = true;
    truth.pressure = 90'000.0 + static_cast<double>(ms);
    return truth;
  }
  static Sample sample_of(Imu& imu, const Timeline& timeline, std::int64_t ms) {
    return imu.sample(timeline, TruthTime{ms * 1'000'000}, DeviceTime{});
  }
};

TEST_F(GivenFields, AreMeasuredWithoutAnEarth) {
  ImuModel model;
  model.dcm_PB << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  Imu imu(model, 1, 1);
  Timeline timeline;
  timeline.push(truth_at(0));
  timeline.push(truth_at(100));
  sample_of(imu, timeline, 0);
  const Sample sample = sample_of(imu, timeline, 50);
  EXPECT_LT((sample.magnetic_field - 1.05 * Vector3(-1e-5, -2e-5, 4e-5)).norm(), 1e-18);
  EXPECT_NEAR(sample.pressure, 90'050.0, 1e-9);
  EXPECT_FALSE(sample.navigation.is_known);
  Truth without;
  without.time.ns = 200'000'000;
  timeline.push(without);
  const Sample none = sample_of(imu, timeline, 150);
  EXPECT_TRUE(none.magnetic_field.isZero(0));
  EXPECT_EQ(none.pressure, 0.0);
}

// Linear between two truths that carry a state; a truth without it has none.
TEST_F(GivenFields, HaveStatesOfTheVehicle) {
  Timeline timeline;
  Truth truth = truth_at(0);
  timeline.push(truth);
  EXPECT_FALSE(timeline.vehicle(VehicleState::throttle, truth.time));
  truth = truth_at(100);
  truth.vehicle.set(VehicleState::throttle, 0.5);
  timeline.push(truth);
  truth = truth_at(200);
  truth.vehicle.set(VehicleState::throttle, 0.7);
  truth.vehicle.set(VehicleState::current, -12);
  timeline.push(truth);
  const auto at = [](std::int64_t ms) { return TruthTime{ms * 1'000'000}; };
  EXPECT_FALSE(timeline.vehicle(VehicleState::throttle, at(0)));
  EXPECT_NEAR(timeline.vehicle(VehicleState::throttle, at(150)).value(), 0.6, 1e-15);
  EXPECT_EQ(timeline.vehicle(VehicleState::current, at(150)).value(), -12);
  EXPECT_EQ(timeline.surroundings(at(200)).vehicle[VehicleState::throttle], 0.7);
  EXPECT_FALSE(timeline.surroundings(at(200)).vehicle[VehicleState::airspeed]);
  truth.vehicle.set(VehicleState::airspeed, 2 * truth_limit::vehicle);
  EXPECT_FALSE(is_in_range(truth));
}

TEST_F(GivenFields, OfAnElectricCurrentAddToTheField) {
  ImuModel model;
  model.current_field = {1e-7, 0, -2e-7};
  Imu imu(model, 1, 1);
  Timeline timeline;
  Truth truth = truth_at(0);
  truth.vehicle.set(VehicleState::current, 30);
  timeline.push(truth);
  EXPECT_LT((sample_of(imu, timeline, 0).magnetic_field - truth.magnetic_field_B - Vector3(3e-6, 0, -6e-6)).norm(),
            1e-18);
}

// 400 units, with the bounds of DrawsTheBiasOfAUnit in barometer_test.cpp: a false alarm below 4e-8 for each of eight
// figures. The coefficients of the axes and of the port are independent of one another and of the bias.
TEST_F(GivenFields, AreDisturbedByWhatIsDrawnForAUnit) {
  ImuModel model;
  model.current_field = {1e-7, 0, -2e-7};
  model.current_field_sigma = {1e-8, 2e-8, 4e-8};
  model.barometer.port = 0.1;
  model.barometer.port_sigma = 0.02;
  model.barometer.bias_sigma = 30;
  model.magnetometer.unit_sigma.bias = Vector3::Constant(1e-6);
  Timeline timeline;
  Truth truth = truth_at(0);
  truth.vehicle.set(VehicleState::current, 30);
  truth.vehicle.set(VehicleState::dynamic_pressure, 50);
  timeline.push(truth);
  using Four = Eigen::Vector4d;
  Four sum = Four::Zero();
  Eigen::Matrix<double, 5, 5> product = Eigen::Matrix<double, 5, 5>::Zero();
  constexpr int units = 400;
  for (std::uint64_t seed = 0; seed < units; ++seed) {
    const Normals normals(seed, 1);
    Imu imu(model, seed, 1);
    const Sample sample = sample_of(imu, timeline, 0);
    const Vector3 bias = drawn_errors(model.magnetometer, Quantity::magnetic_field, normals, normals, 0).bias;
    const Vector3 field = ((sample.magnetic_field - truth.magnetic_field_B - bias) / 30 - model.current_field);
    EXPECT_LT((field - drawn_current_field(model, normals)).norm(), 1e-15);
    const Barometer::Drawn drawn = Barometer::drawn(model.barometer, normals);
    EXPECT_NEAR(sample.pressure - 90'000 - drawn.bias, 50 * (0.1 + drawn.port), 1e-9);
    Eigen::Matrix<double, 5, 1> all;
    all << field.cwiseQuotient(model.current_field_sigma), drawn.port / 0.02, drawn.bias / 30;
    sum += all.head<4>() / units;
    product += all * all.transpose() / units;
  }
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(sum[i], 0, 5.5 / 20) << i;
    EXPECT_NEAR(std::sqrt(product(i, i)), 1, 5.5 / 28) << i;
    for (int j = i + 1; j < 5; ++j) EXPECT_NEAR(product(i, j), 0, 5.5 / 20) << i << j;
  }
}

// A port of 0.1 in a flow of 50 Pa, at the pressure that the truth gives.
TEST_F(GivenFields, OfTheAirActOnTheBarometer) {
  ImuModel model;
  model.barometer.port = 0.1;
  Imu imu(model, 1, 1);
  Timeline timeline;
  Truth truth = truth_at(0);
  truth.vehicle.set(VehicleState::dynamic_pressure, 50);
  timeline.push(truth);
  EXPECT_NEAR(sample_of(imu, timeline, 0).pressure, 90'005, 1e-9);
}

TEST_F(GivenFields, TakeThePlaceOfTheEarthsModels) {
  ImuModel model;
  model.earth.frame = EarthModel::Frame::local;
  model.earth.latitude = 0.8;
  Imu imu(model, 1, 1), other(model, 1, 1);
  Truth truth = truth_at(0);
  truth.has_position = truth.has_velocity = true;
  Timeline timeline;
  timeline.push(truth);
  const Sample given = sample_of(imu, timeline, 0);
  EXPECT_TRUE(given.navigation.is_known);
  EXPECT_LT((given.magnetic_field - truth.magnetic_field_B).norm(), 1e-18);
  EXPECT_EQ(given.pressure, truth.pressure);
  truth.has_magnetic_field = false;
  truth.time.ns += 1'000'000;
  timeline.push(truth);
  const Sample half = sample_of(other, timeline, 1);
  EXPECT_GT((half.magnetic_field - truth.magnetic_field_B).norm(), 1e-6) << "the model's own";
  EXPECT_EQ(half.pressure, truth.pressure);
}

TEST_F(GivenFields, MustBeFiniteAndInRange) {
  Truth truth = truth_at(0);
  EXPECT_TRUE(is_finite(truth) && is_in_range(truth));
  truth.magnetic_field_B.y() = 1e7;
  EXPECT_FALSE(is_in_range(truth));
  truth.magnetic_field_B.y() = std::nan("");
  EXPECT_FALSE(is_finite(truth));
  truth = truth_at(0);
  truth.pressure = 1e13;
  EXPECT_FALSE(is_in_range(truth));
  truth.pressure = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(is_finite(truth));
}

TEST_F(GivenFields, AVelocityAloneIsNoPlace) {
  Timeline timeline;
  Truth truth;
  truth.has_velocity = true;
  timeline.push(truth);
  EXPECT_FALSE(timeline.position(truth.time).is_known);
}

TEST_F(GivenFields, StatusMarksWhatWasDerived) {
  Imu imu(ImuModel{}, 1, 1);
  Timeline timeline;
  Truth truth;
  timeline.push(truth);
  EXPECT_EQ(sample_of(imu, timeline, 0).status, 0U);
  truth.time.ns = 100'000'000;
  truth.is_rate_derived = true;
  timeline.push(truth);
  EXPECT_EQ(sample_of(imu, timeline, 50).status, status::rate_derived) << "between truths: that of the later one";
  truth.time.ns = 200'000'000;
  truth.is_force_derived = true;
  timeline.push(truth);
  EXPECT_EQ(sample_of(imu, timeline, 200).status, status::rate_derived | status::force_derived);
  EXPECT_EQ(sample_of(imu, timeline, 250).status,
            status::rate_derived | status::force_derived | status::truth_extrapolated);
}

}  // namespace
}  // namespace imud
