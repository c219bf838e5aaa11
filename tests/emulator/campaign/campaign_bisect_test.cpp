// Bisection over an axis: edges that are known, edges that are several, and the command that repeats a case.
#include "emulator/campaign/campaign_bisect.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "tests/emulator/campaign/campaign_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class CampaignBisects : public CampaignWithResults {
 protected:
  ProgramResult bisect(const std::string& axis, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"campaign", "bisect", path("plan.toml"), "--axis", axis, "--jobs", "2"});
    return run_program("imud", more);
  }
  ProgramResult repeat(const std::string& index, const std::string& value) const {
    return run_program("imud", {"campaign", "repeat", path("plan.toml"), index, "--axis", value});
  }
};

// The expectation's time of 0.05 s has to end before the run, which has samples to 0.2 s.
TEST_F(CampaignBisects, TheEdgeIsFoundForEachCombination) {
  write("imu.toml", base + "[[expect]]\nname = \"quiet\"\nwhat = \"host_is_silent\"\nat_s = 0\nwithin_s = 0.05\n");
  plan("seeds = \"1..2\"\n[axes]\n\"expect.0.at_s\" = [0.3, 0, 0.1]\n\"imu.imu1.rate_hz\" = [100, 200]\n");
  const ProgramResult done = bisect("expect.0.at_s", {"--tolerance", "0.001"});
  ASSERT_EQ(done.exit_code, 0) << done.errors;
  const std::vector<std::string> lines = lines_of(done.output);
  ASSERT_EQ(lines.size(), 8U) << done.output;
  for (unsigned i = 0; i < 4; ++i) {
    unsigned number = 0, runs = 0;
    double low = 0, high = 0;
    ASSERT_EQ(std::sscanf(lines[2 * i].c_str(), "case %u: passes at %lf, fails at %lf (%u runs)", &number, &low,
                          &high, &runs),
              4)
        << lines[2 * i];
    EXPECT_EQ(number, i);
    EXPECT_LE(low, 0.15);
    EXPECT_GE(high, 0.15);
    EXPECT_LE(high - low, 0.001);
    EXPECT_GT(high, low);
    EXPECT_EQ(runs, 11U);  // three, and eight halves of 0.2 s
    EXPECT_EQ(lines[2 * i + 1],
              fmt::format("  imud campaign repeat {} {} --axis expect.0.at_s={} --record case_{}.pcapng",
                          path("plan.toml"), i, high, i));
    EXPECT_EQ(repeat(fmt::to_string(i), fmt::format("expect.0.at_s={}", high)).exit_code, 3);
    EXPECT_EQ(repeat(fmt::to_string(i), fmt::format("expect.0.at_s={}", low)).exit_code, 0);
  }
  // The other values of the last case alone: the second rate, the second seed.
  const ProgramResult one = bisect("expect.0.at_s", {"--tolerance", "0.001", "--case", "11"});
  EXPECT_EQ(lines_of(one.output).size(), 2U);
  EXPECT_TRUE(one.output.starts_with("case 11: passes at ")) << one.output;
  plan("[axes]\n\"expect.0.at_s\" = [0, 0.05, 0.1]\n");
  EXPECT_EQ(bisect("expect.0.at_s").output, "case 0: passes at all 3 values from 0 to 0.1\n");
}

// A message of `native` has 124 bytes: 5 of them at 20 Hz, 21 at 100 Hz and 81 at 400 Hz.
TEST_F(CampaignBisects, SeveralEdgesAreSaid) {
  plan(
      "[test]\ncommand = '''n=$(cat {port} | wc -c); test $n -lt 1000 -o $n -gt 3000'''\n[axes]\n"
      "\"imu.imu1.rate_hz\" = [20, 100, 400]\n");
  const ProgramResult done = bisect("imu.imu1.rate_hz", {"--tolerance", "10"});
  ASSERT_EQ(done.exit_code, 0) << done.errors;
  EXPECT_TRUE(done.output.starts_with("case 0: passes at ")) << done.output;
  EXPECT_NE(done.output.find("not monotone: it passes again at 400\n"), std::string::npos) << done.output;
}

// 21 samples, of which 7 that are not silent have less than 900 bytes.
TEST_F(CampaignBisects, AKeyOfWholeNumbersIsTriedAtThose) {
  write("imu.toml", base + R"([[fault]]
target = "wire"
kind = "silence"
at_sample = 0
for_samples = 1
)");
  plan("[test]\ncommand = 'test $(cat {port} | wc -c) -gt 900'\n[axes]\n\"fault.0.for_samples\" = [1, 20]\n");
  const ProgramResult done = bisect("fault.0.for_samples");
  ASSERT_EQ(done.exit_code, 0) << done.errors;
  EXPECT_TRUE(done.output.starts_with("case 0: passes at 13, fails at 14 (")) << done.output;
}

TEST_F(CampaignBisects, AxesThatHaveNoOrderAreRefused) {
  plan("[axes]\nmodel = [\"ideal\", \"white\"]\n\"imu.imu1.rate_hz\" = [100]\n");
  for (const char* axis : {"model", "imu.imu1.rate_hz"}) {
    const ProgramResult done = bisect(axis);
    EXPECT_EQ(done.exit_code, 2);
    EXPECT_NE(done.errors.find("give an axis of two numbers or more"), std::string::npos) << done.errors;
  }
  EXPECT_NE(bisect("imu.imu1.rate").errors.find("the plan has no such axis, but model, imu.imu1.rate_hz"),
            std::string::npos);
  EXPECT_EQ(repeat("0", "imu.imu1.rate_hz").exit_code, 2);
  EXPECT_EQ(repeat("0", "model=ideal").exit_code, 2);
}

}  // namespace
}  // namespace imud
