// The parts of imu-campaign: pass rates, percentiles, the sample of cases, and rows as cells.
// tests/campaign/collect_test.py has the program.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "emulator/campaign/shards/wilson.hpp"
#include "tools/campaign/case_row.hpp"
#include "tools/campaign/case_sample.hpp"
#include "tools/campaign/case_table.hpp"

namespace imud {
namespace {

// The bounds are those of R 3.6.2, prop.test(k, 10, correct=FALSE), as SciPy's own test of binomtest() quotes them
// (scipy/stats/tests/test_morestats.py, test_ci_wilson); with seven digits.
TEST(Wilson, HasTheBoundsOfR) {
  const struct {
    std::uint64_t passes;
    double low, high;
  } known[] = {{0, 0, 0.2775328}, {3, 0.1077913, 0.6032219}, {10, 0.7224672, 1}};
  for (const auto& one : known) {
    const Interval interval = wilson_interval(one.passes, 10);
    EXPECT_NEAR(interval.low, one.low, 5e-8);
    EXPECT_NEAR(interval.high, one.high, 5e-8);
  }
  EXPECT_EQ(wilson_interval(0, 10).low, 0);
  EXPECT_EQ(wilson_interval(10, 10).high, 1);
  EXPECT_EQ(wilson_interval(0, 0).low, 0);
  EXPECT_EQ(wilson_interval(0, 0).high, 1);
}

// Its bounds are the probabilities at which the score test, |p - x| = z sqrt(x(1 - x)/n), is just not rejected.
TEST(Wilson, SolvesTheEquationOfTheScoreTest) {
  for (const std::uint64_t passes : {1U, 17U, 500U, 999U}) {
    const double p = static_cast<double>(passes) / 1000;
    const Interval interval = wilson_interval(passes, 1000);
    for (const double x : {interval.low, interval.high})
      EXPECT_NEAR(std::abs(p - x) / std::sqrt(x * (1 - x) / 1000), 1.959963984540054, 1e-9) << passes;
  }
}

// Of 400 samples of 200 runs with a probability of 0.9, the interval holds it in 93.3 % on average (the sum of the
// binomial probabilities of the counts whose interval has it, 172 to 187: computed below). Beyond four standard
// deviations, 5 %, by chance once in 16,000 times; the seed is fixed.
TEST(Wilson, HoldsAKnownProbability) {
  std::mt19937_64 random(7);
  std::binomial_distribution<std::uint64_t> passes(200, 0.9);
  double expected = 0;
  for (std::uint64_t k = 0; k <= 200; ++k) {
    const Interval interval = wilson_interval(k, 200);
    const auto n = static_cast<double>(k);
    if (interval.low <= 0.9 && 0.9 <= interval.high)
      expected += std::exp(std::lgamma(201.0) - std::lgamma(n + 1) - std::lgamma(201 - n) + n * std::log(0.9) +
                           (200 - n) * std::log(0.1));
  }
  EXPECT_NEAR(expected, 0.95, 0.03);
  int held = 0;
  for (int i = 0; i < 400; ++i) {
    const Interval interval = wilson_interval(passes(random), 200);
    held += interval.low <= 0.9 && 0.9 <= interval.high ? 1 : 0;
  }
  EXPECT_NEAR(held / 400.0, expected, 0.05);
}

TEST(Moments, AreExactForSmallWholeNumbers) {
  Moments moments;
  for (const double number : {2, 4, 4, 4, 5, 5, 7, 9}) moments.add(number);
  EXPECT_EQ(moments.runs, 8U);
  EXPECT_DOUBLE_EQ(moments.mean, 5);
  EXPECT_DOUBLE_EQ(moments.deviation(), std::sqrt(32.0 / 7));
  EXPECT_EQ(moments.min, 2);
  EXPECT_EQ(moments.max, 9);
  EXPECT_TRUE(std::isnan(Moments().deviation()));
  // A sum of squares would lose all digits.
  Moments far;
  for (const double number : {1e9 + 4, 1e9 + 7, 1e9 + 13, 1e9 + 16}) far.add(number);
  EXPECT_DOUBLE_EQ(far.deviation(), std::sqrt(30.0));
}

TEST(Percentile, IsLinearBetweenTheNearest) {
  const std::vector<double> sorted = {1, 2, 3, 4};
  EXPECT_DOUBLE_EQ(percentile(sorted, 0), 1);
  EXPECT_DOUBLE_EQ(percentile(sorted, 0.25), 1.75);  // numpy.percentile([1, 2, 3, 4], 25)
  EXPECT_DOUBLE_EQ(percentile(sorted, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(percentile(sorted, 1), 4);
  EXPECT_DOUBLE_EQ(percentile({5}, 0.95), 5);
  EXPECT_TRUE(std::isnan(percentile({}, 0.5)));
}

// The median of a sample of n uniform numbers has the standard deviation 1/sqrt(4n). There are at least a thousand:
// the bound is five of these.
TEST(CaseSample, StaysWithinItsBytesAndKeepsTheDistribution) {
  CaseSample sample(400'000);
  constexpr std::uint64_t cases = 100'000;
  for (std::uint64_t i = 0; i < cases; ++i)
    if (sample.wants(i)) sample.add(i, {static_cast<double>(i) / cases}, {0});
  EXPECT_LT(sample.size(), 400'000U / 64);
  ASSERT_GT(sample.size(), 1000U);
  std::vector<double> numbers;
  for (std::size_t row = 0; row < sample.size(); ++row) numbers.push_back(sample.number(row, 0, -1));
  std::ranges::sort(numbers);
  EXPECT_NEAR(percentile(numbers, 0.5), 0.5, 5 / std::sqrt(4.0 * 1000));
  EXPECT_EQ(sample.number(0, 1, -1), -1);
}

std::vector<std::string> names_of(const CaseRow& row) {
  std::vector<std::string> names;
  for (const TableColumn& column : table_columns(row)) names.push_back(column.name);
  return names;
}

TEST(CaseRow, NamesItsColumnsInTheOrderOfTheTable) {
  CaseRow row;
  row.read(R"({"case": 7, "axes": {"b": "1", "a": "x"}, "seed": 3, "exit_code": 0, "ended_by": "signal",
    "figures": {"imu1.samples": 5, "deep": {"er": [1.5, {"est": true}]}}, "digest": {"imu1": "ab"},
    "expect": {"settles": false}, "shortfalls": ["one", "two"], "error": null,
    "test": {"exit_code": 4, "metrics": {"error": 1e-3, "exit_code": 9}}, "unknown": {"figures": {"x": 1}}})",
           7);
  EXPECT_EQ(names_of(row),
            (std::vector<std::string>{"case", "seed", "b", "a", "exit_code", "ended_by", "expect.settles",
                                      "digest.imu1", "imu1.samples", "deep.er.0", "deep.er.1.est", "test.exit_code",
                                      "test.error", "test.exit_code_2", "shortfalls", "error"}));
  EXPECT_EQ(row.index(), 7U);
  EXPECT_EQ(row[CaseRow::shortfalls].text, "one; two");
  EXPECT_EQ(row[CaseRow::error].kind, CaseCell::Kind::empty);
  EXPECT_TRUE(row.has_failed());
  const std::size_t columns = row.columns().size();
  // Another order, absent and additional members.
  row.read(R"({"seed": 4, "case": 8, "figures": {"new": -0.0, "imu1.samples": null}, "exit_code": 0})", 8);
  EXPECT_EQ(row.columns().size(), columns + 1);
  EXPECT_FALSE(row.has_failed());
  EXPECT_EQ(row[columns].text, "-0.0");
  // A counter that is left out is 0, unless there was no run; other figures and metrics are not known.
  const auto zeros = [&row] {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < row.columns().size(); ++i)
      if (row[i].kind == CaseCell::Kind::integer && row[i].integer == 0) names.push_back(row.columns()[i].name());
    return names;
  };
  EXPECT_EQ(zeros(), (std::vector<std::string>{"exit_code", "imu1.samples"}));
  row.read(R"({"case": 9, "seed": 4, "exit_code": 0, "error": "none"})", 9);
  EXPECT_EQ(zeros(), (std::vector<std::string>{"exit_code"}));
}

TEST(CaseRow, NamesThatDifferByCaseOnlyOrAreTakenGetANumber) {
  CaseRow row;
  row.read(
      R"({"case": 0, "axes": {"seed": "1", "Imu1.Samples": "2"}, "figures": {"imu1.samples": 1}, "exit_code": 0})",
      0);
  EXPECT_EQ(names_of(row), (std::vector<std::string>{"case", "seed", "seed_2", "Imu1.Samples_2", "exit_code",
                                                     "ended_by", "imu1.samples", "shortfalls", "error"}));
}

TEST(CaseRow, RefusesWhatIsNoRow) {
  CaseRow row;
  for (const char* text :
       {"", "7", "[1]", "{}", R"({"case": -1})", R"({"case": "0"})", R"({"case": 1})", R"({"case": 0)",
        "{\"case\": 0}x", R"({"case": 0, "figures": {"a": 1e999}})", R"({"case": 0, "figures": {"a": NaN}})"})
    EXPECT_THROW(row.read(text, 0), std::runtime_error) << text;
  std::string many = R"({"case": 0, "figures": {"a": 0)";
  for (int i = 0; i < 2000; ++i) many += ", \"b" + std::to_string(i) + "\": 1";
  EXPECT_THROW(row.read(many + "}}", 0), std::runtime_error);
}

}  // namespace
}  // namespace imud
