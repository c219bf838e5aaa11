// The map from a shared clock to the simulator's time: exact, whichever truths a host has, and what it refuses.
#include "emulator/truth/truth_stamps.hpp"

#include <gtest/gtest.h>

#include <random>

namespace imud {
namespace {

using namespace std::chrono_literals;
using Result = TruthStamps::Result;

constexpr SharedTime in_2026{1'795'834'994'123'456'789};

// A simulator that runs as the clock does since `begin`.
struct Simulator {
  SharedTime begin = in_2026;
  ClockStamp stamp(TruthTime time) const { return {SharedClock::tai, begin + (time - TruthTime{})}; }
  // Takes the truth of `time`, which arrives `latency` after its stamp.
  TruthStamps::Taken send(TruthStamps& stamps, TruthTime time, Nanoseconds latency = 3ms) const {
    return stamps.take(time, stamp(time), stamp(time).time + latency);
  }
};

TEST(TruthStamps, AreExactWhicheverTruthsAHostHas) {
  const Simulator simulator;
  std::mt19937 random(1);
  TruthStamps all(SharedClock::tai), some(SharedClock::tai);
  for (int k = 0; k < 20'000; ++k) {
    const TruthTime time{k * 3'333'333LL};
    ASSERT_EQ(simulator.send(all, time).result, Result::used);
    if (random() % 10 == 0 || k == 0) {
      ASSERT_EQ(simulator.send(some, time, Nanoseconds(random() % 900'000'000)).shift, 0ns);
    }
    if (k < 10) continue;
    for (const Nanoseconds ago : {-70ms, 0ms, 20ms, 1000ms}) {
      const SharedTime at = simulator.stamp(time).time - ago - 1ns;
      ASSERT_EQ(all.truth(at), time - ago - 1ns);
      ASSERT_EQ(some.truth(at), all.truth(at)) << k;
    }
  }
}

// Half as fast as the clock: linear between two stamps, and as the clock after the last.
TEST(TruthStamps, AreLinearBetweenTwoTruths) {
  TruthStamps stamps(SharedClock::tai);
  for (int k = 0; k < 3000; ++k) {
    const SharedTime at = in_2026 + k * 20ms;
    EXPECT_EQ(stamps.take(TruthTime{k * 10'000'000LL}, {SharedClock::tai, at}, at + 1ms).shift, k == 0 ? 0ms : 10ms);
  }
  EXPECT_EQ(stamps.truth(in_2026 + 2999 * 20ms - 13ms), TruthTime{29'983'500'000});
  EXPECT_EQ(stamps.truth(in_2026 + 2999 * 20ms + 7ms), TruthTime{29'997'000'000});
  // Older ones than it keeps: as the clock before the oldest.
  const TruthTime oldest{(3000 - 1024) * 10'000'000LL};
  EXPECT_EQ(stamps.truth(in_2026 + (3000 - 1024) * 20ms), oldest);
  EXPECT_EQ(stamps.truth(in_2026 + (3000 - 1024) * 20ms - 5ms), oldest - 5ms);
}

// A pause of two seconds, and a leap of three: both change the map, which never goes back.
TEST(TruthStamps, FollowAPauseAndALeap) {
  TruthStamps stamps(SharedClock::tai);
  Simulator simulator;
  for (int k = 0; k < 100; ++k) simulator.send(stamps, TruthTime{k * 10'000'000LL});
  simulator.begin = simulator.begin + 2s;
  EXPECT_EQ(simulator.send(stamps, TruthTime{1'000'000'000}).shift, 2s);
  EXPECT_EQ(stamps.truth(in_2026 + 3s - 1ns), TruthTime{1'000'000'000 - 1});
  EXPECT_EQ(stamps.truth(in_2026 + 990ms), TruthTime{990'000'000});
  simulator.begin = simulator.begin - 3s;
  EXPECT_EQ(simulator.send(stamps, TruthTime{4'010'000'000}).shift, -3s);
  EXPECT_EQ(simulator.send(stamps, TruthTime{4'020'000'000}).shift, 0s);
  TruthTime before = stamps.truth(in_2026);
  for (SharedTime at = in_2026; at <= in_2026 + 3020ms; at = at + 1ms) {
    ASSERT_GE(stamps.truth(at), before);
    before = stamps.truth(at);
  }
  EXPECT_EQ(before, TruthTime{4'020'000'000});
}

TEST(TruthStamps, RefuseWhatCannotBe) {
  const Simulator simulator;
  TruthStamps stamps(SharedClock::tai);
  EXPECT_EQ(stamps.take({}, {}, in_2026).result, Result::none);
  EXPECT_EQ(stamps.take({}, {SharedClock::utc, in_2026}, in_2026).result, Result::other_clock);
  EXPECT_TRUE(stamps.is_empty());
  EXPECT_EQ(simulator.send(stamps, TruthTime{0}, 1s).result, Result::used);
  EXPECT_EQ(simulator.send(stamps, TruthTime{1}, -1s).result, Result::used) << "a simulator that is ahead";
  // Not later: refused, and the map stays.
  for (const Nanoseconds back : {Nanoseconds(0), Nanoseconds(500ms)})
    EXPECT_EQ(stamps.take(TruthTime{2}, {SharedClock::tai, in_2026 + 1ns - back}, in_2026).result, Result::not_later);
  EXPECT_EQ(stamps.truth(in_2026 + 5ns), TruthTime{5});
  // Too far: the map is not used any more, and begins again. A truth that was held up goes on with it.
  EXPECT_EQ(simulator.send(stamps, TruthTime{3}, 10s).result, Result::used);
  EXPECT_EQ(simulator.send(stamps, TruthTime{4}, 10s + 1ns).result, Result::far);
  EXPECT_TRUE(stamps.is_empty());
  EXPECT_EQ(simulator.send(stamps, TruthTime{4}, 1s + 1ns).result, Result::far);
  EXPECT_TRUE(stamps.is_empty());
  EXPECT_EQ(simulator.send(stamps, TruthTime{4}, -1s - 1ns).result, Result::far);
  EXPECT_EQ(simulator.send(stamps, TruthTime{5}).result, Result::used);
  EXPECT_EQ(stamps.truth(in_2026), TruthTime{0});
  TruthStamps without(SharedClock::none);
  EXPECT_EQ(simulator.send(without, TruthTime{0}).result, Result::none);
}

}  // namespace
}  // namespace imud
