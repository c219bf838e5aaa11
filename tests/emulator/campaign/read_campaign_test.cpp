#include <gtest/gtest.h>

#include "tests/emulator/campaign/campaign_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

std::vector<std::string> texts_of(const CampaignAxis& axis) {
  std::vector<std::string> all;
  for (const CampaignAxis::Value& value : axis.values) all.push_back(value.text);
  return all;
}

using Texts = std::vector<std::string>;

class ReadCampaign : public CampaignFolder {};

TEST_F(ReadCampaign, HasEachKey) {
  write("fail.toml", "");
  write("b.csv", truth_rows);
  const Campaign campaign = read(R"(seeds = "3..12"
set = ["imu.0.rate_hz=50"]
scenario = "fail.toml"
batch = 7
integrated_errors = true
integrated_errors_every_s = 0.5
[axes]
"imu.imu1.gyro.bias_rad_per_s" = [0, 1e-3, 0.10000000000000001]
capture = ["truth.csv", "b.csv"]
scenario = ["", "fail.toml"]
imu.imu1.gyro.max_rad_per_s = { from = 1, to = 2, count = 5 }
"imu.imu1.accelerometer.max_m_per_s2" = { from = 1, to = 1000, count = 4, scale = "log" }
model = ["ideal", "white"]
unit = [{ name = "slow", "imu.imu1.rate_hz" = 10, "imu.imu1.name" = "a" }, { imu.imu1.rate_hz = 20.0 }]
[draws]
count = 10
seed = 7
method = "latin_hypercube"
[draws.keys]
"imu.imu1.gyro.turn_on_sigma.bias_rad_per_s" = { distribution = "uniform", from = 0, to = 1 }
[test]
command = "./estimator {port}"
time_limit_s = 3
settle_s = 2
clock = "realtime"
[slurm]
partition = "debug"
account = "lab"
time_limit = "1:00:00"
max_running = 9
options = ["--nice"]
)");
  EXPECT_EQ(campaign.file, path("plan.toml"));
  EXPECT_EQ(campaign.base, path("imu.toml"));
  EXPECT_EQ(campaign.capture, path("truth.csv"));
  EXPECT_EQ(campaign.overrides, (Texts{"imu.0.rate_hz=50"}));
  EXPECT_EQ(campaign.scenarios, (Texts{path("fail.toml")}));
  EXPECT_EQ(campaign.batch, 7U);
  EXPECT_TRUE(campaign.integrated_errors);
  EXPECT_EQ(campaign.errors_every_s, 0.5);
  EXPECT_EQ(campaign.sha256.size(), 64U);
  ASSERT_EQ(campaign.axes.size(), 7U);
  EXPECT_EQ(campaign.axes[0].name, "imu.imu1.gyro.bias_rad_per_s");
  EXPECT_EQ(campaign.axes[0].line, 10U);
  EXPECT_EQ(texts_of(campaign.axes[0]), (Texts{"0", "0.001", "0.1"}));
  EXPECT_EQ(campaign.axes[0].values[2].overrides, (Texts{"imu.imu1.gyro.bias_rad_per_s=0.1"}));
  EXPECT_EQ(campaign.axes[1].values[1].capture, path("b.csv"));
  EXPECT_EQ(texts_of(campaign.axes[1]), (Texts{"truth.csv", "b.csv"}));
  EXPECT_TRUE(campaign.axes[2].values[0].scenarios.empty());
  EXPECT_EQ(campaign.axes[2].values[1].scenarios, (Texts{path("fail.toml")}));
  EXPECT_EQ(campaign.axes[3].name, "imu.imu1.gyro.max_rad_per_s");
  EXPECT_EQ(texts_of(campaign.axes[3]), (Texts{"1", "1.25", "1.5", "1.75", "2"}));
  EXPECT_EQ(texts_of(campaign.axes[4]), (Texts{"1", "10", "100", "1000"}));
  EXPECT_EQ(campaign.axes[5].values[1].overrides, (Texts{"imu.*.model=\"white\""}));
  EXPECT_EQ(texts_of(campaign.axes[6]), (Texts{"slow", "imu.imu1.rate_hz=20.0"}));
  EXPECT_EQ(campaign.axes[6].values[0].overrides, (Texts{"imu.imu1.rate_hz=10", "imu.imu1.name=\"a\""}));
  ASSERT_TRUE(campaign.draws);
  EXPECT_EQ(campaign.draws->keys.size(), 1U);
  EXPECT_EQ(campaign.seeds.first, 3U);
  EXPECT_EQ(campaign.cases(), 3U * 2 * 2 * 5 * 4 * 2 * 2 * 10 * 10);
  EXPECT_EQ(campaign.test->command, "./estimator {port}");
  EXPECT_EQ(campaign.test->time_limit_s, 3);
  EXPECT_EQ(campaign.test->settle_s, 2);
  EXPECT_EQ(campaign.test->clock, ClockMode::realtime);
  EXPECT_EQ(campaign.slurm.partition, "debug");
  EXPECT_EQ(campaign.slurm.account, "lab");
  EXPECT_EQ(campaign.slurm.time_limit, "1:00:00");
  EXPECT_EQ(campaign.slurm.max_running, 9U);
  EXPECT_EQ(campaign.slurm.options, (Texts{"--nice"}));
}

TEST_F(ReadCampaign, TheShortestPlanHasOneCase) {
  const Campaign campaign = read("");
  EXPECT_EQ(campaign.cases(), 1U);
  EXPECT_FALSE(campaign.test);
  EXPECT_EQ(case_of(campaign, 0).seed, 1U);
}

TEST_F(ReadCampaign, EveryFaultIsNamedAtOnceWithItsLine) {
  expect_parts(faults(R"(seds = 4
seeds = "9..1"
integrated_errors_every_s = 1
[axes]
capture = ["truht.csv"]
"imu.imu1.rate_hz" = { from = 1, to = 0, count = 1, scale = "log" }
"imu.imu1.name" = []
seed = [1, 2]
"imu.imu1.port" = ["a", "a"]
[draws]
count = 0
methd = "random"
[draws.keys]
a = { distribution = "norml", mean = 1 }
b = { distribution = "normal", standard_deviation = 0 }
c = { distribution = "uniform", from = 2, to = 1, component = 3 }
d = 5
[test]
time_limit_s = -1
settle_s = 60
clock = "lockstep"
[slurm]
partitoin = "x"
)"),
               {"plan.toml:4: seeds: give a seed, or a range of at most ten million in quotes, such as \"1..1000\"",
                "plan.toml:5: integrated_errors_every_s: needs integrated_errors = true",
                "plan.toml:7: axes.capture: there is no file truht.csv; did you mean \"truth.csv\"?",
                "plan.toml:8: axes.imu.imu1.rate_hz.count: give 2 to 100000 values",
                "plan.toml:8: axes.imu.imu1.rate_hz.from: a range with scale = \"log\"",
                "plan.toml:9: axes.imu.imu1.name: give a list of values, or a range",
                "plan.toml:10: axes.seed: give the seeds as seeds = ",
                "plan.toml:11: axes.imu.imu1.port: has the value a twice",
                "plan.toml:13: draws.count: give 1 to 1000000 draws",
                "plan.toml:16: draws.keys.a.distribution: there is no \"norml\"; did you mean \"normal\"?",
                "plan.toml:17: draws.keys.b.standard_deviation: 0 is out of range",
                "plan.toml:18: draws.keys.c.to: must be above from",
                "plan.toml:18: draws.keys.c.component: unknown key; did you mean \"components\"?",
                "plan.toml:19: draws.keys.d: give a table, such as ",
                "plan.toml:14: draws.methd: unknown key; did you mean \"method\"?",
                "plan.toml:20: test.command: missing",
                "plan.toml:23: test.clock: give one of \"fast\", \"realtime\"",
                "plan.toml:21: test.time_limit_s: -1 ",
                "plan.toml:22: test.settle_s: give a time before time_limit_s, 60, which counts from",
                "plan.toml:25: slurm.partitoin: unknown key; did you mean \"partition\"?",
                "plan.toml:3: seds: unknown key; did you mean \"seeds\"?"});
}

TEST_F(ReadCampaign, NeedsAConfigurationAndACapture) {
  expect_parts(faults_of_file("seeds = 3\n"),
               {"base: missing; give the configuration", "capture: missing; give the truth"});
  expect_parts(faults_of_file("base = \"imu.tom\"\ncapture = \"udp:127.0.0.1:9000\"\n"),
               {"plan.toml:1: base: there is no file imu.tom; did you mean \"imu.toml\"?",
                "plan.toml:2: capture: udp:127.0.0.1:9000: is no file"});
  expect_parts(faults_of_file("base = \"imu.toml\"\n[axes]\ncapture = [\"truth.csv\"]\n"), {});
  expect_parts(faults_of_file("base = = 3\n"), {"plan.toml:1: TOML: "});
  EXPECT_THROW(static_cast<void>(read_campaign("-")), ConfigError);
}

TEST_F(ReadCampaign, RefusesMoreCasesThanABillion) {
  const std::string range = " = { from = 1, to = 2, count = 100000 }\n";
  expect_parts(faults("[axes]\na" + range + "b" + range + "c" + range + "d" + range),
               {"plan: has 1e+20 cases (100000 a x 100000 b x 100000 c x 100000 d x 1 seeds), more "
                "than 1000000000; divide it"});
}

TEST_F(ReadCampaign, AKeyIsVariedOnce) {
  expect_parts(faults(R"([axes]
imu.imu1.rate_hz = [1, 2]
"imu.imu1.rate_hz" = [3, 4]
model = ["ideal"]
unit = [{ "imu.*.model" = "white" }]
[draws]
count = 2
[draws.keys]
"imu.imu1.rate_hz" = { distribution = "uniform", from = 1, to = 2 }
)"),
               {"plan.toml:5: axes.imu.imu1.rate_hz: is given in line 4, too; give it once",
                "plan.toml:7: axes.unit: imu.*.model is varied by axes.model, too; give it once",
                "plan.toml:8: draws.keys.imu.imu1.rate_hz: imu.imu1.rate_hz is varied by axes.imu.imu1.rate_hz, too; "
                "give it once"});
}

TEST_F(ReadCampaign, AKeyOfAnImuIsVariedOnceHoweverItIsSpelt) {
  const auto both = [&](const std::string& a, const std::string& b) {
    return faults(fmt::format("[axes]\n\"{}\" = [1, 2]\n\"{}\" = [3, 4]\n", a, b));
  };
  write("imu.toml", base + "[[imu]]\nname = \"tail.2\"\n");
  for (const auto& [a, b] : {std::pair("imu.imu1.rate_hz", "imu.0.rate_hz"),
                             {"imu.*.rate_hz", "imu.imu1.rate_hz"},
                             {"imu.tail.2.rate_hz", "imu.*.rate_hz"},
                             {"imu.1.rate_hz", "imu.tail.2.rate_hz"}})
    expect_parts(both(a, b),
                 {fmt::format("plan.toml:5: axes.{}: {} is varied by axes.{}, too; give it once", b, b, a)});
  expect_parts(both("imu.0.rate_hz", "imu.1.rate_hz"), {});
  expect_parts(both("imu.0.rate_hz", "imu.tail.2.rate_hz"), {});
  expect_parts(
      faults("[axes]\n\"imu.imu1.rate_hz\" = [1, 2]\n[draws]\ncount = 2\n[draws.keys]\n\"imu.*.rate_hz\" = { "
             "distribution = \"uniform\", from = 1, to = 2 }\n"),
      {"plan.toml:5: draws.keys.imu.*.rate_hz: imu.*.rate_hz is varied by axes.imu.imu1.rate_hz, too"});
}

TEST_F(ReadCampaign, EqualNumbersAreOneValue) {
  expect_parts(faults("[axes]\na = [1, 1.0]\nb = [[1, 2], [1.0, 2]]\nc = [1, 1.5, \"x\"]\n"
                      "d = [9007199254740992, 9007199254740993]\n"
                      "e = { from = 1, to = 1.0000000000000004, count = 9 }\n"),
               {"plan.toml:4: axes.a: has the value 1.0 twice", "plan.toml:5: axes.b: has the value [1.0, 2] twice",
                "plan.toml:8: axes.e: has the value 1 twice; give fewer values, or ends further apart"});
}

// The name of a part of a range is a key of the configuration, too.
TEST_F(ReadCampaign, AKeyCalledFromIsNoRange) {
  const Campaign campaign = read("[axes]\ntruth.from = [\"127.0.0.1\", \"127.0.0.2\"]\n");
  ASSERT_EQ(campaign.axes.size(), 1U);
  EXPECT_EQ(campaign.axes[0].name, "truth.from");
  EXPECT_EQ(texts_of(campaign.axes[0]), (Texts{"127.0.0.1", "127.0.0.2"}));
}

}  // namespace
}  // namespace imud
