// `imud campaign check` names a value that no case can have, and describes a plan that is right.
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

// The capture has 0.2 s of truth, the longer one 0.5 s in two runs.
TEST_F(CampaignCheck, ACommandThatCannotReadItsCaseIsRefused) {
  const std::string can =
      "[[imu]]\nprotocol = \"j1939\"\nport = \"canfile:unused.log\"\nrate_hz = 100\n"
      "gyro.max_rad_per_s = 4\naccelerometer.max_m_per_s2 = 100\n";
  write("imu.toml", base + can);
  const std::string test = "[test]\ncommand = \"cat {port}\"\n", paced = test + "clock = \"realtime\"\n";
  expect_parts(trial(test + "time_limit_s = 0.1\n"), {});
  expect_parts(trial(paced + "time_limit_s = 0.8\nsettle_s = 0.5\n"), {});
  expect_parts(
      trial(paced + "time_limit_s = 0.7\nsettle_s = 0.5\n"),
      {"(case 0): plan.toml: test.time_limit_s: give more than 0.7 s: by the clock \"realtime\" a case takes "
       "the 0.2 s of its capture, after settle_s, 0.5"});
  write(
      "longer.csv", truth_rows + [] {
        std::string again;
        for (int i = 0; i <= 30; ++i)
          again += fmt::format("{},0,0,0,0,0,0,0,0,-9.8\n", 100'000'000'000 + i * 10'000'000LL);
        return again;
      }());
  const std::string longer = "[axes]\ncapture = [\"truth.csv\", \"longer.csv\"]\n" + paced;
  expect_parts(trial(longer + "time_limit_s = 0.6\n"), {});
  expect_parts(
      trial(longer + "time_limit_s = 0.5\n"),
      {"plan.toml:4: axes.capture: longer.csv (case 1): plan.toml: test.time_limit_s: give more than 0.5 s"});
  write("imu.toml", base.substr(0, base.find("[[imu]]")) + can);
  expect_parts(
      trial(test),
      {"(case 0): plan.toml: test: {port} is a serial line, and the protocols of all imus are of CAN; give an "
       "imu the protocol of a serial line"});
}

TEST_F(CampaignCheck, MoreErrorsOverTimeThanATableHasRoomForAreRefused) {
  const std::string errors = "integrated_errors = true\nintegrated_errors_every_s = ";
  expect_parts(trial(errors + "0.001\n"), {});  // 201 times 6 figures
  write("truth.csv", truth_rows + "300000000,0,0,0,0,0,0,0,0,-9.8\n");
  expect_parts(trial(errors + "0.001\n"),
               {"integrated_errors_every_s: gives 1806 figures, and a table has room for 1500; give a longer"});
}

TEST_F(CampaignCheck, CasesInRealTimeTakeTheTimeOfTheirCapture) {
  write("plan.toml", head +
                         "seeds = \"1..1000\"\n[test]\ncommand = \"cat {port}\"\nclock = \"realtime\"\n"
                         "settle_s = 30\n");
  const ProgramResult run = run_program("imud", {"campaign", "check", path("plan.toml")});
  EXPECT_EQ(run.exit_code, 0) << run.errors;
  EXPECT_TRUE(std::regex_search(
      run.output, std::regex("time     3[0-9.]+ s a case \\(by the capture: cases 0, 499, 999\\), .* for all in as "
                             "many processes as the [0-9]+ processors? here, without \\[test\\]\n")))
      << run.output;
}

TEST_F(CampaignCheck, TheCommandSaysWhatThePlanCosts) {
  write("plan.toml", head + R"(seeds = "1..50"
[axes]
imu.imu1.gyro.max_rad_per_s = { from = 1, to = 8, count = 8 }
capture = ["truth.csv"]
[draws]
count = 3
[draws.keys]
imu.imu1.gyro.bias_rad_per_s = { distribution = "normal", standard_deviation = 1e-3, components = 3 }
)");
  const ProgramResult run = run_program("imud", {"campaign", "check", path("plan.toml")});
  EXPECT_EQ(run.exit_code, 0) << run.errors;
  EXPECT_TRUE(run.errors.empty()) << run.errors;
  const std::vector<std::string> lines = lines_of(run.output);
  ASSERT_EQ(lines.size(), 9U) << run.output;
  EXPECT_EQ(lines[0], path("plan.toml") + ": good");
  EXPECT_EQ(lines[1], "cases    1200: 8 x 1 x 3 draws x 50 seeds");
  EXPECT_EQ(lines[2], "axis     imu.imu1.gyro.max_rad_per_s: 1, 2, 3, 4, 5, 6, .., 8");
  EXPECT_EQ(lines[3], "axis     capture: truth.csv");
  EXPECT_EQ(lines[4], "draws    3, random, seed 1: imu.imu1.gyro.bias_rad_per_s");
  EXPECT_EQ(lines[5], "seeds    1..50");
  EXPECT_EQ(lines[6],
            "tried    9 of 9 values, each beside the first values of the other axes; 3 draws; 24 combinations");
  EXPECT_TRUE(std::regex_match(
      lines[7], std::regex("time     [0-9.e-]+ s a case \\(measured: cases 0, 599, 1199\\), .* for all "
                           "on the [0-9]+ processors? here")))
      << lines[7];
  EXPECT_TRUE(std::regex_match(lines[8], std::regex("results  [0-9.]+ k?B.* a case, [0-9.]+ .B for all")))
      << lines[8];
}

TEST_F(CampaignCheck, TheCommandListsFaults) {
  write("plan.toml", head + "[axes]\nimu.imu1.rate_hz = [-1, 10]\ncapture = [\"no.csv\"]\n");
  const ProgramResult run = run_program("imud", {"campaign", "check", path("plan.toml")});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_TRUE(contains(run.errors, "plan.toml:5: axes.capture: there is no file ")) << run.errors;
  EXPECT_TRUE(contains(run.errors, "\n1 fault\n")) << run.errors;
  EXPECT_TRUE(run.output.empty());
  const ProgramResult absent = run_program("imud", {"campaign", "check", path("absent.toml")});
  EXPECT_EQ(absent.exit_code, 2);
  EXPECT_TRUE(contains(absent.errors, "absent.toml: cannot be read: No such file")) << absent.errors;
}

TEST_F(CampaignCheck, AnUnknownCommandIsNamed) {
  const ProgramResult run = run_program("imud", {"campaign", "chek", "plan.toml"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_EQ(run.errors, "imud: unknown command \"chek\"; did you mean \"check\"?\n");
}

TEST_F(CampaignCheck, TheExampleIsRight) {
  const ProgramResult run = run_program("imud", {"campaign", "check", IMUD_SOURCE_DIR "/tools/campaign.toml"});
  EXPECT_EQ(run.exit_code, 0) << run.errors;
  EXPECT_TRUE(contains(run.output, "cases    900: 3 x 3 x 50 draws x 2 seeds")) << run.output;
}

}  // namespace
}  // namespace imud
