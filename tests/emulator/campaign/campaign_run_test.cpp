// Campaigns on this machine: rows that do not depend on who made them, and folders that survive what happens to them.
#include "emulator/campaign/campaign_run.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <csignal>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"
#include "tests/emulator/campaign/campaign_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class CampaignRuns : public CampaignWithResults {
 protected:
  // 24 cases of 3 rates and 8 seeds, in shards of 4.
  std::string small_plan() const {
    return plan("seeds = \"1..8\"\nbatch = 4\n[axes]\n\"imu.imu1.rate_hz\" = [50, 100, 200]\n");
  }
  std::string shard_path(const std::string& folder, const CaseRange& cases) const {
    return path(folder) + "/shards/" + shard_name(cases);
  }
};

std::string sha256_of(const std::string& bytes) {
  Sha256Stream digest(false);
  digest.add(bytes);
  return digest.end();
}

TEST_F(CampaignRuns, TheRowOfACaseIsTheSummaryAndTheBytesOfAReplay) {
  write("imu.toml", base + R"(gyro.angle_random_walk_deg_per_rt_hr = 0.6
[[imu]]
name = "can1"
rate_hz = 100
protocol = "native-can"
port = "canfile:never.log"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 100
)");
  write("scenario.toml",
        "[[fault]]\nname = \"off\"\nimu = \"imu1\"\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue = 1\nat_s = 0.1\n");
  plan("seeds = \"3..4\"\n[axes]\nscenario = [\"\", \"scenario.toml\"]\n\"imu.imu1.rate_hz\" = [100, 200]\n");
  const ProgramResult done = run("runs", {"--jobs", "1"});
  ASSERT_EQ(done.exit_code, 0) << done.errors;
  const std::vector<nlohmann::json> all = rows("runs");
  ASSERT_EQ(all.size(), 8U);
  for (std::uint64_t i = 0; i < all.size(); ++i) {
    const nlohmann::json& row = all[i];
    SCOPED_TRACE(row.dump());
    EXPECT_EQ(row["case"], i);
    EXPECT_EQ(row["seed"], 3 + i % 2);
    const std::string rate = i / 2 % 2 == 0 ? "100" : "200", scenario = i < 4 ? "" : "scenario.toml";
    EXPECT_EQ(row["axes"], nlohmann::json({{"scenario", scenario}, {"imu.imu1.rate_hz", rate}}));
    std::vector<std::string> arguments = {"replay", path("imu.toml"), path("truth.csv"),
                                          "--fast", "--summary",      path("summary.json")};
    for (const std::string& key : {"seed=" + row["seed"].dump(), "imu.imu1.rate_hz=" + rate,
                                   "imu.imu1.port=file:" + path("1.bin"), "imu.can1.port=canfile:" + path("2.log")})
      arguments.insert(arguments.end(), {"--set", key});
    if (!scenario.empty()) arguments.insert(arguments.end(), {"--scenario", path(scenario)});
    ASSERT_EQ(run_program("imud", arguments).exit_code, 0);
    EXPECT_GT(read_file(path("1.bin")).size(), 100U);
    EXPECT_EQ(row["digest"]["imu1"], sha256_of(read_file(path("1.bin"))));
    EXPECT_GT(read_file(path("2.log")).size(), 100U);
    EXPECT_EQ(row["digest"]["can1"], sha256_of(read_file(path("2.log"))));
    const nlohmann::json whole = summary();
    EXPECT_EQ(row["exit_code"], whole["exit_code"]);
    EXPECT_EQ(row["ended_by"], whole["ended_by"]);
    EXPECT_EQ(row["shortfalls"], whole["shortfalls"]);
    EXPECT_EQ(row["figures"]["simulated_s"], whole["simulated_s"]);
    EXPECT_EQ(row["error"], nullptr);
    std::size_t compared = 0;
    for (const auto& [name, value] : row["figures"].items()) {
      const std::size_t dot = name.find('.');
      if (dot == name.npos || name == "truth.refused") continue;
      const std::string group = name.substr(0, dot), key = name.substr(dot + 1);
      const nlohmann::json& of = group == "truth" ? whole["truth"] : whole["imus"][group == "imu1" ? 0 : 1];
      EXPECT_EQ(value, of.at(key)) << name;
      ++compared;
    }
    EXPECT_GT(compared, 10U);
  }
  EXPECT_NE(all[0]["digest"], all[1]["digest"]);
  EXPECT_NE(all[0]["identity"], all[1]["identity"]);
  EXPECT_NE(all[0]["identity"], all[2]["identity"]);
  EXPECT_NE(all[0]["identity"], all[4]["identity"]);
}

TEST_F(CampaignRuns, RowsDoNotDependOnProcessesAndPieces) {
  small_plan();
  ASSERT_EQ(run("one", {"--jobs", "1"}).exit_code, 0);
  ASSERT_EQ(run("four", {"--jobs", "4"}).exit_code, 0);
  for (const char* piece : {"20..23", "4..11", "0..3", "12..19"}) {
    const ProgramResult done = run("pieces", {"--case", piece, "--jobs", "2"});
    ASSERT_EQ(done.exit_code, 0) << done.errors;
  }
  const auto one = shards("one");
  ASSERT_EQ(one.size(), 6U);
  EXPECT_EQ(shards("four"), one);
  EXPECT_EQ(shards("pieces"), one);
  EXPECT_EQ(read_file(path("one/plan.toml")), read_file(path("plan.toml")));
  EXPECT_EQ(nlohmann::json::parse(read_file(path("one/campaign.json"))),
            nlohmann::json({{"campaign", 1},
                            {"plan", path("plan.toml")},
                            {"plan_from_folder", "../plan.toml"},
                            {"plan_sha256", sha256_of(read_file(path("plan.toml")))},
                            {"cases", 24},
                            {"batch", 4},
                            {"version", IMUD_VERSION},
                            {"build", build_of("one")}}));
}

TEST_F(CampaignRuns, ConfigurationsOfOtherSeedsAreThoseOfThePlan) {
  small_plan();
  ASSERT_EQ(run("runs", {"--jobs", "1"}).exit_code, 0);
  const Campaign campaign = campaign_by_imud("runs");
  for (const nlohmann::json& row : rows("runs"))
    EXPECT_EQ(row["identity"], identity_of(campaign, case_of(campaign, row["case"]))) << row["case"];
}

TEST_F(CampaignRuns, TwoAtTheSameTimeDoTheSame) {
  small_plan();
  ASSERT_EQ(run("one").exit_code, 0);
  Program a("imud"), b("imud");
  const std::vector<std::string> arguments = {"campaign", "run", path("plan.toml"), "--into", path("both"),
                                              "--jobs",   "2",   "--quiet"};
  a.start(arguments);
  b.start(arguments);
  EXPECT_EQ(a.wait(), 0);
  EXPECT_EQ(b.wait(), 0);
  EXPECT_EQ(shards("both"), shards("one"));
}

TEST_F(CampaignRuns, DamagedShardsAreSaidAndDoneAgain) {
  small_plan();
  ASSERT_EQ(run("runs").exit_code, 0);
  const auto whole = shards("runs");
  const std::string cut = whole.at(shard_name({4, 7})), other = whole.at(shard_name({8, 11}));
  write("runs/shards/" + shard_name({4, 7}), cut.substr(0, cut.size() / 2));
  write("runs/shards/" + shard_name({8, 11}), "garbage\n");
  write("runs/shards/" + shard_name({12, 15}), other);
  std::filesystem::remove(shard_path("runs", {20, 23}));
  const ProgramResult before = status("runs", {"--json"});
  EXPECT_EQ(before.exit_code, 3);
  const nlohmann::json json = nlohmann::json::parse(before.output);
  EXPECT_EQ(json["shards"], 6);
  EXPECT_EQ(json["shards_whole"], 2);
  EXPECT_EQ(json["cases_done"], 8);
  EXPECT_EQ(json["damaged"].size(), 3U) << json["damaged"];
  const ProgramResult done = resume("runs");
  EXPECT_EQ(done.exit_code, 0) << done.errors;
  EXPECT_TRUE(contains(done.errors, shard_name({4, 7}) + " is cut short after ")) << done.errors;
  EXPECT_TRUE(contains(done.errors, shard_name({8, 11}) + " has no header of a shard")) << done.errors;
  EXPECT_TRUE(contains(done.errors, shard_name({12, 15}) + " has the header of the cases 8..11")) << done.errors;
  EXPECT_TRUE(contains(done.errors, "8 of 24 cases are done already")) << done.errors;
  EXPECT_EQ(shards("runs"), whole);
  EXPECT_EQ(status("runs").exit_code, 0);
  EXPECT_TRUE(contains(resume("runs").output, " 0 cases, 0 shards"));
}

TEST_F(CampaignRuns, CasesThatCouldNotBeRunAreRunAgainAlone) {
  small_plan();
  ASSERT_EQ(run("runs").exit_code, 0);
  const auto whole = shards("runs");
  std::string fault;
  const ResultFolder folder(path("runs"));
  Shard shard = folder.read({8, 11}, fault).value();
  nlohmann::json row = nlohmann::json::parse(shard.rows[2]);
  row["exit_code"] = 1;
  row["error"] = "a worker process was ended by signal 9";
  shard.rows[2] = row.dump();
  ShardWriter writer(folder.shards_path(), shard.head);
  for (const std::string& one : shard.rows) writer.add(one);
  writer.commit();
  const ProgramResult before = status("runs");
  EXPECT_EQ(before.exit_code, 3);
  EXPECT_TRUE(contains(before.output, "cases    23 of 24 done; 1 could not be run")) << before.output;
  const ProgramResult done = resume("runs");
  EXPECT_EQ(done.exit_code, 0) << done.errors;
  EXPECT_TRUE(contains(done.output, " 1 cases, 1 shards")) << done.output;
  EXPECT_EQ(shards("runs"), whole);
}

TEST_F(CampaignRuns, ACaseThatCannotBeRunHasARow) {
  plan("seeds = 1\nbatch = 3\n[axes]\n\"imu.imu1.rate_hz\" = [100, -5, 200]\n");
  const ProgramResult done = run("runs");
  EXPECT_EQ(done.exit_code, 1);
  const std::vector<nlohmann::json> all = rows("runs");
  ASSERT_EQ(all.size(), 3U);
  EXPECT_EQ(all[0]["error"], nullptr);
  EXPECT_TRUE(contains(all[1]["error"].get<std::string>(), "rate_hz")) << all[1];
  EXPECT_EQ(all[1]["exit_code"], 1);
  EXPECT_EQ(all[2]["error"], nullptr);
  EXPECT_TRUE(contains(done.errors, "case 1: ")) << done.errors;
}

TEST_F(CampaignRuns, WhatCannotBeDoneIsRefusedBeforeTheStart) {
  small_plan();
  const auto refused = [](const ProgramResult& result, const std::string& text) {
    EXPECT_EQ(result.exit_code, 2) << result.errors;
    EXPECT_TRUE(contains(result.errors, text)) << result.errors;
  };
  refused(run("runs", {"--case", "2..5"}), "--case 2..5: a shard has 4 cases");
  refused(run("runs", {"--case", "20..27"}), "the campaign has the cases 0..23");
  refused(run_program("imud", {"campaign", "run", path("plan.toml"), "--into", "/proc/imud"}), "/proc/imud");
  refused(run_program("imud", {"campaign", "status", path("none")}), "is no folder of a campaign");
  EXPECT_FALSE(std::filesystem::exists(path("runs")));
  plan("seeds = \"1..10000000\"\n[axes]\n\"imu.imu1.gyro.bias_deg_per_s\" = {from = 0, to = 1, count = 100}\n");
  refused(run("runs"), "1000000000 cases write about ");
  EXPECT_FALSE(std::filesystem::exists(path("runs")));
}

TEST_F(CampaignRuns, AFolderOfSomethingElseIsRefused) {
  small_plan();
  ASSERT_EQ(run("runs", {"--case", "0..3"}).exit_code, 0);
  const auto refused = [](const ProgramResult& result, const std::string& text) {
    EXPECT_EQ(result.exit_code, 2) << result.errors;
    EXPECT_TRUE(contains(result.errors, text)) << result.errors;
  };
  // The same plan with another capture.
  std::string changed = truth_rows;
  changed.replace(changed.rfind("9.8"), 3, "9.7");
  write("truth.csv", changed);
  refused(resume("runs"), "case 0: the plan is the same, but its configuration or a file that it names has changed");
  write("truth.csv", truth_rows);
  // Another plan.
  plan("seeds = \"1..9\"\nbatch = 4\n[axes]\n\"imu.imu1.rate_hz\" = [50, 100, 200]\n");
  refused(resume("runs"), "line 3 of the plan is `seeds = \"1..8\"` there and `seeds = \"1..9\"` here");
  refused(run("runs"), "line 3 of the plan");
  // Another version.
  small_plan();
  nlohmann::json json = nlohmann::json::parse(read_file(path("runs/campaign.json")));
  json["version"] = "0.0.9";
  write("runs/campaign.json", json.dump());
  refused(resume("runs"), "imud is 0.0.9 there and " IMUD_VERSION " here");
}

TEST_F(CampaignRuns, TemporaryFilesOfEndedProcessesAreTakenAway) {
  small_plan();
  ASSERT_EQ(run("runs", {"--case", "0..3"}).exit_code, 0);
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  TemporaryFile ended("000000004-000000007"), elsewhere("000000008-000000011");
  ended.process = child;
  elsewhere.host = "n2.example";
  elsewhere.process = child;
  write("runs/shards/" + ended.file_name(), "{");
  write("runs/shards/" + elsewhere.file_name(), "{");
  const nlohmann::json running = nlohmann::json::parse(status("runs", {"--json"}).output)["running"];
  EXPECT_EQ(running, nlohmann::json::array({{{"host", "n2.example"}, {"process", child}}}));
  EXPECT_EQ(resume("runs").exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(path("runs/shards/" + ended.file_name())));
  EXPECT_TRUE(std::filesystem::exists(path("runs/shards/" + elsewhere.file_name())));
}

TEST_F(CampaignRuns, TheRecordOfACaseTakesNoOtherFilesPlace) {
  small_plan();
  ASSERT_EQ(run("runs", {"--case", "0..3"}).exit_code, 0);
  const std::string shard = path("runs/shards/000000000-000000003.jsonl");
  for (const auto& [file, why] :
       std::map<std::string, std::string>{{path("truth.csv"), "is "},
                                          {path("plan.toml"), "is the plan"},
                                          {path("imu.toml"), "is the file of the configuration"},
                                          {shard, "is in the folder of results"},
                                          {path("none/5.pcapng"), "cannot be written"}}) {
    const std::string before = std::filesystem::exists(file) ? read_file(file) : "";
    const ProgramResult refused = run_program("imud", {"campaign", "repeat", path("runs"), "1", "--record", file});
    EXPECT_EQ(refused.exit_code, 2) << file;
    EXPECT_EQ(refused.output, "");
    EXPECT_TRUE(contains(refused.errors, why)) << refused.errors;
    EXPECT_EQ(std::filesystem::exists(file) ? read_file(file) : "", before);
  }
}

TEST_F(CampaignRuns, ACaseIsRepeatedAlone) {
  small_plan();
  ASSERT_EQ(run("runs", {"--case", "0..7"}).exit_code, 0);
  const ProgramResult same =
      run_program("imud", {"campaign", "repeat", path("runs"), "5", "--record", path("5.pcapng")});
  EXPECT_EQ(same.exit_code, 0) << same.errors;
  EXPECT_EQ(nlohmann::json::parse(same.output), rows("runs")[5]);
  // The record is of this case.
  const ProgramResult again = run_program(
      "imud", {"replay", path("5.pcapng"), path("5.pcapng"), "--fast", "--set", "imu.0.port=file:" + path("5.bin")});
  EXPECT_EQ(again.exit_code, 0) << again.errors;
  EXPECT_EQ(sha256_of(read_file(path("5.bin"))), rows("runs")[5]["digest"]["imu1"]);
  const ProgramResult of_plan = run_program("imud", {"campaign", "repeat", path("plan.toml"), "5"});
  EXPECT_EQ(of_plan.output, same.output);
  const ProgramResult absent = run_program("imud", {"campaign", "repeat", path("runs"), "23"});
  EXPECT_EQ(absent.exit_code, 0);
  EXPECT_TRUE(contains(absent.errors, "case 23 has no row")) << absent.errors;
  EXPECT_EQ(run_program("imud", {"campaign", "repeat", path("runs"), "24"}).exit_code, 2);
  // A stored row that is not the row of the case.
  const ResultFolder folder(path("runs"));
  std::string fault;
  Shard shard = folder.read({4, 7}, fault).value();
  std::swap(shard.rows[0], shard.rows[1]);
  ShardWriter writer(folder.shards_path(), shard.head);
  for (const std::string& one : shard.rows) writer.add(one);
  writer.commit();
  const ProgramResult differs = run_program("imud", {"campaign", "repeat", path("runs"), "5"});
  EXPECT_EQ(differs.exit_code, 1);
  EXPECT_TRUE(contains(differs.errors, "/digest/imu1 is ")) << differs.errors;
}

TEST_F(CampaignRuns, ASignalEndsTheOpenCases) {
  plan("seeds = \"1..200000\"\nbatch = 10\n");
  Program program("imud");
  program.start({"campaign", "run", path("plan.toml"), "--into", path("runs"), "--jobs", "2"});
  while (!std::filesystem::exists(shard_path("runs", {50, 59}))) ASSERT_TRUE(program.is_running());
  program.kill(SIGTERM);
  EXPECT_EQ(program.wait(), 3) << program.errors();
  EXPECT_TRUE(contains(program.errors(), "incomplete: it was ended after ")) << program.errors();
  for (const auto& [name, text] : shards("runs")) EXPECT_TRUE(cases_of_shard(name)) << name;
}

}  // namespace
}  // namespace imud
