// Which truths the timeline accepts, and the cause that it returns for each refusal.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <utility>

#include "core/timeline.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

Truth truth_at(Nanoseconds time, std::uint32_t sequence = 0) {
  Truth truth;
  truth.time = TruthTime{} + time;
  truth.sequence = sequence;
  return truth;
}

// Truths every 10 ms from 0 to 1 s, sequence 0 to 100.
Timeline second_of_truths(Timeline::Limits limits = {}) {
  Timeline timeline(limits);
  for (std::uint32_t k = 0; k <= 100; ++k) timeline.push(truth_at(k * 10ms, k));
  return timeline;
}

TEST(Admission, FirstIsANewRunTheOthersAreAccepted) {
  Timeline timeline;
  EXPECT_TRUE(timeline.empty());
  EXPECT_EQ(timeline.push(truth_at(3s)), Admission::new_run);
  EXPECT_FALSE(timeline.empty());
  EXPECT_EQ(timeline.run_start().ns, 3'000'000'000);
  EXPECT_EQ(timeline.push(truth_at(3s + 1ns)), Admission::accepted);
  EXPECT_EQ(timeline.push(truth_at(4s)), Admission::accepted);
  EXPECT_EQ(timeline.newest().ns, 4'000'000'000);
  EXPECT_EQ(timeline.run_start().ns, 3'000'000'000);
}

TEST(Admission, Duplicate) {
  Timeline timeline = second_of_truths();
  EXPECT_EQ(timeline.push(truth_at(1000ms, 100)), Admission::duplicate);
  EXPECT_EQ(timeline.push(truth_at(1000ms, 101)), Admission::duplicate);
  EXPECT_EQ(timeline.push(truth_at(500ms, 50)), Admission::duplicate);
  EXPECT_EQ(timeline.push(truth_at(0ms, 0)), Admission::duplicate);
  EXPECT_EQ(timeline.newest().ns, 1'000'000'000);
}

TEST(Admission, ReorderedWasSentBefore) {
  Timeline timeline = second_of_truths();
  EXPECT_EQ(timeline.push(truth_at(995ms, 99)), Admission::reordered);
  EXPECT_EQ(timeline.push(truth_at(-5s, 3)), Admission::reordered);
}

TEST(Admission, OvertakenButInTimeIsInserted) {
  Timeline timeline;
  for (const std::uint32_t k : {0U, 1U, 3U, 6U}) timeline.push(truth_at(k * 10ms, k));
  const auto at = [](Nanoseconds t) { return TruthTime{} + t; };
  EXPECT_EQ(timeline.revision(), 0U);
  EXPECT_EQ(timeline.push(truth_at(20ms, 2), at(20ms)), Admission::reordered) << "in use already";
  EXPECT_EQ(timeline.push(truth_at(20ms, 2), at(20ms - 1ns)), Admission::inserted);
  EXPECT_EQ(timeline.push(truth_at(20ms, 2), at(0ms)), Admission::duplicate);
  EXPECT_EQ(timeline.push(truth_at(50ms, 5), at(0ms)), Admission::inserted);
  EXPECT_EQ(timeline.push(truth_at(40ms, 4), at(0ms)), Admission::inserted);
  EXPECT_EQ(timeline.push(truth_at(-10ms, 0), at(-1s)), Admission::reordered) << "before the run";
  EXPECT_EQ(timeline.revision(), 3U);
  for (int k = 0; k < 6; ++k) EXPECT_EQ(timeline.next_truth(TruthTime{} + k * 10ms), TruthTime{} + (k + 1) * 10ms);
  EXPECT_EQ(timeline.newest().ns, 60'000'000);
  EXPECT_EQ(timeline.push(truth_at(70ms, 7)), Admission::accepted);
}

TEST(Admission, InsertedIntoAFullTimeline) {
  Timeline timeline;
  const auto capacity = static_cast<std::uint32_t>(Timeline::capacity);
  for (std::uint32_t k = 0; k < capacity + 10; ++k)
    if (k != capacity) timeline.push(truth_at(k * 10ms, k));
  const TruthTime oldest = TruthTime{} + 9 * 10ms;
  EXPECT_EQ(timeline.at({}).time, oldest);
  EXPECT_EQ(timeline.push(truth_at(capacity * 10ms, capacity), {}), Admission::inserted);
  EXPECT_EQ(timeline.at({}).time, oldest + 10ms) << "the oldest made room";
  EXPECT_EQ(timeline.push(truth_at(95ms, 9), {}), Admission::reordered) << "no room before the oldest";
  EXPECT_EQ(timeline.push(truth_at(105ms, 10), {}), Admission::reordered)
      << "it would push out the oldest, and be it";
  EXPECT_EQ(timeline.at({}).time, oldest + 10ms);
  for (std::uint32_t k = 10; k + 1 < capacity + 10; ++k)
    ASSERT_EQ(timeline.next_truth(TruthTime{} + k * 10ms), TruthTime{} + (k + 1) * 10ms) << k;
}

TEST(Admission, TimeBackWasSentLater) {
  Timeline timeline = second_of_truths();
  EXPECT_EQ(timeline.push(truth_at(995ms, 101)), Admission::time_back);
  EXPECT_EQ(timeline.push(truth_at(-5s, 101)), Admission::time_back);
}

TEST(Admission, SequenceWraps) {
  Timeline timeline;
  timeline.push(truth_at(1s, 0xffffffffU));
  EXPECT_EQ(timeline.push(truth_at(999ms, 0)), Admission::time_back);
  EXPECT_EQ(timeline.push(truth_at(2s, 0)), Admission::accepted);
  EXPECT_EQ(timeline.push(truth_at(1500ms, 0xfffffff0U)), Admission::reordered);
}

TEST(Admission, WithoutSequenceTheDistanceDecides) {
  Timeline timeline;
  timeline.push(truth_at(10s));
  timeline.push(truth_at(11s));
  EXPECT_EQ(timeline.push(truth_at(10'500ms)), Admission::reordered);
  EXPECT_EQ(timeline.push(truth_at(10'000ms - 1ns)), Admission::time_back);
}

TEST(Admission, TimeJumpIsBeyondTheGap) {
  Timeline::Limits limits;
  limits.max_gap = 2s;
  Timeline timeline = second_of_truths(limits);
  EXPECT_EQ(timeline.push(truth_at(3s + 1ns, 101)), Admission::time_jump);
  EXPECT_EQ(timeline.push(truth_at(3s, 101)), Admission::accepted);
}

TEST(Admission, RefusedTruthsLeaveNoTrace) {
  const Timeline expected = second_of_truths();
  Timeline timeline = second_of_truths();
  Truth late = truth_at(505ms, 3);
  late.omega_BN_B = {1.0, 1.0, 1.0};
  EXPECT_EQ(timeline.push(late), Admission::reordered);
  late = truth_at(100s, 101);
  late.omega_BN_B = {1.0, 1.0, 1.0};
  EXPECT_EQ(timeline.push(late), Admission::time_jump);
  EXPECT_EQ(timeline.newest(), expected.newest());
  EXPECT_EQ(timeline.at(TruthTime{505'000'000}).omega_BN_B, Vector3::Zero());
  EXPECT_EQ(timeline.at(TruthTime{1'005'000'000}).omega_BN_B, Vector3::Zero());
}

TEST(Restart, ByTheFlagAtOnce) {
  Timeline timeline = second_of_truths();
  Truth truth = truth_at(500ms, 0);
  truth.new_run = true;
  EXPECT_EQ(timeline.push(truth), Admission::new_run);
  EXPECT_EQ(timeline.run_start().ns, 500'000'000);
  EXPECT_EQ(timeline.newest().ns, 500'000'000);
  EXPECT_EQ(timeline.push(truth_at(510ms, 1)), Admission::accepted);
  EXPECT_EQ(timeline.at({}).basis, MotionState::Basis::held) << "nothing is left of the run before";
}

TEST(Restart, ForgettingThePastBeginsARunWithTheNewest) {
  Timeline timeline = second_of_truths();
  timeline.forget_past();
  EXPECT_EQ(timeline.run_start().ns, 1'000'000'000);
  EXPECT_EQ(timeline.newest().ns, 1'000'000'000);
  EXPECT_EQ(timeline.at(TruthTime{} + 500ms).basis, MotionState::Basis::held);
  EXPECT_EQ(timeline.push(truth_at(995ms, 99), {}), Admission::reordered) << "of the run before";
  Truth repeated = truth_at(1000ms, 100);
  repeated.new_run = true;
  EXPECT_EQ(timeline.push(repeated), Admission::duplicate) << "the run's first truth once more";
  EXPECT_EQ(timeline.push(truth_at(1010ms, 101)), Admission::accepted);
  EXPECT_EQ(timeline.at(TruthTime{} + 1005ms).basis, MotionState::Basis::interpolated);
}

TEST(Restart, FarAwayAfterThreeInARow) {
  Timeline timeline = second_of_truths();
  timeline.push(truth_at(10s, 101));
  EXPECT_EQ(timeline.push(truth_at(0ms + 1ns, 0)), Admission::reordered);
  EXPECT_EQ(timeline.push(truth_at(10ms + 1ns, 1)), Admission::reordered);
  EXPECT_EQ(timeline.push(truth_at(20ms + 1ns, 2)), Admission::new_run);
  EXPECT_EQ(timeline.run_start().ns, 20'000'001);
  EXPECT_EQ(timeline.push(truth_at(30ms + 1ns, 3)), Admission::accepted);
}

TEST(Restart, FarAheadAfterThreeInARow) {
  Timeline timeline = second_of_truths();
  EXPECT_EQ(timeline.push(truth_at(1000s, 0)), Admission::time_jump);
  EXPECT_EQ(timeline.push(truth_at(1001s, 1)), Admission::time_jump);
  EXPECT_EQ(timeline.push(truth_at(1002s, 2)), Admission::new_run);
}

TEST(Restart, ByTruthsThatAreTheLargestGapApart) {
  Timeline::Limits limits;
  limits.max_gap = 2s;
  for (const auto& [gap, third] : {std::pair{2s + 0ns, Admission::new_run}, {2s + 1ns, Admission::time_jump}}) {
    Timeline timeline = second_of_truths(limits);
    for (std::uint32_t k = 0; k < 2; ++k)
      EXPECT_EQ(timeline.push(truth_at(1000s + k * gap, k)), Admission::time_jump);
    EXPECT_EQ(timeline.push(truth_at(1000s + 2 * gap, 2)), third);
  }
}

TEST(Restart, NearbyAfterTwentyInARow) {
  Timeline timeline = second_of_truths();
  for (std::uint32_t k = 0; k < 19; ++k)
    EXPECT_EQ(timeline.push(truth_at(500ms + k * 10ms, k)), Admission::duplicate) << k;
  EXPECT_EQ(timeline.push(truth_at(690ms, 19)), Admission::new_run);
}

TEST(Restart, NotByABurstThatTheNetworkRepeats) {
  Timeline timeline = second_of_truths();
  for (int i = 0; i < 100; ++i)  // the same few repeated: they are not in ascending order
    for (std::uint32_t k = 81; k <= 99; ++k) ASSERT_EQ(timeline.push(truth_at(k * 10ms, k)), Admission::duplicate);
  for (int i = 0; i < 100; ++i) ASSERT_EQ(timeline.push(truth_at(-10s, 0)), Admission::reordered);
}

TEST(Restart, AnAcceptedTruthBetweenStartsTheCountAgain) {
  Timeline timeline = second_of_truths();
  for (std::uint32_t k = 1; k < 50; ++k) {
    ASSERT_NE(timeline.push(truth_at(-100s + k * 20ms, k)), Admission::new_run);
    ASSERT_NE(timeline.push(truth_at(-100s + k * 20ms + 10ms, k)), Admission::new_run);
    ASSERT_EQ(timeline.push(truth_at(1s + k * 10ms, 100 + k)), Admission::accepted);
  }
}

TEST(Range, EndsOfTimeDoNotOverflow) {
  constexpr std::int64_t limit = std::int64_t{1} << 62;
  Truth first = truth_at(Nanoseconds(-limit + 1)), last = truth_at(Nanoseconds(limit - 1));
  EXPECT_TRUE(is_in_range(first) && is_in_range(last));
  EXPECT_FALSE(is_in_range(truth_at(Nanoseconds(limit))));
  EXPECT_FALSE(is_in_range(truth_at(Nanoseconds(-limit))));
  Timeline timeline;
  timeline.push(first);
  EXPECT_EQ(timeline.push(last), Admission::time_jump);
  last.new_run = true;
  EXPECT_EQ(timeline.push(last), Admission::new_run);
  EXPECT_EQ(timeline.push(first), Admission::time_back);
  EXPECT_EQ(timeline.push(last), Admission::duplicate);  // the first truth of the run, repeated
  ++last.sequence;
  EXPECT_EQ(timeline.push(last), Admission::new_run);
}

TEST(Range, EveryNumberIsChecked) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](auto change) {
    Truth truth;
    change(truth);
    return !(is_finite(truth) && is_in_range(truth));
  };
  EXPECT_FALSE(refused([](Truth&) {}));
  for (const double bad : {nan, std::numeric_limits<double>::infinity(), -1e16}) {
    EXPECT_TRUE(refused([&](Truth& t) { t.r_BN_N.y() = bad; }));
    EXPECT_TRUE(refused([&](Truth& t) { t.v_BN_N.z() = bad; }));
    EXPECT_TRUE(refused([&](Truth& t) { t.q_NB.x() = bad; }));
    EXPECT_TRUE(refused([&](Truth& t) { t.omega_BN_B.x() = bad; }));
    EXPECT_TRUE(refused([&](Truth& t) { t.omegaDot_BN_B.y() = bad; }));
    EXPECT_TRUE(refused([&](Truth& t) { t.specific_force_B.z() = bad; }));
    EXPECT_TRUE(refused([&](Truth& t) { t.accumulated_dv_B.x() = bad; }));
  }
  EXPECT_TRUE(refused([](Truth& t) { t.q_NB.w() = 1.00001; }));
}

TEST(Range, EndsAtItsLimits) {
  const auto accepted = [](auto member, double value) {
    Truth truth;
    (truth.*member).x() = value;
    return is_in_range(truth);
  };
  for (const auto& [member, limit] : {std::pair{&Truth::r_BN_N, 1e15},
                                      {&Truth::v_BN_N, 1e9},
                                      {&Truth::omega_BN_B, 1e5},
                                      {&Truth::omegaDot_BN_B, 1e8},
                                      {&Truth::specific_force_B, 1e8},
                                      {&Truth::accumulated_dv_B, 1e9}}) {
    EXPECT_TRUE(accepted(member, limit) && accepted(member, -limit)) << limit;
    EXPECT_FALSE(accepted(member, limit * 1.001) || accepted(member, -limit * 1.001)) << limit;
  }
  for (const auto& [excess, is_accepted] :
       {std::pair{-2.1e-6, false}, {-1.9e-6, true}, {1.9e-6, true}, {2.1e-6, false}}) {
    Truth truth;
    truth.q_NB.w() = std::sqrt(1 + excess);
    EXPECT_EQ(is_in_range(truth), is_accepted) << excess;
  }
}

}  // namespace
}  // namespace imud
