// Metrics: every declared figure is there once. tests/web/metrics_test.py has an independent parser read it.
#include "emulator/web/metrics.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"

namespace imud {
namespace {

class MetricsTest : public testing::Test {
 protected:
  std::string metrics(MetricsFormat format = MetricsFormat::open_metrics) const {
    return imud::metrics(
        summarize({&truth_, &quality_, {{"imu1", &imu_}, {"left \"wing\"", &product_}}, &record_, nullptr, &control_},
                  2.5, {12.5, 0}),
        format);
  }
  TruthCounters truth_;
  TruthQuality quality_;
  static constexpr DeviceCounter declared[] = {{"requests_refused", "requests refused"}};
  ImuCounters imu_;
  ImuCounters product_{declared};
  RecordCounters record_;
  ControlCounters control_;
};

TEST_F(MetricsTest, HasEveryDeclaredFigure) {
  quality_.known = true;
  const std::string text = metrics();
  const auto expect_once = [&](const std::string& line) {
    EXPECT_EQ(count(text, "\n" + line), 1U) << line << "\n" << text;
  };
  const auto expect_group = [&](const std::string& prefix, const CounterGroup& group, const std::string& labels) {
    for (const Counter* counter : group.counters)
      expect_once(
          fmt::format("{}{}{}{} 0\n", prefix, counter->info.key, counter->info.may_fall ? "" : "_total", labels));
    for (const Level* level : group.levels) {
      std::string key(level->key);
      if (key.ends_with("_us")) key.replace(key.size() - 2, 2, "seconds");
      expect_once(fmt::format("{}{}{} ", prefix, key, labels));
    }
    for (const Durations* durations : group.durations) {
      std::string key(durations->key);
      key.replace(key.size() - 2, 2, "seconds");
      expect_once(fmt::format("{}{}_count{} 0\n", prefix, key, labels));
    }
  };
  expect_group("imud_truth_", truth_, "");
  expect_group("imud_truth_", quality_, "");
  expect_group("imud_record_", record_, "");
  expect_group("imud_control_", control_, "");
  expect_group("imud_imu_", imu_, "{imu=\"imu1\"}");
  expect_group("imud_imu_", product_, R"({imu="left \"wing\""})");
  for (const Counter* cause : truth_.refused.counters)
    expect_once(fmt::format("imud_truth_refused_total{{cause=\"{}\"}} 0\n", cause->info.key));
  expect_once(R"(imud_imu_requests_refused_total{imu="left \"wing\""} 0)");
  expect_once("imud_imu_line_load_ratio{imu=\"imu1\"} 0.125\n");
  EXPECT_TRUE(text.ends_with("\n# EOF\n"));
  EXPECT_TRUE(contains(text, "# TYPE imud_truth_lost gauge\n"));  // a reordered truth takes one away
}

TEST_F(MetricsTest, TheTimeWithoutTruthIsThereIfItIsKnown) {
  const std::string name = "imud_truth_since_newest_seconds";
  EXPECT_FALSE(contains(metrics(), name));
  Summary summary = summarize({&truth_, &quality_, {}, nullptr}, 2.5, {});
  summary.truth.since_newest_s = 12.5;
  EXPECT_TRUE(contains(imud::metrics(summary, MetricsFormat::open_metrics),
                       "# UNIT " + name + " seconds\n# HELP " + name +
                           " host time since the newest accepted truth arrived\n" + name + " 12.5\n"));
}

// The text format names the families of counters with their suffix, has no units, no type info, and no end.
TEST_F(MetricsTest, TheTextFormatHasTheSameValues) {
  const std::string open = metrics(), text = metrics(MetricsFormat::text);
  const auto values = [](const std::string& all) {
    std::vector<std::string> lines;
    for (const std::string& line : lines_of(all))
      if (!line.starts_with("#")) lines.push_back(line);
    return lines;
  };
  EXPECT_GT(values(open).size(), 100U);
  EXPECT_EQ(values(open), values(text));
  EXPECT_TRUE(contains(text, "# TYPE imud_imu_samples_total counter\n"));
  EXPECT_TRUE(contains(text, "# TYPE imud_info gauge\n"));
  EXPECT_FALSE(contains(text, "# UNIT"));
  EXPECT_FALSE(contains(text, "# EOF"));
}

TEST_F(MetricsTest, AReaderGetsOpenMetricsIfItAsks) {
  EXPECT_EQ(metrics_format(""), MetricsFormat::text);
  EXPECT_EQ(metrics_format("*/*"), MetricsFormat::text);
  EXPECT_EQ(metrics_format("text/plain;version=0.0.4;q=0.3"), MetricsFormat::text);
  // As Prometheus 2.42 asks.
  EXPECT_EQ(metrics_format("application/openmetrics-text;version=1.0.0,application/openmetrics-text;version=0.0.1;"
                           "q=0.75,text/plain;version=0.0.4;q=0.5,*/*;q=0.1"),
            MetricsFormat::open_metrics);
}

TEST_F(MetricsTest, BucketsAreCumulative) {
  for (const double seconds : {0.0, 1.5e-6, 3e-6, 0.9e-3, 20.0, 2000.0}) imu_.lateness.add(seconds);
  const std::string text = metrics();
  for (const auto& [limit, wanted] :
       {std::pair{"1e-06", 1}, {"2e-06", 2}, {"5e-06", 3}, {"0.0005", 3}, {"0.001", 4}, {"10.0", 4}, {"+Inf", 6}})
    EXPECT_TRUE(
        contains(text, fmt::format("imud_imu_lateness_seconds_bucket{{imu=\"imu1\",le=\"{}\"}} {}\n", limit, wanted)))
        << limit << "\n"
        << text;
  EXPECT_TRUE(contains(text, "imud_imu_lateness_seconds_count{imu=\"imu1\"} 6\n"));
  EXPECT_DOUBLE_EQ(imu_.lateness.sum(), 2020.0 + 0.9e-3 + 4.5e-6);
}

}  // namespace
}  // namespace imud
