#include "emulator/truth/truth_monitor.hpp"

#include <gtest/gtest.h>

#include "tests/emulator/instants.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

constexpr Timeline::Limits limits = {.extrapolate = 100ms};

TEST(TruthMonitor, AJumpIsATruthFarTooEarly) {
  TruthMonitor monitor(limits);
  monitor.begin_run(truth(0), host(0));
  EXPECT_FALSE(monitor.has_jumped(truth(0.1), host(0.1), truth(0.1)));
  EXPECT_FALSE(monitor.has_jumped(truth(0.45), host(0.2), truth(0.2))) << "as early as a network may make it";
  EXPECT_TRUE(monitor.has_jumped(truth(5), host(0.3), truth(0.3)));
}

// One jump in a minute is a user's action; two within a second are a simulator that runs fast, at the rate between
// them.
TEST(TruthMonitor, JumpsOneAfterTheOtherAreAFastSimulator) {
  TruthMonitor monitor(limits);
  monitor.begin_run(truth(0), host(0));
  ASSERT_TRUE(monitor.has_jumped(truth(10), host(1), truth(1)));
  monitor.begin_run(truth(10), host(1));
  for (int k = 1; k <= 60; ++k) ASSERT_FALSE(monitor.has_jumped(truth(10 + k), host(1 + k), truth(10 + k)));
  ASSERT_TRUE(monitor.has_jumped(truth(100), host(61.5), truth(70.5)));
  EXPECT_EQ(monitor.rate(), 1) << "the jump before was a minute ago";
  monitor.begin_run(truth(100), host(61.5));
  ASSERT_TRUE(monitor.has_jumped(truth(101), host(61.75), truth(100.25)));
  EXPECT_DOUBLE_EQ(monitor.rate(), 4);
}

// A restart begins a run, too. A jump soon after it is a single one if no other jump was within a second before it.
TEST(TruthMonitor, AJumpSoonAfterARestartIsTheFirst) {
  TruthMonitor monitor(limits);
  monitor.begin_run(truth(0), host(0));
  ASSERT_TRUE(monitor.has_jumped(truth(10), host(1), truth(1)));
  monitor.begin_run(truth(10), host(1));
  for (int k = 1; k <= 60; ++k) ASSERT_FALSE(monitor.has_jumped(truth(10 + k), host(1 + k), truth(10 + k)));
  monitor.begin_run(truth(0), host(62));
  ASSERT_TRUE(monitor.has_jumped(truth(5), host(62.5), truth(0.5)));
  EXPECT_EQ(monitor.rate(), 1);
}

TEST(TruthMonitor, APauseIsTruthThatStaysLate) {
  TruthMonitor monitor(limits);
  monitor.begin_run(truth(0), host(0));
  int paused = 0;
  for (int k = 0; k < 30; ++k)
    paused += monitor.was_paused(truth(0.01 * k), truth(1 + 0.01 * k), host(1 + 0.01 * k), 1);
  EXPECT_GT(paused, 0);
  EXPECT_EQ(monitor.rate(), 1) << "its time goes by as before";
}

// Single late truths do not add up to a pause, however many; nor do two late truths far apart.
TEST(TruthMonitor, LateTruthsAmongOthersAreNoPause) {
  TruthMonitor monitor(limits);
  monitor.begin_run(truth(0), host(0));
  for (int k = 0; k < 1000; ++k) {
    const double now_s = 0.1 * k;
    ASSERT_FALSE(monitor.was_paused(truth(now_s - 0.5), truth(now_s), host(now_s), 1)) << k;
    ASSERT_FALSE(monitor.was_paused(truth(now_s - 0.5), truth(now_s), host(now_s), 1)) << k;
    ASSERT_FALSE(monitor.was_paused(truth(now_s), truth(now_s), host(now_s + 0.01), 1)) << k;
  }
}

TEST(TruthMonitor, ASlowSimulatorIsFollowedAtItsRate) {
  TruthMonitor monitor(limits);
  monitor.begin_run(truth(0), host(0));
  bool paused = false;
  for (int k = 0; k < 100 && !paused; ++k)
    paused = monitor.was_paused(truth(0.005 * k), truth(1 + 0.01 * k), host(0.01 * k), 1);
  ASSERT_TRUE(paused);
  EXPECT_NEAR(monitor.rate(), 0.5, 1e-6);
}

}  // namespace
}  // namespace imud
