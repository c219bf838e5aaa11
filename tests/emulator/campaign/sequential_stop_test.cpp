// Sequential stopping: the end of a campaign depends on the rows in the order of the cases alone.
#include "emulator/campaign/shards/sequential_stop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "emulator/campaign/shards/wilson.hpp"
#include "tests/emulator/campaign/campaign_test.hpp"

namespace imud {
namespace {

TEST(StopRules, AreReadFromASentence) {
  const auto rule = StopRule::parse("lands softly at 3 pass rate within 0.5 % at 99.9%");
  ASSERT_TRUE(rule);
  EXPECT_EQ(rule->name, "lands softly at 3");
  EXPECT_DOUBLE_EQ(rule->half_width, 0.005);
  EXPECT_DOUBLE_EQ(rule->confidence, 0.999);
  for (const char* bad :
       {"", "cases", "cases pass rate within 1 %", "pass rate within 1 % at 95 %", " pass rate within 1 % at 95 %",
        "cases pass rate within 1 at 95 %", "cases pass rate within 1 % at 95", "cases pass rate within 50 % at 95 %",
        "cases pass rate within 0 % at 95 %", "cases pass rate within 1 % at 100 %",
        "cases pass rate within nan % at 95 %", "cases pass rate within 1 % at 95 % or so"})
    EXPECT_FALSE(StopRule::parse(bad)) << bad;
}

// With z = 1.959964, half the width of Wilson's interval is z^2/2(n + z^2) if all pass, and z/2 sqrt(n + z^2) if half
// do.
TEST(StopRules, AreMetByTheIntervalOfWilson) {
  const StopRule rule = *StopRule::parse("cases pass rate within 1 % at 95 %");
  EXPECT_FALSE(rule.is_met(188, 188));
  EXPECT_TRUE(rule.is_met(189, 189));
  EXPECT_TRUE(rule.is_met(0, 189));
  EXPECT_FALSE(rule.is_met(4799, 9598));
  EXPECT_TRUE(rule.is_met(4800, 9600));
  EXPECT_FALSE(rule.is_met(0, 0));
}

// Returns the probability that the interval at the end has the rate in it, if each case passes with that rate and
// the rule is looked at after each `batch` of cases. Computed over all numbers of passes: exact.
double coverage_at_the_end(const StopRule& rule, double rate, std::uint64_t batch) {
  std::vector<double> open = {1};  // the probability of that many passes, if there was no end before
  double covered = 0, ended = 0;
  for (std::uint64_t runs = 1; 1 - ended > 1e-9; ++runs) {
    open.push_back(0);
    for (std::uint64_t k = runs; k > 0; --k) open[k] = open[k] * (1 - rate) + open[k - 1] * rate;
    open[0] *= 1 - rate;
    if (runs % batch != 0) continue;
    for (std::uint64_t k = 0; k <= runs; ++k) {
      if (open[k] == 0 || !rule.is_met(k, runs)) continue;
      const Interval interval = wilson_interval(k, runs, rule.confidence);
      if (interval.low <= rate && rate <= interval.high) covered += open[k];
      ended += std::exchange(open[k], 0);
    }
  }
  return covered;
}

// The figures of emulator/campaign/README.md.
TEST(StopRules, RepeatedLooksCostCoverage) {
  const StopRule rule = *StopRule::parse("cases pass rate within 5 % at 95 %");
  constexpr int rates = 200;
  double least = 1, least_below_90_percent = 1, sum = 0;
  for (int i = 0; i < rates; ++i) {
    const double rate = 0.5 + 0.0025 * i, coverage = coverage_at_the_end(rule, rate, 10);
    least = std::min(least, coverage);
    if (i < 160) least_below_90_percent = std::min(least_below_90_percent, coverage);
    sum += coverage;
  }
  EXPECT_NEAR(least, 0.905, 0.0006);
  EXPECT_NEAR(least_below_90_percent, 0.929, 0.0006);
  EXPECT_NEAR(sum / rates, 0.952, 0.0006);
}

class SequentialStops : public CampaignWithResults {
 protected:
  ResultFolder folder(const std::string& until, std::uint64_t cases, std::uint64_t batch) const {
    return {path("made"), {"/plan.toml", sha256_of_plan, cases, batch, "1", "b", "", until}, ""};
  }
  // Writes a shard whose cases pass where the text has a 1, and could not be run where it has an x.
  static void write_shard(const ResultFolder& folder, std::uint64_t number, const std::string& text) {
    const CaseRange cases = folder.campaign().shard(number);
    ShardWriter writer(folder.shards_path(), folder.campaign().head(cases));
    for (std::uint64_t i = 0; i < cases.size(); ++i) {
      const char result = text.at(i);
      writer.add(fmt::format(
          R"({{"case":{},"axes":{{}},"seed":1,"exit_code":{},"expect":{{"lands":{}}},"shortfalls":[],"error":{}}})",
          cases.first + i,
          result == '1'   ? 0
          : result == 'x' ? 1
                          : 3,
          result == '1', result == 'x' ? "\"no memory\"" : "null"));
    }
    writer.commit();
  }
  // 400 cases of which half pass, as probability has it; 92 to 93 of them give an interval of 10 % at 95 %.
  void write_plan(const std::string& until) const {
    write("imu.toml", base + "[[expect]]\nname = \"quiet\"\nwhat = \"host_is_silent\"\nat_s = 0\nwithin_s = 0.05\n");
    plan("batch = 10\nuntil = \"" + until +
         "\"\n[draws]\ncount = 400\n[draws.keys]\n\"expect.0.at_s\" = { distribution = \"uniform\", from = 0, to = "
         "0.3 }\n");
  }
  // Returns the lines of the tables that do not depend on time, and the exit code of `status`.
  std::string end_of(const std::string& folder) const {
    const ProgramResult done = status(folder, {"--json"});
    std::string text;
    for (const char* key : {"until", "cases", "cases_done", "rates"})
      text += nlohmann::json::parse(done.output)[key].dump() + " ";
    return text + fmt::to_string(done.exit_code);
  }

  static constexpr const char* sha256_of_plan = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
};

TEST_F(SequentialStops, TheEndIsTheFirstShardInTheOrderOfTheCases) {
  const ResultFolder made = folder("cases pass rate within 20 % at 90 %", 40, 4);
  SequentialStop stop(made);
  EXPECT_FALSE(stop.look());
  EXPECT_EQ(stop.cases(), 40U);
  write_shard(made, 1, "1111");  // 8 cases that pass would be an end
  write_shard(made, 2, "1111");
  EXPECT_FALSE(stop.look());
  write_shard(made, 0, "0101");
  EXPECT_TRUE(stop.look());
  EXPECT_EQ(stop.cases(), 12U);
  SequentialStop later(made);
  EXPECT_TRUE(later.look());
  EXPECT_EQ(later.text(), stop.text());
  EXPECT_NE(stop.text().find("reached after 12 of 40 cases: 10 of 12 passed"), std::string::npos) << stop.text();
  EXPECT_EQ(stop.needed({8, 15}), (CaseRange{8, 11}));
  EXPECT_EQ(stop.needed({12, 15}), std::nullopt);
}

TEST_F(SequentialStops, ACaseThatCouldNotBeRunDefersTheEnd) {
  const ResultFolder made = folder("lands pass rate within 20 % at 90 %", 40, 4);
  SequentialStop stop(made);
  write_shard(made, 0, "1111");
  write_shard(made, 1, "11x1");
  write_shard(made, 2, "1111");
  EXPECT_FALSE(stop.look());
  EXPECT_NE(stop.text().find("not yet reached after 4 of 40 cases: 4 of 4 passed"), std::string::npos) << stop.text();
  std::filesystem::remove(made.shards_path() / shard_name({4, 7}));
  write_shard(made, 1, "1101");
  EXPECT_TRUE(stop.look());
  EXPECT_EQ(stop.cases(), 8U) << stop.text();
}

TEST_F(SequentialStops, DoNotDependOnProcessesPiecesAndKills) {
  write_plan("quiet pass rate within 10 % at 95 %");
  const ProgramResult done = run("one", {"--jobs", "1", "--quiet"});
  ASSERT_EQ(done.exit_code, 3) << done.errors;
  const std::string expected = end_of("one");
  EXPECT_NE(expected.find("reached after 100 of 400 cases"), std::string::npos) << expected;
  EXPECT_LT(shards("one").size(), 40U);
  ASSERT_EQ(run("four", {"--jobs", "4", "--quiet"}).exit_code, 3);
  EXPECT_EQ(end_of("four"), expected);
  // The last cases first: they are there, and do not count.
  for (const char* piece : {"200..399", "90..199", "0..89"})
    ASSERT_LE(run("pieces", {"--case", piece, "--jobs", "2", "--quiet"}).exit_code, 3) << piece;
  EXPECT_EQ(shards("pieces").size(), 40U);
  EXPECT_EQ(end_of("pieces"), expected);
  // A piece behind the end has nothing to do.
  EXPECT_EQ(run("one", {"--case", "390..399"}).exit_code, 0);
  EXPECT_FALSE(shards("one").contains(shard_name({390, 399})));
  Program killed("imud");
  killed.start({"campaign", "run", path("plan.toml"), "--into", path("killed"), "--jobs", "1", "--quiet"});
  while (killed.is_running() && !std::filesystem::exists(path("killed/shards/" + shard_name({0, 9}))))
    std::this_thread::yield();
  killed.kill(SIGKILL);
  killed.wait();
  std::filesystem::remove(path("killed/shards/" + shard_name({0, 9})));
  ASSERT_EQ(resume("killed").exit_code, 3);
  EXPECT_EQ(end_of("killed"), expected);
  for (const char* folder : {"four", "pieces", "killed"})
    for (const auto& [name, text] : shards("one"))
      if (cases_of_shard(name)->first < 100) {
        EXPECT_EQ(shards(folder).at(name), text) << folder << name;
      }
  // Nothing is left to do.
  EXPECT_NE(resume("one").output.find("0 cases, 0 shards"), std::string::npos);
}

TEST_F(SequentialStops, APlanThatIsTooShortEndsAtItsEnd) {
  write_plan("cases pass rate within 1 % at 95 %");
  const ProgramResult done = run("runs", {"--jobs", "2", "--quiet"});
  EXPECT_EQ(done.exit_code, 3);
  EXPECT_NE(done.output.find("not reached after 400 of 400 cases"), std::string::npos) << done.output;
  EXPECT_EQ(shards("runs").size(), 40U);
}

TEST_F(SequentialStops, ARuleThatHasNoAnswerIsRefused) {
  const std::string axis = "[axes]\n\"imu.imu1.rate_hz\" = [50, 100]\n";
  EXPECT_EQ(faults("until = \"soon\"\n").size(), 1U);
  EXPECT_EQ(faults("until = \"cases pass rate within 1 % at 95 %\"\nseeds = \"1..9\"\n").size(), 0U);
  EXPECT_EQ(faults("until = \"cases pass rate within 1 % at 95 %\"\n" + axis).size(), 1U);
  EXPECT_EQ(
      faults("until = \"cases pass rate within 1 % at 95 %\"\nseeds = \"1..9\"\n[draws]\ncount = 5\n[draws.keys]\n"
             "\"imu.imu1.gyro.bias_rad_per_s\" = { distribution = \"uniform\", from = 0, to = 1 }\n")
          .size(),
      1U);
  write_plan("silent pass rate within 1 % at 95 %");
  const ProgramResult check = run_program("imud", {"campaign", "check", path("plan.toml")});
  EXPECT_EQ(check.exit_code, 2);
  EXPECT_NE(check.errors.find("there is no expectation silent"), std::string::npos) << check.errors;
}

}  // namespace
}  // namespace imud
