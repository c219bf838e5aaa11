// Counters: each is declared once; snapshots, intervals, and the table of refusals.
#include "emulator/ground/counters.hpp"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <string>
#include <vector>

namespace imud {
namespace {

std::vector<std::string> keys_of(const CounterGroup& group) {
  std::vector<std::string> keys;
  for (const Counter* counter : group.counters) keys.emplace_back(counter->info.key);
  for (const Level* level : group.levels) keys.emplace_back(level->key);
  for (const Durations* durations : group.durations) keys.emplace_back(durations->key);
  return keys;
}

TEST(Counters, HaveKeysOfTheirOwnAndWords) {
  const ImuCounters imu;
  const TruthCounters truth;
  const TruthQuality quality;
  const ControlCounters control;
  // In the JSON the last two are one object, beside `refused`, `rate_hz` and others.
  std::vector<std::string> truth_keys = keys_of(truth), quality_keys = keys_of(quality);
  truth_keys.insert(truth_keys.end(), quality_keys.begin(), quality_keys.end());
  truth_keys.insert(truth_keys.end(), {"refused", "rate_hz", "longest_gap_s", "progress", "warning", "remarks"});
  std::vector<std::string> imu_keys = keys_of(imu);
  imu_keys.insert(imu_keys.end(), {"name", "line_load_percent"});
  EXPECT_EQ(truth_keys.size(), 12U + 13U + 6U);
  EXPECT_EQ(imu_keys.size(), 34U + 2U);
  for (const auto& keys : {truth_keys, imu_keys, keys_of(truth.refused), keys_of(control)}) {
    EXPECT_EQ(std::set<std::string>(keys.begin(), keys.end()).size(), keys.size());
    for (const std::string& key : keys)
      EXPECT_EQ(key.find_first_not_of("abcdefghijklmnopqrstuvwxyz_"), key.npos) << "a limit names it: " << key;
  }
  std::size_t words = 0;
  for (const CounterGroup* group :
       std::initializer_list<const CounterGroup*>{&imu, &truth, &quality, &truth.refused, &control})
    for (const Counter* counter : group->counters) words += !counter->info.words.empty();
  EXPECT_EQ(words, 31U + 12U + 8U + 17U + 6U);
}

TEST(Counters, BeginAtZero) {
  const Snapshot<ImuCounters> imu;
  ASSERT_EQ(imu.counts.size(), 31U);
  EXPECT_EQ(imu.total(), 0U);
  EXPECT_EQ(Snapshot<TruthQuality>()[&TruthQuality::rate], 1.0);
  EXPECT_EQ(Snapshot<TruthQuality>()[&TruthQuality::offset_s], 0.0);
  EXPECT_EQ(Snapshot<TruthQuality>()[&TruthQuality::delay_s], 0.0);
}

TEST(Counters, ASnapshotKeepsWhatStoodThere) {
  ImuCounters counters;
  counters.samples.count(5);
  counters.samples.fetch_add(1, std::memory_order_relaxed);
  counters.edges_refused.count();
  counters.lateness.add(0.5);
  const Snapshot<ImuCounters> snapshot(counters);
  counters.samples.count();
  counters.lateness.add(2);
  EXPECT_EQ(snapshot[&ImuCounters::samples], 6U);
  EXPECT_EQ(snapshot[&ImuCounters::edges_refused], 1U);
  EXPECT_EQ(snapshot[&ImuCounters::lateness].max(), 0.5);
  EXPECT_EQ(snapshot[&ImuCounters::write].count(), 0U);
  EXPECT_EQ(snapshot.total(), 7U);
}

// In an interval, counts are differences, levels are the present ones, and durations are those that were added.
TEST(Counters, AnIntervalHasWhatCameToIt) {
  TruthQuality quality;
  quality.stops.count(3);
  quality.returns.count(2);
  quality.rate = 0.5;
  for (int i = 0; i < 100; ++i) quality.age.add(1);
  const Snapshot<TruthQuality> before(quality);
  quality.stops.count(4);
  quality.rate = 0.75;
  for (int i = 0; i < 10; ++i) quality.age.add(0.01);
  Snapshot<TruthQuality> interval(quality);
  interval.subtract(before);
  EXPECT_EQ(interval[&TruthQuality::stops], 4U);
  EXPECT_EQ(interval[&TruthQuality::returns], 0U);
  EXPECT_EQ(interval[&TruthQuality::rate], 0.75);
  EXPECT_EQ(interval[&TruthQuality::age].count(), 10U);
  EXPECT_NEAR(interval[&TruthQuality::age].percentile(99), 0.01, 0.001);
}

// When a reordered truth arrives, the loss counted for it is subtracted again.
TEST(Counters, ACountThatFellIsZeroInTheInterval) {
  TruthCounters truth;
  truth.lost.count(5);
  const Snapshot<TruthCounters> before(truth);
  truth.lost.fetch_sub(2, std::memory_order_relaxed);
  truth.inserted.count(2);
  Snapshot<TruthCounters> interval(truth);
  interval.subtract(before);
  EXPECT_EQ(interval[&TruthCounters::lost], 0U);
  EXPECT_EQ(interval[&TruthCounters::inserted], 2U);
}

TEST(Counters, AreShownAsDeclared) {
  const auto shown = [](Show show) { return std::array{is_shown(show, 0), is_shown(show, 1), is_shown(show, 2)}; };
  EXPECT_EQ(shown(Show::never), (std::array{false, false, false}));
  EXPECT_EQ(shown(Show::if_several), (std::array{false, false, true}));
  EXPECT_EQ(shown(Show::if_not_zero), (std::array{false, true, true}));
  EXPECT_EQ(shown(Show::always), (std::array{true, true, true}));
}

TEST(Refusals, EachHasACauseARemedyAndACounter) {
  TruthCounters truth;
  const auto count = static_cast<std::size_t>(Refusal::count);
  ASSERT_EQ(truth.refused.counters.size(), count);
  std::set<std::string_view> causes;
  for (std::size_t i = 0; i < count; ++i) {
    const auto refusal = static_cast<Refusal>(i);
    causes.insert(cause(refusal));
    EXPECT_FALSE(cause(refusal).empty()) << i;
    EXPECT_FALSE(remedy(refusal).empty()) << cause(refusal);
    EXPECT_EQ(truth.refused[i].info.key, cause(refusal));
    EXPECT_EQ(truth.refused.counters[i], &truth.refused[i]);
  }
  EXPECT_EQ(causes.size(), count);
}

TEST(Refusals, EachFailureOfADecoderIsOne) {
  std::size_t failures = 0;
  for (int i = 0; !cause(static_cast<TruthResult>(i)).starts_with("unknown"); ++i) {
    const auto result = static_cast<TruthResult>(i);
    if (result == TruthResult::ok || result == TruthResult::no_state || result == TruthResult::withheld) continue;
    ++failures;
    EXPECT_EQ(cause(refusal(result)), cause(result));
  }
  EXPECT_EQ(failures, 9U);
  EXPECT_EQ(cause(Refusal::bad_checksum), "crc");
  EXPECT_EQ(cause(Refusal::other_stream), "stream");
}

}  // namespace
}  // namespace imud
