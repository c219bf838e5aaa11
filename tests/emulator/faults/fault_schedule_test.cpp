// When faults act: occurrences, conditions, drawn numbers, and many faults at once.
#include "emulator/faults/fault_schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iterator>
#include <span>
#include <vector>

#include "emulator/config/load_config.hpp"
#include "emulator/faults/fault_kinds.hpp"
#include "emulator/faults/fault_labels.hpp"
#include "emulator/report/outcome.hpp"
#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class FaultScheduleTest : public FaultyRunTest {
 protected:
  std::string faults_of(const std::string& text) {
    try {
      load_config(write("bad.toml", config_text(text, "native", 1,
                                                "rate_hz = 500\nmodel = \"ideal\"\ngyro.max_rad_per_s = 10\n"
                                                "accelerometer.max_m_per_s2 = 100\n")));
      return {};
    } catch (const ConfigError& error) {
      return error.what();
    }
  }
};

const std::string bias = "[[fault]]\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue = 0.1\n";

TEST_F(FaultScheduleTest, Occurrences) {
  const Result result = run(bias + "at_s = 1\nfor_s = 0.1\nevery_s = 2\n");
  ASSERT_EQ(result.labels.size(), 5U);
  for (std::size_t i = 0; i < result.labels.size(); ++i) {
    EXPECT_EQ(result.labels[i].first.occurrence, i);
    EXPECT_EQ(result.labels[i].first.sample, 500 + 1000 * i);
    EXPECT_EQ(result.labels[i].last.sample, 549 + 1000 * i);
  }
  EXPECT_EQ(run(bias + "at_s = 1\nfor_s = 0.1\nevery_s = 2\ntimes = 3\n").labels.size(), 3U);
  const Result samples = run(bias + "at_sample = 17\nfor_samples = 3\n");
  ASSERT_EQ(samples.labels.size(), 1U);
  EXPECT_EQ(samples.labels[0].first.sample, 17U);
  EXPECT_EQ(samples.labels[0].last.sample, 19U);
  const Result endless = run(bias + "at_s = 9.5\n");
  ASSERT_EQ(endless.labels.size(), 1U);
  EXPECT_EQ(endless.labels[0].last.sample, 5000U);
}

// The first and the last sample of each occurrence at 100 Hz, by [begin, end) in decimal numbers: sample k is at
// k/100 s.
TEST_F(FaultScheduleTest, TimesOnSamplesAreExact) {
  struct Case {
    std::string times;
    double begin_s, every_s, for_s;
    std::size_t count;
  };
  for (const Case& one : {Case{"at_s = 0\nevery_s = 0.1\nfor_s = 0.05\ntimes = 90\n", 0, 0.1, 0.05, 90},
                          Case{"at_s = 0\nevery_s = 1.1\nfor_s = 0.07\ntimes = 15\n", 0, 1.1, 0.07, 15},
                          Case{"at_s = 0.29\nevery_s = 0.7\nfor_s = 0.58\ntimes = 20\n", 0.29, 0.7, 0.58, 20},
                          Case{"at_s = 4.44\nfor_s = 5.73\n", 4.44, 0, 5.73, 1}}) {
    SCOPED_TRACE(one.times);
    const Config config = load_config(write(
        "times.toml", config_text(bias + one.times, "native", 1,
                                  "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n")));
    FaultLog log;
    const std::vector<Normals> normals = fault_normals("imu1", 1, config.faults.size());
    FaultSchedule schedule(config.faults, normals, "imu1", 0, 100, log);
    for (int k = 0; k < 2000; ++k) schedule.take(Sample{}, std::chrono::milliseconds(10 * k));
    const std::vector<FaultLabel> labels = fault_labels(config.faults, std::vector<std::string>{"imu1"}, log);
    ASSERT_EQ(labels.size(), one.count);
    for (std::size_t i = 0; i < labels.size(); ++i) {
      const auto sample_at = [](double s) { return static_cast<std::uint64_t>(std::llround(100 * s)); };
      const std::uint64_t first = sample_at(one.begin_s) + i * sample_at(one.every_s);
      EXPECT_EQ(labels[i].first.sample, first) << i;
      EXPECT_EQ(labels[i].last.sample, first + sample_at(one.for_s) - 1) << i;
    }
  }
}

// A drift of 1 rad/s^2 has grown for 1 s, when the rate rises from 100 Hz to 400 Hz, and falls to 50 Hz 0.5 s later.
TEST_F(FaultScheduleTest, TheTimeOfAFaultGoesOnWhenTheRateChanges) {
  const Config config = load_config(write(
      "rates.toml", config_text("[[fault]]\ntarget = \"gyro.x\"\nkind = \"drift\"\nvalue = 1\nat_s = 0.5\n", "native",
                                1, "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n")));
  FaultLog log;
  const std::vector<Normals> normals = fault_normals("imu1", 1, config.faults.size());
  FaultSchedule schedule(config.faults, normals, "imu1", 0, 100, log);
  std::int64_t time_us = 0;
  int acted = 0;
  const auto take_until = [&](std::int64_t end_us, std::int64_t period_us) {
    for (; time_us < end_us; time_us += period_us) {
      schedule.take(Sample{}, std::chrono::microseconds(time_us));
      for (const ActiveFault& fault : schedule.active(FaultSeam::sensor)) {
        EXPECT_NEAR(fault.since_s, 1e-6 * static_cast<double>(time_us - 500'000), 1e-9) << time_us;
        ++acted;
      }
    }
    time_us -= period_us;  // of the last sample
  };
  take_until(1'500'001, 10'000);
  schedule.set_rate(400);
  time_us += 2'500;
  take_until(2'000'001, 2'500);
  schedule.set_rate(50);
  time_us += 20'000;
  take_until(3'000'001, 20'000);
  EXPECT_EQ(acted, 101 + 200 + 50);
}

// A run that ended by itself is incomplete without it, unless the fault need not begin.
TEST_F(FaultScheduleTest, AFaultThatNeverBeginsIsNamed) {
  const std::string never = "at_s = 5000\n";
  for (const auto& [keys, is_missing] : {std::pair{never, true},
                                         {never + "optional = true\n", false},
                                         {never + "probability = 0.5\n", false},
                                         {std::string("when = \"rate > 1000\"\n"), true},
                                         {std::string("at_s = 1\nevery_s = 2\n"), false}}) {
    SCOPED_TRACE(keys);
    const std::string text = bias + "name = \"off\"\nfor_s = 1\n" + keys;
    const bool has_begun = contains(keys, "every_s");
    std::vector<FaultLabel> labels = run(text).labels;
    ASSERT_EQ(labels.size(), has_begun ? 5U : 0U);
    const Config config = load_config(write("never.toml", config_text(text, "native", 1,
                                                                      "rate_hz = 500\nmodel = \"ideal\"\n"
                                                                      "gyro.max_rad_per_s = 10\n"
                                                                      "accelerometer.max_m_per_s2 = 100\n")));
    // Labels point at the configuration of their run.
    for (FaultLabel& label : labels) label.fault = config.faults.data();
    const std::vector<FaultOutcome> outcomes = fault_outcomes(config.faults, labels);
    ASSERT_EQ(outcomes.size(), 1U);
    EXPECT_EQ(outcomes[0].occurrences, labels.size());
    for (const EndedBy ended_by : {EndedBy::end_of_capture, EndedBy::duration, EndedBy::signal, EndedBy::control}) {
      Outcome outcome;
      outcome.ended_by = ended_by;
      outcome.judge_faults(outcomes);
      const bool is_whole = ended_by == EndedBy::end_of_capture || ended_by == EndedBy::duration;
      EXPECT_EQ(outcome.exit_code(), is_missing && is_whole ? 3 : 0);
      if (!outcome.is_complete()) {
        EXPECT_EQ(outcome.shortfalls[0], "fault off has never begun");
      }
    }
    add_never_begun(config.faults, labels);
    ASSERT_EQ(labels.size(), has_begun ? 5U : 1U);
    const std::vector<std::string> rows = lines_of(labels_csv(labels));
    EXPECT_EQ(rows[1] == "off,imu1,gyro.x,bias,,,,,,,,,,,,never,,,", !has_begun) << rows[1];
    EXPECT_EQ(contains(labels_json(labels), "\"state\": \"never\""), !has_begun);
  }
}

TEST_F(FaultScheduleTest, NamesTellFaultsApart) {
  const std::string one = bias + "name = \"a\"\n", first = bias + "name = \"fault2\"\n";
  EXPECT_EQ(faults_of(one + bias), "");
  EXPECT_TRUE(contains(faults_of(one + one), "there is a fault \"a\" already"));
  EXPECT_TRUE(contains(faults_of(first + bias), "there is a fault \"fault2\" already")) << "as its default";
}

// Each of 50 occurrences with probability 0.3: 15 +- 5 sqrt(10.5), false alarm 6e-7 or less.
TEST_F(FaultScheduleTest, ProbabilityOfAnOccurrence) {
  const Result result = run(bias + "for_s = 0.05\nevery_s = 0.2\ntimes = 50\nprobability = 0.3\n");
  EXPECT_NEAR(static_cast<double>(result.labels.size()), 15, 16);
  EXPECT_GT(result.labels.size(), 0U);
  EXPECT_LT(result.labels.size(), 50U);
}

TEST_F(FaultScheduleTest, NumbersAreDrawnByTheSeed) {
  const std::string drawn =
      "[[fault]]\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue = {uniform = [0.1, 0.2]}\nat_s = {uniform = [1, 2]}\n"
      "for_s = {normal = [1, 0.1]}\nevery_s = 3\ntimes = 3\n";
  const Result one = run(drawn), two = run(drawn), many = run(drawn, "native", 3);
  EXPECT_EQ(one.all_bytes, two.all_bytes);
  ASSERT_EQ(one.labels.size(), 3U);
  for (const FaultLabel& label : one.labels) {
    EXPECT_GT(label.first.parameters[0], 0.1);
    EXPECT_LT(label.first.parameters[0], 0.2);
    EXPECT_NEAR(static_cast<double>(label.last.sample - label.first.sample), 500, 350);
  }
  EXPECT_NE(one.labels[0].first.parameters[0], one.labels[1].first.parameters[0]);
  EXPECT_EQ(one.labels[1].first.sample - one.labels[0].first.sample, 1500U);
  ASSERT_EQ(many.labels.size(), 9U);
  EXPECT_TRUE(many.all_bytes.starts_with(one.all_bytes)) << "the first imu has the same faults among others";
}

// A drawn number is rounded, and its label has the rounded number: each of 20 draws is 1 or 2.
TEST_F(FaultScheduleTest, WholeNumbers) {
  const std::string repeated = "[[fault]]\ntarget = \"message\"\nkind = \"repeated\"\n";
  EXPECT_EQ(faults_of(repeated + "value = 2\n"), "");
  EXPECT_EQ(faults_of(repeated + "value = 2.0\n"), "");
  for (const std::string& fault :
       {repeated + "value = 1.5\n", std::string("[[fault]]\ntarget = \"gnss\"\nkind = \"satellites\"\nvalue = 4.5\n"),
        std::string("[[fault]]\ntarget = \"message\"\nkind = \"counter_jump\"\nvalue = -1.5\n"),
        std::string("[[fault]]\ntarget = \"truth\"\nkind = \"late\"\nvalue = 1.5\n")})
    EXPECT_TRUE(contains(faults_of(fault), "fault.0.value: give a whole number")) << fault << faults_of(fault);
  const Result clean = run("");
  const Result drawn = run(repeated + "value = {uniform = [1, 2]}\nfor_samples = 1\nevery_s = 0.1\ntimes = 20\n");
  ASSERT_EQ(drawn.labels.size(), 20U);
  double copies = 0;
  for (const FaultLabel& label : drawn.labels) {
    EXPECT_TRUE(label.first.parameters[0] == 1 || label.first.parameters[0] == 2) << label.first.parameters[0];
    copies += label.first.parameters[0];
  }
  EXPECT_GT(copies, 20) << "all are 1: false alarm 1e-6";
  EXPECT_EQ(static_cast<double>(drawn.frames.size()), static_cast<double>(clean.frames.size()) + copies);
}

TEST_F(FaultScheduleTest, ACondition) {
  const Result clean = run("");
  const auto force = [&](std::size_t k) { return clean.measurements[k].sample.specific_force.norm(); };
  // The first samples above the limit, but not within 5 samples of which the last one before was.
  const auto rises_above = [&](double limit) {
    std::vector<std::size_t> rises;
    bool was_above = false;
    for (std::size_t k = 0; k < clean.measurements.size(); ++k) {
      const bool is_above = force(k) > limit;
      if (is_above && !was_above) {
        rises.push_back(k);
        k += 4;
      }
      was_above = is_above;
    }
    return rises;
  };
  double limit = 0;
  for (std::size_t k = 0; k < clean.measurements.size(); k += 50)
    if (rises_above(force(k)).size() > rises_above(limit).size()) limit = force(k);
  const std::vector<std::size_t> rises = rises_above(limit);
  ASSERT_GE(rises.size(), 2U);
  const Result result =
      run(bias + fmt::format("when = \"specific_force > {}\"\nfor_samples = 5\ntimes = 0\n", limit));
  ASSERT_EQ(result.labels.size(), rises.size());
  for (std::size_t i = 0; i < rises.size(); ++i) EXPECT_EQ(result.labels[i].first.sample, rises[i]);
}

TEST_F(FaultScheduleTest, FaultsActInTheirOrder) {
  const Result clean = run("");
  const std::string scale = "[[fault]]\ntarget = \"gyro.x\"\nkind = \"scale\"\nvalue = 2\n";
  const Result added = run(bias + scale), scaled = run(scale + bias);
  const double value = clean.measurements[100].sample.rate.x();
  EXPECT_DOUBLE_EQ(added.measurements[100].sample.rate.x(), 2 * (value + 0.1));
  EXPECT_DOUBLE_EQ(scaled.measurements[100].sample.rate.x(), 2 * value + 0.1);
}

TEST_F(FaultScheduleTest, WhatIsWrongIsExplained) {
  for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
           {"[[fault]]\n", "fault.0.target: missing"},
           {"[[fault]]\ntarget = \"giro\"\nkind = \"bias\"\n", "there is no \"giro\"; known: gyro, "},
           {"[[fault]]\ntarget = \"gyro\"\nkind = \"bais\"\n", "did you mean \"bias\"?"},
           {"[[fault]]\ntarget = \"gyro.w\"\nkind = \"bias\"\nvalue = 1\n", "give the axes of gyro"},
           {"[[fault]]\ntarget = \"message.x\"\nkind = \"missing\"\n", "has no axes; give \"message\""},
           {"[[fault]]\ntarget = \"gyro\"\nkind = \"bias\"\n", "fault.0.value: missing: what is added"},
           {bias + "value_deg_per_s = 1\n", "\"value\" is given twice"},
           {bias + "imu = \"imu9\"\n", "there is no imu \"imu9\"; give \"*\" or of: imu1"},
           {bias + "value_mg = 1\n", "fault.0.value_mg: unknown key"},
           {bias + "at_s = -1\n", "fault.0.at_s"},
           {bias + "at_s = {uniform = [3, 1]}\n", "give a range within 0 to "},
           {bias + "at_s = {triangle = [3, 1]}\n", "{uniform = [from, to]}"},
           {bias + "at_s = 1\nat_sample = 1\n", "give either at_s or at_sample"},
           {bias + "at_s = 2\nuntil_s = 1\n", "give a time after at_s"},
           {bias + "for_s = 1\nuntil_s = 1\n", "give one of for_s, until_s and for_samples"},
           {bias + "when = \"rate < 1\"\n", "give \"rate > X\""},
           {bias + "every_s = 1\n", "needs a duration"},
           {bias + "every_s = 1\nfor_s = 2\n", "give at least the duration"},
           {bias + "for_s = 1e-9\nevery_s = 1e-9\ntimes = 0\n",
            "fault.0.every_s: give at least 0.0001, the sample period of the fastest unit"},
           {bias + "times = 2\n", "needs every_s"},
           {bias + "imu = []\n", "fault.0.imu: is an empty list; give \"*\" or of: imu1"},
           {bias + "imu = [\"imu1\", \"imu1\"]\n", "fault.0.imu: \"imu1\" is given twice; give it once"},
           {bias + "name = \"\"\n", "fault.0.name: give a name that is not empty"},
           {bias + "name = \"a\\nb\"\n", "fault.0.name: has a line feed or another control character"},
           {bias + fmt::format("name = \"{}\"\n", std::string(65, 'a')),
            "fault.0.name: has 65 characters; give at most 64"},
           {"[[fault]]\ntarget = \"gyro.xx\"\nkind = \"dead\"\n", "give the axes of gyro as in"},
           {"[[fault]]\ntarget = \"gyro.x\"\nkind = \"swapped\"\n",
            "fault.0.target: \"swapped\" needs 2 axes or more; give \"gyro.xy\" or \"gyro\""},
           {bias + "ramp_out_s = 1\n", "needs for_s or until_s"},
           {"[[fault]]\ntarget = \"gyro\"\nkind = \"dead\"\nramp_in_s = 1\n", "\"dead\" has no ramp"},
           {"[[fault]]\ntarget = \"truth\"\nkind = \"nan\"\nimu = \"imu1\"\n", "truth is that of all imus; omit it"},
           {"[fault]\ntarget = \"gyro\"\n", "give tables, each as [[fault]]"},
       })
    EXPECT_TRUE(contains(faults_of(text), expected)) << text << "\n" << faults_of(text);
}

// A name of 64 characters of more bytes, and the shortest period, are accepted.
TEST_F(FaultScheduleTest, TheLimitsAreValid) {
  std::string name;
  for (int i = 0; i < 64; ++i) name += "\u00e4";
  EXPECT_EQ(faults_of(bias + "for_s = 1e-4\nevery_s = 1e-4\nname = \"" + name + "\"\n"), "");
}

TEST_F(FaultScheduleTest, AScenarioIsAFileOfFaults) {
  const std::string config =
      write("run.toml", config_text("", "native", 1,
                                    "rate_hz = 500\nmodel = \"ideal\"\n"
                                    "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n"));
  const std::string good = write("good.toml", bias), bad = write("bad.toml", bias + "speed = 1\n[truth]\n");
  const std::string scenarios[] = {good, good};
  const Config read = load_config(config, {}, {}, scenarios);
  ASSERT_EQ(read.faults.size(), 2U);
  EXPECT_EQ(read.faults[1].name, "fault2");
  EXPECT_NE(read.sha256, load_config(config).sha256);
  try {
    load_config(config, {}, {}, std::span(&bad, 1));
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_TRUE(contains(error.what(), "bad.toml:5: fault.0.speed: unknown key")) << error.what();
    EXPECT_TRUE(contains(error.what(), "truth: unknown key")) << error.what();
  }
}

TEST(FaultReadme, HasEveryKind) {
  std::ifstream file(IMUD_SOURCE_DIR "/emulator/faults/README.md");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  ASSERT_GT(fault_kinds().size(), 25U);
  for (const FaultKind* kind : fault_kinds()) {
    EXPECT_TRUE(contains(text, fmt::format("| `{}` | {}", kind->name, kind->summary))) << kind->name;
    for (const FaultParameter& parameter : kind->parameters)
      EXPECT_TRUE(contains(text, fmt::format("`{}`", parameter.key))) << parameter.key;
  }
}

// 20 occurrences on an imu: the log has room for the begins and ends of two, and keeps the room of the second's end.
TEST_F(FaultScheduleTest, OccurrencesBeyondTheLogAreCounted) {
  const Config config = load_config(
      write("many.toml",
            config_text(bias + "name = \"many\"\nat_s = 0.1\nevery_s = 0.5\nfor_s = 0.25\ntimes = 20\n" + bias +
                            "name = \"late\"\nat_s = 5\n" + bias + "name = \"never\"\nat_s = 90\n",
                        "native", 1, "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n")));
  for (const bool has_room : {true, false}) {
    SCOPED_TRACE(has_room);
    FaultLog log(has_room ? FaultLog::default_size : 5, config.faults.size(), 1);
    const std::vector<Normals> normals = fault_normals("imu1", 1, config.faults.size());
    FaultSchedule schedule(config.faults, normals, "imu1", 0, 100, log);
    for (int k = 0; k < 2000; ++k) schedule.take(Sample{}, std::chrono::milliseconds(10 * k));
    schedule.finish();
    EXPECT_EQ(log.lost(), has_room ? 0U : 19U);
    std::vector<FaultLabel> labels = fault_labels(config.faults, std::vector<std::string>{"imu1"}, log);
    ASSERT_EQ(labels.size(), has_room ? 21U : 4U);
    EXPECT_TRUE(std::ranges::all_of(labels, &FaultLabel::has_ended));
    EXPECT_EQ(lost_text(labels),
              has_room ? "" : "19 occurrences of faults without a label: the log of faults is full");
    const std::vector<FaultOutcome> outcomes = fault_outcomes(config.faults, labels);
    ASSERT_EQ(outcomes.size(), 3U);
    EXPECT_EQ(outcomes[0].occurrences, 20U);
    EXPECT_EQ(outcomes[0].lost, has_room ? 0U : 18U);
    EXPECT_EQ(outcomes[1].occurrences, 1U);
    EXPECT_EQ(outcomes[1].shortfall(), "");
    EXPECT_EQ(outcomes[2].shortfall(), "fault never has never begun");
    add_never_begun(config.faults, labels);
    if (has_room) continue;
    const std::vector<std::string> rows = lines_of(labels_csv(labels));
    ASSERT_EQ(rows.size(), 6U);
    EXPECT_EQ(rows[2].substr(0, rows[2].find(",6")), "many,imu1,gyro.x,bias,1") << rows[2];
    EXPECT_EQ(rows[3], "many,imu1,gyro.x,bias,18,,,,,,,,,,,lost,,,");
    EXPECT_EQ(rows[4], "late,imu1,gyro.x,bias,1,,,,,,,,,,,lost,,,");
    EXPECT_EQ(rows[5], "never,imu1,gyro.x,bias,,,,,,,,,,,,never,,,");
  }
}

// A client may begin faults of the same name, or this one again.
TEST(FaultLabels, AFaultThatAClientBeginsAgainHasBegun) {
  FaultConfig configured, of_client;
  configured.name = of_client.name = "f";
  configured.imus = {"a", "b"};
  std::vector<FaultLabel> labels = {{&of_client, "a", {}, {}}};
  const std::vector<FaultOutcome> outcomes = fault_outcomes(std::span(&configured, 1), labels);
  ASSERT_EQ(outcomes.size(), 1U);
  EXPECT_EQ(outcomes[0].occurrences, 1U);
  EXPECT_EQ(outcomes[0].shortfall(), "");
  add_never_begun(std::span(&configured, 1), labels);
  ASSERT_EQ(labels.size(), 2U);
  EXPECT_EQ(labels[1].fault, &configured);
  EXPECT_EQ(labels[1].imu, "b");
  EXPECT_EQ(labels[1].state, FaultLabel::State::never);
}

}  // namespace
}  // namespace imud
