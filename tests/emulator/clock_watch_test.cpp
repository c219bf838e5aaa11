// The state of the clock on which the grids of samples are: when it is refused, and what is reported.
#include "emulator/report/clock_watch.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <nlohmann/json.hpp>

#include "emulator/report/summary.hpp"
#include "emulator/watch/run_text.hpp"
#include "emulator/web/metrics.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

constexpr ClockState synchronised{.is_synchronised = true, .error_us = 12, .max_error_us = 340, .tai_offset_s = 37};

TEST(ClockWatch, AClockThatOtherHostsDoNotShareIsRefused) {
  ClockState unsynchronised = synchronised, without_tai = synchronised;
  unsynchronised.is_synchronised = false;
  without_tai.tai_offset_s = 0;
  const ClockState unknown{.error = EPERM};
  const auto fault = [](Epoch epoch, const ClockState& state) {
    RealtimeConfig config;
    config.epoch = epoch;
    const std::string text = epoch_fault(config, state);
    config.allow_unsynchronised = true;
    EXPECT_EQ(epoch_fault(config, state), "");
    EXPECT_EQ(text.empty(), text.find("allow_unsynchronised = true") == text.npos) << text;
    return text;
  };
  for (const Epoch epoch : {Epoch::none, Epoch::monotonic})
    for (const ClockState& state : {synchronised, unsynchronised, without_tai, unknown})
      EXPECT_EQ(fault(epoch, state), "");
  for (const Epoch epoch : {Epoch::tai, Epoch::utc}) {
    EXPECT_EQ(fault(epoch, synchronised), "");
    EXPECT_TRUE(contains(fault(epoch, unsynchronised), "is not synchronised"));
    EXPECT_TRUE(contains(fault(epoch, unknown), "Operation not permitted"));
  }
  EXPECT_EQ(fault(Epoch::utc, without_tai), "");
  EXPECT_TRUE(contains(fault(Epoch::tai, without_tai), "offset of TAI from UTC is 0"));
}

TEST(ClockWatch, TheSummaryReportsTheClock) {
  Summary summary;
  EXPECT_FALSE(contains(text(summary), "clock "));
  EXPECT_FALSE(find_count(summary, "clock.steps"));
  ClockCounters counters;
  counters.steps.count(2);
  counters.last_step = -1;
  summary.clock = {.epoch = Epoch::tai,
                   .counters = Snapshot(counters),
                   .state = synchronised,
                   .largest_error_us = 55,
                   .unsynchronised_s = 3};
  EXPECT_TRUE(contains(text(summary), "clock    tai, clock error 12 us (at most 340 us), 2 steps\n"))
      << text(summary);
  EXPECT_TRUE(contains(line(summary), ", clock error 12 us")) << line(summary);
  EXPECT_EQ(find_count(summary, "clock.steps"), 2U);
  EXPECT_EQ(find_count(summary, "clock.error_us"), 55U);
  EXPECT_EQ(find_count(summary, "clock.unsynchronised_s"), 3U);
  EXPECT_FALSE(find_count(summary, "clock.other"));
  const auto json = nlohmann::json::parse(imud::json(summary, JsonLayout::line))["clock"];
  EXPECT_EQ(json["epoch"], "tai");
  EXPECT_EQ(json["error_us"], 12);
  EXPECT_EQ(json["tai_offset_s"], 37);
  EXPECT_EQ(json["last_step_us"], -1e6);
  Summary::Imu imu;
  imu.name = "imu1";
  imu.first_k = 77;
  summary.imus.push_back(imu);
  const auto status = [&] { return clock_line(Json::parse(imud::json(summary, JsonLayout::line))); };
  EXPECT_EQ(status(), "grids on tai, clock error 12 us, 2 steps, imu1 from k 77");
  EXPECT_TRUE(contains(text(summary), "; first k 77\n")) << text(summary);
  summary.clock->state->is_synchronised = false;
  EXPECT_EQ(status(), "grids on tai, clock not synchronised, 2 steps, imu1 from k 77");
  EXPECT_TRUE(contains(text(summary), "clock    tai, clock not synchronised, 2 steps\n")) << text(summary);
  summary.clock->state.reset();
  summary.clock->epoch = Epoch::monotonic;
  EXPECT_TRUE(contains(text(summary), "clock    monotonic, 2 steps\n")) << text(summary);
}

// The clock is not synchronised from 10 s to 20 s of a minute.
TEST(ClockWatch, CountsSecondsHoweverOftenItReads) {
  RealtimeConfig config;
  config.epoch = Epoch::tai;
  const ClockCounters counters;
  for (const std::int64_t interval_ms : {10, 100, 1'000, 2'500}) {
    constexpr std::int64_t begin_s = 1'000'000;
    HostTime now{};
    ClockWatch watch(config, &counters, [&] {
      const double since_s = seconds(now - HostTime{}) - begin_s;
      ClockState state = synchronised;
      state.is_synchronised = since_s < 10 || since_s >= 20;
      return state;
    });
    const auto unsynchronised_s = [&] { return watch.figures().value().unsynchronised_s; };
    for (std::int64_t ms = 0; ms <= 60'000; ms += interval_ms) {
      now = HostTime{} + std::chrono::seconds(begin_s) + std::chrono::milliseconds(ms);
      watch.update(now);
      if (ms < 10'000) {
        ASSERT_EQ(unsynchronised_s(), 0U) << ms;
      }
      // The state is read once a second, so each change is found up to a second late, or at the next update.
      if (ms == 15'000) {
        EXPECT_NEAR(static_cast<double>(unsynchronised_s()), 5, 1) << interval_ms;
      }
    }
    EXPECT_NEAR(static_cast<double>(unsynchronised_s()), 10, 1) << interval_ms;
  }
}

// A run may be shorter than a second.
TEST(ClockWatch, OneReadingThatIsNotSynchronisedIsNotZero) {
  RealtimeConfig config;
  config.epoch = Epoch::utc;
  const ClockCounters counters;
  ClockWatch watch(config, &counters, [] { return ClockState{}; });
  watch.update(HostTime{5'000'000'000});
  watch.update(HostTime{5'000'000'001});
  EXPECT_EQ(watch.figures().value().unsynchronised_s, 1U);
}

// The kernel does not give its state, and the run was allowed nevertheless.
TEST(ClockWatch, AnErrorThatIsNotKnownIsNotZero) {
  Config config;
  config.truth.port = "udp:127.0.0.1:9810";
  Summary summary;
  summary.clock.emplace();
  summary.clock->epoch = Epoch::tai;
  summary.clock->state = ClockState{.error = EPERM};
  summary.clock->unsynchronised_s = 3;
  EXPECT_TRUE(contains(text(summary), "clock    tai, clock error not known, 0 steps\n")) << text(summary);
  const auto json = nlohmann::json::parse(imud::json(summary, JsonLayout::line));
  EXPECT_EQ(json["clock"]["synchronised"], false);
  EXPECT_EQ(json["clock"]["unsynchronised_s"], 3);
  for (const std::string key : {"error_us", "largest_error_us", "max_error_us", "tai_offset_s"})
    EXPECT_FALSE(json["clock"].contains(key)) << key;
  EXPECT_EQ(clock_line(Json::parse(json.dump())), "grids on tai, clock error not known, 0 steps");
  EXPECT_TRUE(contains(metrics(summary, MetricsFormat::text), "imud_clock_synchronised 0\n"));
  EXPECT_FALSE(contains(metrics(summary, MetricsFormat::text), "imud_clock_error_seconds"));
  const auto limits =
      parse_requirements("clock.error_us<=100,clock.error_us>=0,clock.unsynchronised_s=0,clock.steps=0");
  const Outcome outcome = judge(summary, config, EndedBy::duration, limits);
  ASSERT_EQ(outcome.required.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(outcome.required[i].holds, i == 3) << i;
  EXPECT_EQ(outcome.required[0].seen_text(), "not known");
  summary.whole = {outcome, 1, "", {}};
  EXPECT_TRUE(contains(text(summary), "required clock.error_us<=100: VIOLATED, not known\n")) << text(summary);
  EXPECT_TRUE(nlohmann::json::parse(imud::json(summary, JsonLayout::line))["required"][0]["seen"].is_null());
}

// A limit about the clock of a run without an epoch is a mistake.
TEST(ClockWatch, ALimitOfTheClockNeedsAnEpoch) {
  Config config;
  config.clock = ClockMode::realtime;
  config.truth.port = "udp:127.0.0.1:9810";
  const auto limits = parse_requirements("clock.steps=0,clock.error_us<=100,clock.unsynchronised_s=0");
  EXPECT_THROW(check_figures(limits, config), RequirementError);
  config.realtime.epoch = Epoch::tai;
  EXPECT_NO_THROW(check_figures(limits, config));
  // Nothing synchronises the host's own clock.
  config.realtime.epoch = Epoch::monotonic;
  EXPECT_NO_THROW(check_figures(parse_requirements("clock.steps=0"), config));
  for (const std::string limit : {"clock.error_us<=100", "clock.unsynchronised_s=0"}) {
    try {
      check_figures(parse_requirements(limit), config);
      ADD_FAILURE() << limit;
    } catch (const RequirementError& error) {
      EXPECT_TRUE(contains(error.what(), "realtime.epoch = \"monotonic\" is this host's own clock")) << error.what();
    }
  }
  config.clock = ClockMode::lockstep;
  EXPECT_THROW(check_figures(limits, config), RequirementError) << "lockstep has no grid by a clock";
}

}  // namespace
}  // namespace imud
