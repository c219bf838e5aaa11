// The state of the clock on which the grids of samples are: when it is refused, and what is reported.
#include "emulator/report/clock_watch.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <nlohmann/json.hpp>

#include "emulator/report/summary.hpp"
#include "emulator/watch/run_text.hpp"
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

// A limit about the clock of a run without an epoch is a mistake.
TEST(ClockWatch, ALimitOfTheClockNeedsAnEpoch) {
  Config config;
  config.clock = ClockMode::realtime;
  config.truth.port = "udp:127.0.0.1:9810";
  const auto limits = parse_requirements("clock.steps=0,clock.error_us<=100,clock.unsynchronised_s=0");
  EXPECT_THROW(check_figures(limits, config), RequirementError);
  config.realtime.epoch = Epoch::tai;
  EXPECT_NO_THROW(check_figures(limits, config));
  config.clock = ClockMode::lockstep;
  EXPECT_THROW(check_figures(limits, config), RequirementError) << "lockstep has no grid by a clock";
}

}  // namespace
}  // namespace imud
