// The fixes that a receiver reports: when they are made, and their age.
#include "core/navigation/receiver_fix.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <utility>
#include <vector>

#include "tests/core/navigation/navigating.hpp"

namespace imud {
namespace {

// 200 Hz, of which a receiver of 5 Hz makes a fix in one sample of 40.
NavigatingUnit receiving_unit(Nanoseconds latency = Nanoseconds{0}) {
  NavigatingUnit unit = ideal_unit();
  unit.rate_hz = 200;
  unit.navigation.latency = latency;
  tune(unit.navigator, unit);
  return unit;
}

// Returns the place of the truth of the flight at the time of the fix.
Navigation true_place(const NavigatingUnit& unit, const Sample& sample) {
  const TruthTime time{sample.fix_gps_ns() - unit.earth.start_gps_ns};
  const Truth truth = turn_at(time);
  return Earth(unit.earth)
      .navigation(
          {.is_known = true, .time = time, .r_N = truth.r_BN_N, .v_N = truth.v_BN_N, .earth_angle = std::nullopt});
}

TEST(ReceiverFix, OneOfFortySamplesHasANewFix) {
  for (const int latency_ms : {0, 120, 200}) {
    const NavigatingUnit unit = receiving_unit(std::chrono::milliseconds(latency_ms));
    std::vector<std::int64_t> times;
    std::int64_t last = -1;
    int samples = 0;
    fly(unit, 9.995, nullptr, [&](const Sample& sample, const Errors&, double t) {
      ASSERT_TRUE(sample.fix().is_known);
      const bool is_new = sample.fix_gps_ns() != std::exchange(last, sample.fix_gps_ns());
      if (t < 3 - 1e-9) return;
      ++samples;
      if (is_new) times.push_back(last);
      EXPECT_EQ(is_new, sample.solution->since_epoch == 0) << t;
      EXPECT_EQ(sample.fix_age(),
                std::chrono::milliseconds(latency_ms + 5 * static_cast<int>(sample.solution->since_epoch)));
      EXPECT_EQ(sample.fix().gps_ns, unit.earth.start_gps_ns + nanoseconds(t).count()) << "its clock runs";
      const Navigation truth = true_place(unit, sample);
      EXPECT_LT((sample.fix().r_E - truth.r_E).norm(), 1e-3) << t;
      EXPECT_LT((sample.fix().v_L - truth.v_L).norm(), 1e-3) << t;
    });
    EXPECT_EQ(samples, 1400);
    EXPECT_EQ(times.size(), 35U);
    for (std::size_t i = 1; i < times.size(); ++i) EXPECT_EQ(times[i] - times[i - 1], 200'000'000) << i;
  }
}

// The line of two antennas is measured at the epochs. Its age does not have the latency.
TEST(ReceiverFix, TheLineOfTheAntennasIsOfTheEpoch) {
  NavigatingUnit unit = receiving_unit(std::chrono::milliseconds(120));
  unit.navigation.antennas_heading = 0.01;
  std::optional<Vector3> last;
  int lines = 0;
  fly(unit, 5, nullptr, [&](const Sample& sample, const Errors&, double t) {
    ASSERT_NE(sample.antennas(), nullptr) << t;
    const Vector3 line = sample.antennas()->direction_L;
    const std::uint32_t since = sample.solution->since_epoch;
    EXPECT_EQ(sample.antennas_age(), std::chrono::milliseconds(5 * static_cast<int>(since))) << t;
    if (since == 0) ++lines;
    EXPECT_EQ(last == line, since != 0) << t;
    last = line;
  });
  EXPECT_GE(lines, 25);
}

// No truth is older than the run: at its begin the fixes are less late.
TEST(ReceiverFix, TheFirstFixesAreNotLate) {
  const NavigatingUnit unit = receiving_unit(std::chrono::milliseconds(500));
  int judged = 0;
  fly(unit, 1, nullptr, [&](const Sample& sample, const Errors&, double t) {
    ++judged;
    EXPECT_GE(sample.fix_gps_ns(), unit.earth.start_gps_ns);
    EXPECT_LT((sample.fix().r_E - true_place(unit, sample).r_E).norm(), 1e-3) << t;
  });
  EXPECT_EQ(judged, 201);
}

// A loss and a return show at the next epochs, a multiple of 0.2 s.
TEST(ReceiverFix, ALossShowsAtTheNextEpoch) {
  const auto outage = [](Sample& sample, double t) {
    if (t > 3.03 && t < 4.07) lose_fix(sample);
  };
  const NavigatingUnit unit = receiving_unit();
  int lost = 0;
  fly(unit, 6, outage, [&](const Sample& sample, const Errors&, double t) {
    const bool is_lost = t > 3.2 - 1e-6 && t < 4.2 - 1e-6;
    EXPECT_EQ(sample.fix().is_known, !is_lost) << t;
    lost += is_lost ? 1 : 0;
    if (t > 2) {
      EXPECT_EQ(sample.navigation.satellites, is_lost ? 0 : 12) << t;
    }
    const std::int64_t now = unit.earth.start_gps_ns + nanoseconds(t).count();
    EXPECT_EQ(sample.fix().gps_ns, is_lost ? 0 : now) << t << ": its clock runs on";
    const std::int64_t age_ns = is_lost ? 0 : 5'000'000 * std::int64_t{sample.solution->since_epoch};
    if (t > 2) {
      EXPECT_EQ(sample.fix_gps_ns(), now - age_ns) << t;
    }
  });
  EXPECT_EQ(lost, 200);
}

// A leap of the receiver's clock between two epochs shows at the next one. It is no age.
TEST(ReceiverFix, ALeapOfItsClockIsNoAge) {
  for (const std::int64_t leap_s : {3600, -10}) {
    const auto leap = [leap_s](Sample& sample, double t) {
      if (t > 3.03 && t < 4.07) sample.navigation.gps_ns += leap_s * 1'000'000'000;
    };
    const NavigatingUnit unit = receiving_unit(std::chrono::milliseconds(120));
    int leapt = 0;
    fly(unit, 6, leap, [&](const Sample& sample, const Errors&, double t) {
      const std::int64_t ahead_ns = sample.fix().gps_ns - unit.earth.start_gps_ns - nanoseconds(t).count();
      if (t < 2) return;
      EXPECT_EQ(sample.fix_age(), std::chrono::milliseconds(120 + 5 * sample.solution->since_epoch)) << t;
      const bool has_leapt = t > 3.12 - 1e-6 && t < 4.12 - 1e-6;  // epochs count from the alignment, 1.12 s
      EXPECT_EQ(ahead_ns, has_leapt ? leap_s * 1'000'000'000 : 0) << t;
      leapt += has_leapt ? 1 : 0;
    });
    EXPECT_EQ(leapt, 200);
  }
}

// After the alignment the filter is corrected by each fix that the unit reports, once.
TEST(ReceiverFix, TheFilterUsesTheFixesOfTheEpochs) {
  const NavigatingUnit unit = receiving_unit();
  std::uint64_t epochs = 0;
  bool was_aligned = false;
  fly(
      unit, 20, nullptr,
      [&](const Sample& sample, const Errors&, double) {
        if (was_aligned && sample.solution->since_epoch == 0) ++epochs;
        was_aligned = sample.solution->state != Solution::State::aligning;
      },
      1, in_time, turn_at, [&](const Navigator& navigator) { EXPECT_EQ(navigator.fixes().used, epochs); });
  EXPECT_EQ(epochs, 95U);
}

// With a rate of 0 the filter uses no fix, and every sample has one.
TEST(ReceiverFix, WithoutARateEverySampleIsAnEpoch) {
  NavigatingUnit unit = receiving_unit();
  unit.navigator.gnss_rate_hz = 0;
  fly(
      unit, 3, nullptr,
      [&](const Sample& sample, const Errors&, double) {
        EXPECT_EQ(sample.solution->since_epoch, 0U);
        EXPECT_EQ(sample.fix_age(), Nanoseconds{0});
      },
      1, in_time, turn_at, [](const Navigator& navigator) { EXPECT_EQ(navigator.fixes().used, 0U); });
}

// After a restart the next sample is an epoch. The fix that it is given keeps its age.
TEST(ReceiverFix, ARestartMakesAnEpoch) {
  ReceiverFix receiver(4);
  const Navigation fix = {.is_known = true, .gps_ns = 1'000'000'000, .age = Nanoseconds{7}};
  Solution solution;
  for (const std::uint32_t since : {0U, 1U, 2U}) {
    receiver.report(since == 0 ? fix : Navigation{}, 0.005, solution);
    EXPECT_EQ(solution.since_epoch, since);
    EXPECT_EQ(solution.receiver.gps_ns, 1'000'000'000 + 5'000'000 * since) << "by the unit's clock";
    EXPECT_EQ(solution.receiver.age.count(), 7 + 5'000'000 * since);
  }
  receiver.restart();
  receiver.report(Navigation(solution.receiver), 0.005, solution);
  EXPECT_EQ(solution.since_epoch, 0U);
  EXPECT_EQ(solution.receiver.age.count(), 10'000'007);
  receiver.restart();
  receiver.report({}, 0.005, solution);
  receiver.report(fix, 0.005, solution);
  EXPECT_FALSE(solution.receiver.is_known) << "before the next epoch";
}

}  // namespace
}  // namespace imud
