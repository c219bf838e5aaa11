// Summary: the same figures as text, as a line of the log, as JSON, and by name.
#include "emulator/report/summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>

#include "tests/support/text.hpp"

namespace imud {
namespace {

class SummaryTest : public testing::Test {
 protected:
  Summary summarize(double duration_s) const {
    return imud::summarize({&truth_, &quality_, {{"imu1", &imus_[0]}, {"left.wing", &imus_[1]}}}, duration_s,
                           {12.5, 0});
  }
  static nlohmann::json parsed(const Summary& summary) {
    return nlohmann::json::parse(json(summary, JsonLayout::indented));
  }
  // 101 truths in 2 s by their arrivals.
  void accept_truths() {
    truth_.received.count(103);
    truth_.accepted.count(101);
    truth_.first_ns = 1'000'000'000;
    truth_.newest_ns = 3'000'000'000;
  }

  TruthCounters truth_;
  TruthQuality quality_;
  ImuCounters imus_[2];
};

// Two delays whose digits are the same are one.
TEST_F(SummaryTest, DelaysOfAFitAreOneNumberOrTwo) {
  accept_truths();
  FitFigures& fit = truth_.fit;
  fit.rate_shortest = 0.48;
  fit.rate_mean = 0.4800000001;
  fit.rate_longest = 0.4800000002;
  fit.force_shortest = 0.03;
  fit.force_mean = 0.25;
  fit.force_longest = 0.48;
  fit.known = true;
  const std::string out = text(summarize(2));
  EXPECT_TRUE(contains(out, "of noise, over 480 ms to either side")) << out;
  EXPECT_TRUE(contains(out, "of noise, over 30 to 480 (mean 250) ms to either side")) << out;
}

TEST_F(SummaryTest, AnUneventfulRunIsThreeLines) {
  accept_truths();
  truth_.no_state.count(2);
  truth_.runs.count();
  imus_[0].samples.count(2001);
  imus_[0].frames.count(1999);
  imus_[0].dropped.count(2);
  EXPECT_EQ(text(summarize(10)),
            "ran      10.000 s, simulated 0.000 s\n"
            "truth    103 received, 101 accepted, 2 without state, refused: none\n"
            "imu1     2001 samples, 1999 frames sent, 2 dropped, 0 missed; line 12.5 %\n"
            "left.wing 0 samples, 0 frames sent, 0 dropped, 0 missed\n");
}

TEST_F(SummaryTest, TheTextHasEveryCounterThatIsNotZero) {
  std::uint64_t number = 70;
  for (const CounterGroup* group :
       std::initializer_list<const CounterGroup*>{&truth_, &truth_.refused, &quality_, &imus_[1]})
    for (const Counter* counter : group->counters) {
      ++number;
      const std::string words = fmt::format(" {} {}", number, counter->info.words);
      EXPECT_FALSE(contains(text(summarize(1)), words));
      *const_cast<Counter*>(counter) = number;
      EXPECT_TRUE(contains(text(summarize(1)), words)) << text(summarize(1));
    }
  EXPECT_EQ(number, 70U + 12U + 17U + 8U + 31U);
  EXPECT_TRUE(contains(text(summarize(1)), " not sent"));
}

TEST_F(SummaryTest, FiguresOfAProductStandBesideThoseOfEveryImu) {
  const DeviceCounter declared[] = {{"node_id_conflicts", "frames with this node id", "change it"},
                                    {"transfers_aborted", "transfers aborted"}};
  ImuCounters node{declared};
  const auto now = [&] {
    return imud::summarize({&truth_, &quality_, {{"imu1", &imus_[0]}, {"node", &node}}}, 1, {0, 0});
  };
  node.device.store(std::array{std::uint64_t{0}, std::uint64_t{2}});
  const Summary before = now();
  node.device.store(std::array{std::uint64_t{3}, std::uint64_t{2}});
  EXPECT_TRUE(contains(text(now()),
                       "node     0 samples, 0 frames sent, 0 dropped, 0 missed, 3 frames with this node "
                       "id, 2 transfers aborted\n"))
      << text(now());
  EXPECT_FALSE(contains(text(before), "node id"));
  EXPECT_EQ(parsed(now())["imus"][1]["node_id_conflicts"], 3);
  EXPECT_EQ(parsed(before)["imus"][1]["node_id_conflicts"], 0);
  EXPECT_FALSE(parsed(now())["imus"][0].contains("node_id_conflicts"));
  EXPECT_EQ(find_count(now(), "node.transfers_aborted"), 2U);
  EXPECT_EQ(find_count(now(), "node_id_conflicts"), 3U);
  EXPECT_EQ(find_count(now(), "imu1.node_id_conflicts"), std::nullopt);
  EXPECT_EQ(find_count(now().since(before), "node.transfers_aborted"), 0U);
  EXPECT_EQ(count(fmt::format("{}", fmt::join(count_names(now()), " ")), "transfers_aborted"), 1U);
}

TEST_F(SummaryTest, TheTextHasTheClockAndTheWarning) {
  quality_.rate = 0.9;
  quality_.offset_s = -0.0121;
  quality_.delay_s = 0.03;
  quality_.jitter.add(0.5);
  truth_.accepted.count(3);
  truth_.lost.count(1);
  EXPECT_FALSE(contains(text(summarize(1)), "Hz"));
  quality_.known = true;
  Summary summary = summarize(1);
  const std::string jitter = fmt::format("jitter p99 {:.2f} ms", 1e3 * quality_.jitter.percentile(99));
  EXPECT_TRUE(contains(text(summary), "\n         0.0 Hz, lost 25.00 %, " + jitter +
                                          ", age p99 0.0 ms, rate 0.900000, offset -12.1 ms, delay 30.0 ms\n"))
      << text(summary);
  summary.truth.warning = "cut short after record 3";
  EXPECT_TRUE(contains(text(summary), "\n         warning: cut short after record 3\n"));
  EXPECT_EQ(parsed(summary)["truth"]["warning"], "cut short after record 3");
}

TEST_F(SummaryTest, TheRateIsThatOfTheSteps) {
  accept_truths();
  EXPECT_DOUBLE_EQ(summarize(10).truth.rate_hz, 50);
}

TEST_F(SummaryTest, OneTruthOrNoneHasNoRate) {
  EXPECT_EQ(summarize(10).truth.rate_hz, 0);
  truth_.accepted.count();
  truth_.first_ns = truth_.newest_ns = 5;
  EXPECT_EQ(summarize(10).truth.rate_hz, 0);
}

TEST_F(SummaryTest, TheJsonHasEveryFigure) {
  accept_truths();
  truth_.refused[static_cast<std::size_t>(Refusal::bad_checksum)].count(4);
  truth_.inserted.count(6);
  quality_.resumed.count(2);
  quality_.delay_s = 0.25;
  imus_[0].silent.count(9);
  const nlohmann::json before = parsed(summarize(10));
  EXPECT_EQ(before["duration_s"], 10.0);
  EXPECT_EQ(before["truth"]["refused"], nlohmann::json({{"crc", 4}})) << "only the causes that occurred";
  EXPECT_EQ(before["truth"]["inserted"], 6);
  EXPECT_EQ(before["truth"]["resumed"], 2);
  EXPECT_EQ(before["truth"]["rate_hz"], 50.0);
  EXPECT_TRUE(before["truth"]["received"].is_number_unsigned());
  EXPECT_FALSE(before["truth"].contains("delay_us")) << "no clock was estimated";
  ASSERT_EQ(before["imus"].size(), 2U);
  EXPECT_EQ(before["imus"][0]["name"], "imu1");
  EXPECT_EQ(before["imus"][0]["silent"], 9);
  EXPECT_EQ(before["imus"][0]["line_load_percent"], 12.5);
  EXPECT_FALSE(before["imus"][1].contains("line_load_percent"));

  quality_.known = true;
  const nlohmann::json all = parsed(summarize(10));
  EXPECT_EQ(all["truth"]["delay_us"], 250'000.0);
  for (const char* key : {"received", "accepted", "refused", "no_state", "runs", "resumed", "truncated", "inserted",
                          "lost", "rate_hz", "stops", "returns", "clock_rate", "offset_us", "jitter_us", "age_us"})
    EXPECT_TRUE(all["truth"].contains(key)) << key;
  for (const char* key : {"samples",
                          "frames",
                          "dropped",
                          "extrapolated",
                          "held",
                          "silent",
                          "missed",
                          "skipped",
                          "replies",
                          "at_rest",
                          "edges_refused",
                          "fixes_used",
                          "fixes_rejected",
                          "headings_used",
                          "headings_rejected",
                          "lateness_us",
                          "write_us",
                          "reply_us",
                          "heights_used",
                          "heights_rejected",
                          "antenna_headings_used",
                          "antenna_headings_rejected",
                          "rests_used",
                          "rests_rejected",
                          "bus_errors",
                          "error_warnings",
                          "error_passives",
                          "bus_offs",
                          "bus_restarts",
                          "refused"})
    EXPECT_TRUE(all["imus"][1].contains(key)) << key;
}

TEST_F(SummaryTest, APercentileIsThatOfItsName) {
  for (int i = 0; i < 9850; ++i) imus_[0].lateness.add(10e-6);
  for (int i = 0; i < 100; ++i) imus_[0].lateness.add(1e-3);
  for (int i = 0; i < 49; ++i) imus_[0].lateness.add(20e-3);
  imus_[0].lateness.add(0.3);
  const nlohmann::json late = parsed(summarize(1))["imus"][0]["lateness_us"];
  EXPECT_NEAR(late["p50"].get<double>(), 10, 0.2);
  EXPECT_NEAR(late["p99"].get<double>(), 1e3, 20);
  EXPECT_NEAR(late["p999"].get<double>(), 20e3, 400);
  EXPECT_EQ(late["max"], 300e3);
  EXPECT_TRUE(contains(text(summarize(1)), "; late by p50 ")) << text(summarize(1));
  EXPECT_TRUE(contains(text(summarize(1)), ", max 300000.0 us; line 12.5 %")) << text(summarize(1));
}

TEST_F(SummaryTest, TheJsonOfALineHasNoEnd) {
  const std::string line = json(summarize(1), JsonLayout::line);
  EXPECT_EQ(line.find('\n'), line.npos);
  EXPECT_EQ(nlohmann::json::parse(line), parsed(summarize(1)));
}

TEST_F(SummaryTest, AnIntervalHasItsOwnFigures) {
  accept_truths();
  truth_.inserted.count(5);
  truth_.refused[0].count(5);
  quality_.stops.count(5);
  imus_[1].held.count(5);
  imus_[1].lateness.add(1);
  const Summary before = summarize(10);
  truth_.accepted.count(30);
  truth_.inserted.count(3);
  truth_.refused[0].count(2);
  quality_.stops.count(1);
  imus_[1].held.count(4);
  const Summary interval = summarize(13).since(before);
  EXPECT_DOUBLE_EQ(interval.duration_s, 3);
  EXPECT_DOUBLE_EQ(interval.truth.rate_hz, 10);
  EXPECT_EQ(interval.truth.counters[&TruthCounters::accepted], 30U);
  EXPECT_EQ(interval.truth.counters[&TruthCounters::inserted], 3U);
  EXPECT_EQ(interval.truth.refused.counts[0], 2U);
  EXPECT_EQ(interval.truth.quality[&TruthQuality::stops], 1U);
  EXPECT_EQ(interval.imus[1].counters[&ImuCounters::held], 4U);
  EXPECT_EQ(interval.imus[1].counters[&ImuCounters::lateness].count(), 0U);
  EXPECT_EQ(interval.imus[1].name, "left.wing");
  EXPECT_EQ(summarize(13).since(summarize(13)).truth.rate_hz, 0);
}

TEST_F(SummaryTest, TheLogHasOneLine) {
  imus_[0].samples.count(1500);
  imus_[1].samples.count(500);
  imus_[1].extrapolated.count(100);
  imus_[0].dropped.count(1);
  imus_[1].dropped.count(2);
  EXPECT_EQ(line(summarize(2)),
            "truth 0.0 Hz, lost 0.00 %; 2 imus 1000.0 Hz, 3 dropped, 0 missed, extrapolated 5.0 %, line 12.5 %");

  truth_.refused[static_cast<std::size_t>(Refusal::bad_checksum)].count(7);
  imus_[0].lateness.add(0.001);
  imus_[1].lateness.add(0.1);
  imus_[1].silent.count(3);
  const std::string eventful = line(summarize(2));
  EXPECT_TRUE(contains(eventful, ", refused: 7 crc; 2 imus")) << eventful;
  EXPECT_TRUE(contains(eventful, ", max 100000.0 us, ")) << eventful;
  EXPECT_TRUE(contains(eventful, ", 3 not sent")) << eventful;

  const Summary one = imud::summarize({&truth_, &quality_, {{"imu1", &imus_[0]}}}, 2, {0});
  EXPECT_TRUE(contains(line(one), "; imu1 750.0 Hz, late p50 ")) << line(one);
  EXPECT_FALSE(contains(line(one), ", line ")) << line(one);
}

TEST_F(SummaryTest, ACountIsFoundByItsName) {
  truth_.lost.count(1);
  truth_.refused[static_cast<std::size_t>(Refusal::bad_checksum)].count(2);
  truth_.refused[static_cast<std::size_t>(Refusal::duplicate)].count(3);
  quality_.returns.count(4);
  imus_[0].samples.count(5);
  imus_[1].samples.count(6);
  const Summary summary = summarize(1);
  EXPECT_EQ(find_count(summary, "truth.lost"), 1U);
  EXPECT_EQ(find_count(summary, "truth.refused.crc"), 2U);
  EXPECT_EQ(find_count(summary, "truth.refused.range"), 0U);
  EXPECT_EQ(find_count(summary, "truth.refused"), 5U);
  EXPECT_EQ(find_count(summary, "truth.returns"), 4U);
  EXPECT_EQ(find_count(summary, "imu1.samples"), 5U);
  EXPECT_EQ(find_count(summary, "left.wing.samples"), 6U);
  EXPECT_EQ(find_count(summary, "samples"), 11U);
  for (const char* unknown :
       {"", "truth", "truth.", "truth.samples", "truth.refused.", "truth.refused.lost", "imu2.samples", "imu1.",
        "imu1.lost", "imu1", ".samples", "wing.samples", "lost", "imu1.lateness_us"})
    EXPECT_EQ(find_count(summary, unknown), std::nullopt) << unknown;
}

}  // namespace
}  // namespace imud
