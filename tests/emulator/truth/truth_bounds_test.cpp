// Numbers and steps of truth beyond what the sensors are built for.
#include "emulator/ground/truth_bounds.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "core/attitude.hpp"

namespace imud {
namespace {

using Kind = BoundsWatch::Kind;

constexpr TruthBounds bounds = {.rate = 10, .acceleration = 50, .velocity = 300};

// A vehicle that turns and accelerates within the bounds.
Truth flight(int i) {
  const double t = 0.01 * i;
  Truth truth;
  truth.time.ns = 10'000'000 * i;
  truth.q_NB = exp(Vector3(0, 0, 5 * t));
  truth.omega_BN_B = {0, 0, 5};
  truth.has_specific_force = true;
  truth.specific_force_B = {0, 20, -9.8};
  truth.has_velocity = truth.has_position = true;
  truth.v_BN_N = {100 + 20 * t, 0, 0};
  truth.r_BN_N = {100 * t + 10 * t * t, 0, 0};
  return truth;
}

// Returns what is found in a flight whose truth number 50 is changed.
template <class Change>
std::vector<BoundsWatch::Excess> found(Change change) {
  BoundsWatch watch(bounds);
  std::vector<BoundsWatch::Excess> all;
  for (int i = 0; i < 100; ++i) {
    Truth truth = flight(i);
    if (i == 50) change(truth);
    if (const auto excess = watch.check(truth, i > 0)) all.push_back(*excess);
  }
  return all;
}

TEST(TruthBounds, AFlightWithinThemIsSilent) {
  EXPECT_TRUE(found([](Truth&) {}).empty());
}

TEST(TruthBounds, EachExcessIsFoundWithItsValue) {
  const auto expect = [](Kind kind, double value, auto change) {
    const auto all = found(change);
    ASSERT_FALSE(all.empty()) << static_cast<int>(kind);
    EXPECT_EQ(all[0].kind, kind);
    EXPECT_NEAR(all[0].value, value, 0.02 * value);
    EXPECT_GT(all[0].value, all[0].bound);
  };
  expect(Kind::rate, 40, [](Truth& truth) { truth.omega_BN_B.x() = 39.7; });
  expect(Kind::force, 90, [](Truth& truth) { truth.specific_force_B.z() = -87.7; });
  expect(Kind::velocity, 400, [](Truth& truth) { truth.v_BN_N.x() = 400; });
  expect(Kind::turn, 55, [](Truth& truth) { truth.q_NB = truth.q_NB * exp(Vector3(0, 0, 0.5)); });
  expect(Kind::speed_up, 200, [](Truth& truth) { truth.v_BN_N.x() += 1.85; });
  expect(Kind::jump, 30, [](Truth& truth) { truth.r_BN_N.z() += 30; });
}

TEST(TruthBounds, WhatIsWithinResolutionOrDoesNotFollowIsSilent) {
  EXPECT_TRUE(found([](Truth& truth) { truth.r_BN_N.z() += 3; }).empty());
  EXPECT_TRUE(found([](Truth& truth) { truth.v_BN_N.z() += 0.04; }).empty());
  EXPECT_TRUE(found([](Truth& truth) { truth.has_rate = truth.has_specific_force = false; }).empty());
  // Another run, and a gap.
  BoundsWatch watch(bounds);
  EXPECT_FALSE(watch.check(flight(0), false));
  Truth elsewhere = flight(1);
  elsewhere.r_BN_N.y() = 1e5;
  elsewhere.q_NB = exp(Vector3(1, 0, 0));
  EXPECT_FALSE(watch.check(elsewhere, false));
  elsewhere = flight(150);
  EXPECT_FALSE(watch.check(elsewhere, true));
  // 0 is no bound.
  BoundsWatch none({});
  elsewhere.omega_BN_B.x() = 1e4;
  EXPECT_FALSE(none.check(elsewhere, false));
}

TEST(TruthBounds, EachKindIsFoundOnce) {
  BoundsWatch watch(bounds);
  Truth truth = flight(0);
  truth.omega_BN_B.x() = 100;
  truth.specific_force_B.x() = 100;
  EXPECT_EQ(watch.check(truth, false)->kind, Kind::rate);
  EXPECT_EQ(watch.check(truth, false)->kind, Kind::force) << "one at a time";
  EXPECT_FALSE(watch.check(truth, false));
}

}  // namespace
}  // namespace imud
