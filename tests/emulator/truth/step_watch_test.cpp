// Which time steps of a truth stream are gaps.
#include "emulator/truth/step_watch.hpp"

#include <gtest/gtest.h>

namespace imud {
namespace {

using namespace std::chrono_literals;

TEST(StepWatch, AStepFarAboveTheUsualIsAGap) {
  StepWatch steps;
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(steps.is_gap(10ms));
  EXPECT_FALSE(steps.is_gap(30ms));
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(steps.is_gap(10ms));
  EXPECT_TRUE(steps.is_gap(31ms));
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(steps.is_gap(10ms));
  EXPECT_TRUE(steps.is_gap(10s));
}

TEST(StepWatch, JitterAndAShortFirstStepAreNoGaps) {
  StepWatch steps;
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE(steps.is_gap(i % 3 == 0 ? 20ms : 6ms)) << i;
  steps.begin_run();
  EXPECT_FALSE(steps.is_gap(1ms)) << "the first step of a run is usual";
  EXPECT_FALSE(steps.is_gap(1s)) << "and so is the second";
  EXPECT_FALSE(steps.is_gap(1s));
  EXPECT_TRUE(steps.is_gap(4s));
}

TEST(StepWatch, ANewRateBecomesTheUsualOne) {
  StepWatch steps;
  for (int i = 0; i < 100; ++i) steps.is_gap(1ms);
  int gaps = 0;
  for (int i = 0; i < 100; ++i) gaps += steps.is_gap(100ms);
  EXPECT_GE(gaps, 1);
  EXPECT_LE(gaps, 6);
}

}  // namespace
}  // namespace imud
