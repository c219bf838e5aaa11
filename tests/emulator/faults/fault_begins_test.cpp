// Faults that begin by the host: what it sends, and the time of its clock.
#include <gtest/gtest.h>

#include "emulator/config/load_config.hpp"
#include "emulator/config/scenario.hpp"
#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class FaultBeginsTest : public FaultyRunTest {
 protected:
  static std::string fault(const std::string& keys) {
    return "[[fault]]\ntarget = \"gyro\"\nkind = \"dead\"\nfor_samples = 3\n" + keys;
  }
  Config read(const std::string& text, const std::string& clock = "realtime") {
    std::string config = config_text(text, "native", 1,
                                     "rate_hz = 100\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\n"
                                     "accelerometer.max_m_per_s2 = 100\n");
    config.replace(config.find("\"fast\""), 6, "\"" + clock + "\"");
    return load_config(write("begins.toml", config));
  }
  std::string wrong(const std::string& text, const std::string& clock = "realtime") {
    try {
      static_cast<void>(read(text, clock));
      return {};
    } catch (const ConfigError& error) {
      return error.what();
    }
  }
  // Returns the samples, at 100 Hz, on which the fault acts; the host sends bytes after that of a number. A second
  // run begins after the first `samples`.
  struct Sends {
    int sample;  // -1: before the run
    std::string bytes;
  };
  static std::vector<int> acts(const Config& config, const std::vector<Sends>& host, int samples = 400,
                               int runs = 1) {
    FaultLog log;
    const std::vector<Normals> normals = fault_normals("imu1", 1, config.faults.size());
    FaultSchedule schedule(config.faults, normals, "imu1", 0, 100, log);
    const auto send_after = [&](int k) {
      for (const Sends& one : host)
        if (one.sample == k) schedule.host_sent(std::as_bytes(std::span(one.bytes)));
    };
    std::vector<int> all;
    send_after(-1);
    for (int k = 0; k < samples * runs; ++k) {
      if (k % samples == 0) schedule.begin_run();
      // The clock of the host reads 2026-01-01T12:00:00Z at sample 100.
      constexpr std::int64_t noon_ns = 1'767'268'800'000'000'000;
      schedule.take(Sample{}, std::chrono::milliseconds(10 * (k % samples)),
                    noon_ns + std::int64_t{10'000'000} * (k - 100));
      if (schedule.is_active(config.faults[0].name)) all.push_back(k);
      send_after(k);
    }
    return all;
  }
};

using Numbers = std::vector<int>;

TEST_F(FaultBeginsTest, AfterWhatTheHostHasSent) {
  const Config any = read(fault("after_host = \"any\"\n")), later = read(fault("after_host = \"any\"\nat_s = 1.5\n")),
               reset = read(fault("after_host = {hex = \"fa ff 40\"}\nat_sample = 7\n"));
  EXPECT_EQ(acts(any, {}), Numbers());
  EXPECT_EQ(acts(any, {{41, "x"}, {60, "y"}}), (Numbers{42, 43, 44}));
  EXPECT_EQ(acts(any, {{41, ""}}), Numbers());
  EXPECT_EQ(acts(later, {{41, "x"}}), (Numbers{192, 193, 194}));
  EXPECT_EQ(acts(reset, {{20, "\xFA\xFF"}, {25, "\x40"}}), (Numbers{33, 34, 35}));
  EXPECT_EQ(acts(reset, {{20, "\xFA\xFF\xFF\x40"}}), Numbers());
  // Before the first run, and once in each run.
  EXPECT_EQ(acts(any, {{-1, "x"}}), (Numbers{0, 1, 2}));
  EXPECT_EQ(acts(any, {{-1, "x"}, {450, "x"}}, 400, 2), (Numbers{0, 1, 2, 451, 452, 453}));
  EXPECT_EQ(acts(read(fault("after_host = \"any\"\nevery_s = 1\ntimes = 2\n")), {{41, "x"}}),
            (Numbers{42, 43, 44, 142, 143, 144}));
}

// Faults that a command has ended begin again in the next run.
TEST_F(FaultBeginsTest, WhatACommandHasEndedBeginsAgainInTheNextRun) {
  const Config config = read(fault("at_s = 1\n"));
  for (const bool all : {false, true}) {
    FaultLog log;
    const std::vector<Normals> normals = fault_normals("imu1", 1, config.faults.size());
    FaultSchedule schedule(config.faults, normals, "imu1", 0, 100, log);
    std::vector<int> acts;
    for (int k = 0; k < 400; ++k) {
      if (k % 200 == 0) schedule.begin_run();
      if (k == 50) all ? schedule.end_all() : schedule.end(0);
      schedule.take(Sample{}, std::chrono::milliseconds(10 * (k % 200)));
      if (schedule.is_active(config.faults[0].name)) acts.push_back(k);
    }
    EXPECT_EQ(acts, (Numbers{300, 301, 302}));
  }
}

TEST_F(FaultBeginsTest, AtATimeOfTheHost) {
  EXPECT_EQ(acts(read(fault("at_time = 2026-01-01T12:00:00Z\n")), {}), (Numbers{100, 101, 102}));
  EXPECT_EQ(acts(read(fault("at_time = 2026-01-01T13:00:00.005+01:00\n")), {}), (Numbers{101, 102, 103}));
  EXPECT_EQ(acts(read(fault("at_time = 2026-01-01T07:29:59.5-04:30\nat_s = 1\n")), {}), (Numbers{150, 151, 152}));
  EXPECT_EQ(acts(read(fault("at_time = 2025-12-31T12:00:00Z\n")), {}), (Numbers{0, 1, 2})) << "it has come";
}

TEST_F(FaultBeginsTest, AreExplained) {
  EXPECT_EQ(read(fault("after_host = {text = \"RESET\"}\nat_s = 3\n")).faults[0].text(),
            "imu1 gyro: the value is 0, from 3 s after the host has sent \"RESET\", for 3 samples");
  EXPECT_EQ(read(fault("after_host = \"any\"\n")).faults[0].text(),
            "imu1 gyro: the value is 0, from 0 s after the host has sent bytes, for 3 samples");
  const Config config = read(fault("at_time = 2026-01-01T13:00:00.005+01:00\n"));
  EXPECT_EQ(config.faults[0].text(),
            "imu1 gyro: the value is 0, from 0 s after 2026-01-01T13:00:00.005+01:00, for 3 samples");
  EXPECT_EQ(load_config(write("again.toml", config.resolved())).resolved(), config.resolved());
}

TEST_F(FaultBeginsTest, NeedTheHost) {
  const std::string after = fault("after_host = \"any\"\n"), at_time = fault("at_time = 2026-01-01T12:00:00Z\n");
  for (const std::string clock : {"fast", "lockstep"}) {
    EXPECT_TRUE(
        contains(wrong(after, clock), "fault.0.after_host: needs clock = \"realtime\", or the replay of a record"))
        << wrong(after, clock);
    EXPECT_TRUE(contains(wrong(at_time, clock), "fault.0.at_time: needs clock = \"realtime\""))
        << wrong(at_time, clock);
  }
  EXPECT_TRUE(contains(wrong(fault("after_host = \"GO\"\n")), "fault.0.after_host: give \"any\", {text"));
  EXPECT_TRUE(contains(wrong(fault("after_host = {}\n")), "fault.0.after_host: give text or hex"));
  EXPECT_TRUE(contains(wrong(fault("after_host = {hex = \"f\"}\n")), "fault.0.after_host.hex: give bytes as"));
  EXPECT_TRUE(
      contains(wrong(fault("at_time = 2026-01-01T12:00:00\n")), "fault.0.at_time: give a date and time with"));
  EXPECT_TRUE(contains(wrong(fault("at_time = 2026-01-01T12:00:00Z\nafter_host = \"any\"\n")),
                       "give either after_host or at_time"));
  EXPECT_TRUE(
      contains(wrong("[[fault]]\ntarget = \"truth\"\nkind = \"nan\"\nafter_host = \"any\"\n"), "truth has no host"));
  // A record that gives the truth alone does not have the host.
  Config config = read(after);
  EXPECT_NO_THROW(check_begins_by_host(config, false));
  config.clock = ClockMode::fast;
  EXPECT_NO_THROW(check_begins_by_host(config, true));
  EXPECT_THROW(check_begins_by_host(config, false), ConfigError);
}

// A simulator in lockstep waits for the answer to a truth that does not come.
TEST_F(FaultBeginsTest, LateAndLostTruthNeedAnotherClockThanLockstep) {
  for (const std::string kind : {"late", "lost"}) {
    const std::string text = "[[fault]]\ntarget = \"truth\"\nkind = \"" + kind + "\"\n";
    EXPECT_TRUE(contains(wrong(text, "lockstep"), "fault.0.kind: " + kind + " needs another clock than \"lockstep\""))
        << wrong(text, "lockstep");
    EXPECT_EQ(read(text).faults.size(), 1U);
  }
}

}  // namespace
}  // namespace imud
