// `imud campaign check`: a value that no case can have, and what it says of a plan that is right.
#include "emulator/campaign/campaign_check.hpp"

#include <gtest/gtest.h>

#include <regex>

#include "tests/emulator/campaign/campaign_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class CampaignCheck : public CampaignFolder {
 protected:
  // Returns the faults of the cases of a plan, without the folder in them.
  std::vector<std::string> trial(const std::string& plan) {
    try {
      tried_ = try_cases(read(plan));
      return {};
    } catch (const ConfigError& error) {
      return without_folder(error.faults);
    }
  }
  TriedCases tried_;
};

TEST_F(CampaignCheck, AValueThatNoCaseCanHaveIsRefusedWithItsFirstCase) {
  expect_parts(trial(R"(seeds = "1..10"
[axes]
imu.imu1.rate_hz = [10, 2e6, 20]
imu.imu1.protocol = ["native", "stim30"]
imu.imu1.gyro.bias_rad_per_s = [[0, 0, 0], [1, 2]]
)"),
               {"plan.toml:5: axes.imu.imu1.rate_hz: 2000000.0 (case 40): imu.toml: imu.0.rate_hz: ",
                "plan.toml:6: axes.imu.imu1.protocol: stim30 (case 20): imu.toml: imu.0.protocol: there is no "
                "\"stim30\"; did you mean \"stim300\"?",
                "plan.toml:7: axes.imu.imu1.gyro.bias_rad_per_s: [1, 2] (case 10): imu.toml: "
                "imu.0.gyro.bias_rad_per_s: give three "});
}

// The fault of a key is named once, not for each of its values, and names the nearest right key.
TEST_F(CampaignCheck, AMisspeltKeyIsNamedOnce) {
  expect_parts(trial("[axes]\nimu.imu1.gyro.bias_rad_per = [1, 2, 3]\n"),
               {"plan.toml: imu.imu1.gyro.bias_rad_per=1 (case 0): imu.toml: "
                "imu.0.gyro.bias_rad_per: unknown key; did you mean \"bias_rad_per_s\"?"});
  expect_parts(trial("[axes]\nimu.imu2.rate_hz = [1]\n"), {"\"imu2\" is not an index below 1"});
}

// The draws at both ends of the distribution are tried, wherever they are among the draws.
TEST_F(CampaignCheck, ADrawThatNoCaseCanHaveIsRefused) {
  const std::string plan =
      "[draws]\ncount = 5000\n[draws.keys]\n\"imu.imu1.rate_hz\" = { distribution = \"normal\", mean = 1000, "
      "standard_deviation = ";
  expect_parts(trial(plan + "100 }\n"), {});
  EXPECT_EQ(tried_.draws, 34U);
  const std::vector<std::string> faults = trial(plan + "310 }\n");
  ASSERT_EQ(faults.size(), 1U) << "below 0 with probability 6e-4";
  EXPECT_TRUE(
      std::regex_search(faults[0], std::regex("plan.toml:3: draw=[0-9]+ imu.imu1.rate_hz=-[0-9.]+ \\(case [0-9]+\\): "
                                              "imu.toml: imu.0.rate_hz: ")))
      << faults[0];
}

// Two values that are right alone can be wrong together.
TEST_F(CampaignCheck, CombinationsAreTried) {
  expect_parts(
      trial("[axes]\nimu.imu1.protocol = [\"native\", \"kvh1775\"]\ntruth.when_stopped = [\"hold\", \"flag\"]\n"),
      {"plan.toml: imu.imu1.protocol=kvh1775 truth.when_stopped=flag (case 3): imu.toml:4: imu.0.protocol: kvh1775 "
       "cannot mark a sample"});
  expect_parts(trial("[axes]\nimu.imu1.rate_hz = [10, 100]\nimu.imu1.gyro.max_rad_per_s = [4, 40]\n"), {});
  EXPECT_EQ(tried_.values, 4U);
  EXPECT_EQ(tried_.all_values, 4U);
  EXPECT_EQ(tried_.combinations, 4U);
}

TEST_F(CampaignCheck, AThousandValuesOfAnAxisAreTried) {
  expect_parts(trial("[axes]\nimu.imu1.gyro.max_rad_per_s = { from = 1, to = 2, count = 3000 }\n"), {});
  EXPECT_EQ(tried_.values, 1000U);
  EXPECT_EQ(tried_.all_values, 3000U);
}

}  // namespace
}  // namespace imud
