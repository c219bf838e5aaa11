// Relative positions: north, east and down of an origin that stays where it is.
#include <gtest/gtest.h>

#include <chrono>

#include "core/earth/earth.hpp"
#include "core/imu.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

Geodetic place_at(double latitude_deg, double longitude_deg, double height) {
  return {latitude_deg * units::degree, longitude_deg * units::degree, height};
}
Vector3 relative_position(const Geodetic& place, const Geodetic& origin) {
  Navigation navigation;
  navigation.r_E = r_E_of(place);
  navigation.origin = origin;
  return r_L_from_origin(navigation);
}

// Along the axes of the ellipsoid, and by CartConvert -l of GeographicLib 2.1.2, which gives east, north and up.
TEST(RelativePosition, IsInTheTangentPlaneOfTheOrigin) {
  constexpr double a = 6'378'137.0, b = 6'356'752.314245;
  constexpr double near = 1e-6;
  EXPECT_LT((relative_position(place_at(90, 0, 0), place_at(0, 0, 0)) - Vector3(b, 0, a)).norm(), near);
  EXPECT_LT((relative_position(place_at(0, 90, 0), place_at(0, 0, 0)) - Vector3(0, a, a)).norm(), near);
  EXPECT_LT((relative_position(place_at(0, 0, 0), place_at(90, 0, 0)) - Vector3(-a, 0, b)).norm(), near);
  EXPECT_LT((relative_position(place_at(0, 0, 7), place_at(0, 0, 0)) - Vector3(0, 0, -7)).norm(), near);
  const struct {
    Geodetic place, origin;
    Vector3 north_east_down;
  } cases[] = {
      {place_at(47.5, 11.25, 1500), place_at(47.26, 11.35, 600), {26693.815295703, -7536.121597098, -839.638950587}},
      {place_at(47.27, 11.36, 500), place_at(47.26, 11.35, 600), {1111.895854880, 756.779280596, 100.141847536}},
      {place_at(-33.86, 151.21, 30), place_at(-33.9, 151.1, 10), {4431.379588170, 10179.009306715, -10.341081046}},
      {place_at(-33.86, 151.21, 30),
       place_at(47.26, 11.35, 600),
       {600007.446730594, 3417942.540580877, 11713205.230593320}},
  };
  for (const auto& [place, origin, expected] : cases)
    EXPECT_LT((relative_position(place, origin) - expected).norm(), near) << expected.transpose();
}

// A vehicle that flies north over Earth-fixed axes at 100 m/s, from 30 m north of N's origin, and a sensor above it.
TEST(RelativePosition, IsThatOfTheSensorRelativeToALocalLevelsOrigin) {
  ImuModel model;
  model.earth.frame = EarthModel::Frame::local;
  model.earth.latitude = 0.8;
  model.earth.height = 400;
  model.r_SB_B = {0, 0, -2};
  Timeline timeline;
  for (int k = 0; k <= 20; ++k) {
    Truth truth;
    truth.time.ns = k * 100'000'000;
    truth.has_position = truth.has_velocity = true;
    truth.v_BN_N = {100, 0, 0};
    truth.r_BN_N = {30 + 10.0 * k, 5, -7};
    timeline.push(truth);
  }
  const Vector3 after(180, 5, -9), late(155, 5, -9);
  const auto sampled = [&timeline](Imu& imu) {
    return r_L_from_origin(imu.sample(timeline, TruthTime{1'500'000'000}, {}).navigation);
  };
  Imu imu(model, 1, 1);
  EXPECT_LT((r_L_from_origin(imu.sample_at_rest(0ns, {}).navigation) - Vector3(0, 0, -2)).norm(), 1e-6);
  EXPECT_LT((sampled(imu) - after).norm(), 1e-6);
  model.navigation.latency = 250ms;
  Imu behind(model, 1, 1);
  EXPECT_LT((sampled(behind) - late).norm(), 1e-6) << "a late position has the same origin";
}

// Truth with places of its own: the vehicle climbs from 100 m at 10 m/s.
class FirstTruthOriginTest : public testing::Test {
 protected:
  FirstTruthOriginTest() {
    model_.earth.frame = EarthModel::Frame::automatic;
    climb(0);
  }
  void climb(std::int64_t begin_s, bool has_position = true) {
    for (std::int64_t s = begin_s; s <= begin_s + 10; ++s) {
      Truth truth;
      truth.time.ns = s * 1'000'000'000;
      truth.sequence = static_cast<std::uint32_t>(s);
      truth.new_run = s == begin_s;
      truth.has_position = truth.has_velocity = has_position || s > begin_s + 2;
      truth.has_earth_angle = true;
      truth.earth_angle = -units::earth_rate * static_cast<double>(s);  // N stays with the Earth
      truth.v_BN_N = {10, 0, 0};
      truth.r_BN_N = {6'378'237.0 + 10 * static_cast<double>(s), 0, 0};
      timeline_.push(truth);
    }
  }
  double up(Imu& imu, std::int64_t s) const {
    const Sample sample = imu.sample(timeline_, TruthTime{s * 1'000'000'000}, {});
    EXPECT_TRUE(sample.navigation.is_known);
    return -r_L_from_origin(sample.navigation).z();
  }

  ImuModel model_;
  Timeline timeline_;
};

TEST_F(FirstTruthOriginTest, IsTheVehiclesPlaceAtTheFirstTruthOfTheRun) {
  Imu imu(model_, 1, 1), late(model_, 1, 1);
  EXPECT_NEAR(up(imu, 0), 0, 1e-6);
  EXPECT_NEAR(up(imu, 4), 40, 1e-6);
  EXPECT_NEAR(up(late, 4), 40, 1e-6) << "whenever a sensor begins to sample";
  Imu changed(model_, 1, 1);
  changed.continue_from(imu);
  climb(100);
  EXPECT_NEAR(up(changed, 105), 1050, 1e-6) << "a changed sensor goes on in the run";
  imu.begin_run();
  EXPECT_NEAR(up(imu, 105), 50, 1e-6) << "a new run has a new origin";
}

TEST_F(FirstTruthOriginTest, IsTheFirstPlaceThatIsKnown) {
  climb(200, false);
  Imu imu(model_, 1, 1);
  EXPECT_FALSE(imu.sample(timeline_, TruthTime{200'000'000'000}, {}).navigation.is_known);
  EXPECT_NEAR(up(imu, 204), 0, 1e-6);
  EXPECT_NEAR(up(imu, 206), 20, 1e-6);
}

}  // namespace
}  // namespace imud
