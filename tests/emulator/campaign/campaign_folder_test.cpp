// Folders of campaigns whose files change, move or are damaged, and what is said of cases that were done before.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "emulator/campaign/campaign_run.hpp"
#include "emulator/campaign/case_runner.hpp"
#include "emulator/campaign/missing_cases.hpp"
#include "emulator/campaign/status/campaign_status.hpp"
#include "emulator/ground/text_file.hpp"
#include "tests/emulator/campaign/campaign_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class CampaignFolders : public CampaignWithResults {
 protected:
  // The capture of another flight, as long as truth_rows.
  static std::string other_truth() {
    std::string text = truth_rows;
    text.replace(text.rfind("9.8"), 3, "9.7");
    return text;
  }
  std::vector<std::string> names(const std::string& folder) const {
    std::vector<std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(path(folder) + "/shards"))
      all.push_back(entry.path().filename().string());
    return all;
  }
  // Changes a row of a shard, whose footer is right again.
  void change_row(const std::string& folder, const CaseRange& cases, std::size_t number,
                  const std::function<std::string(const std::string&)>& change) const {
    const ResultFolder results(path(folder));
    std::string fault;
    Shard shard = results.read(cases, fault).value();
    shard.rows[number] = change(shard.rows[number]);
    ShardWriter writer(results.shards_path(), shard.head);
    for (const std::string& one : shard.rows) writer.add(one);
    writer.commit();
  }
  static std::string lost(const std::string& row) {
    nlohmann::json json = nlohmann::json::parse(row);
    json["exit_code"] = 1;
    json["ended_by"] = "failure";
    json["error"] = "a worker process was ended by signal 9";
    return json.dump();
  }
};

void expect_refused(const ProgramResult& result, const std::string& text) {
  EXPECT_EQ(result.exit_code, 2) << result.errors;
  EXPECT_TRUE(contains(result.errors, text)) << result.errors;
}

TEST_F(CampaignFolders, ACaseHasTheCaptureOfItsIdentity) {
  const std::atomic<bool> no_stop = false;
  const auto alone = [&](const Campaign& campaign, std::uint64_t index) {
    return CaseRunner(campaign).run(index, no_stop, {})->row;
  };
  const Campaign campaign = read("seeds = \"1..2\"\n[axes]\nimu.imu1.rate_hz = [100, 200]\n");
  CaseRunner runner(campaign);
  const std::string before = runner.run(0, no_stop, {})->row;
  write("truth.csv", other_truth() + "210000000,0,0,0,0,0,0,0,0,-9.8\n");
  // Another seed of the same case may have been run on either capture, with the identity of that capture.
  const std::string second = nlohmann::json::parse(runner.run(1, no_stop, {})->row)["identity"];
  EXPECT_NE(second, nlohmann::json::parse(alone(campaign, 1))["identity"]);
  EXPECT_EQ(runner.run(2, no_stop, {})->row, alone(campaign, 2));
  EXPECT_EQ(runner.run(0, no_stop, {})->row, alone(campaign, 0));
  EXPECT_NE(before, alone(campaign, 0));
}

TEST_F(CampaignFolders, EachConfigurationOfAShardIsCompared) {
  write("other.csv", truth_rows);
  plan("seeds = \"1..2\"\nbatch = 4\n[axes]\ncapture = [\"truth.csv\", \"other.csv\"]\n");
  ASSERT_EQ(run("runs").exit_code, 0);
  write("other.csv", other_truth());
  expect_refused(resume("runs"), "case 2: the plan is the same, but its configuration or a file that it names");
  write("other.csv", truth_rows);
  EXPECT_EQ(resume("runs").exit_code, 0);
}

TEST_F(CampaignFolders, RowsThatStayAreReadWhenTheirShardBegins) {
  plan("seeds = \"1..8\"\nbatch = 4\n");
  ASSERT_EQ(run("runs").exit_code, 0);
  const std::string whole = read_file(path("runs/shards/") + shard_name({4, 7}));
  change_row("runs", {4, 7}, 0, lost);
  change_row("runs", {4, 7}, 3, lost);
  const ResultFolder folder(path("runs"));
  const MissingCases missing(folder, {0, 7}, campaign_by_imud("runs"));
  ASSERT_EQ(missing.items(), 2U);
  EXPECT_EQ(missing.case_of(0), 4U);
  EXPECT_EQ(missing.case_of(1), 7U);
  EXPECT_EQ(missing.shards().at(0).kept(), 2U);
  EXPECT_EQ(missing.kept().rows, 6U);
  EXPECT_EQ(resume("runs").exit_code, 0);
  EXPECT_EQ(read_file(path("runs/shards/") + shard_name({4, 7})), whole);
}

// A campaign that does not fit is refused, as no shard of it is there yet.
TEST_F(CampaignFolders, WhatDoesNotFitIsNotResumed) {
  plan("seeds = 1\n");
  ASSERT_EQ(run("one").exit_code, 0);
  plan(
      "seeds = \"1..10000000\"\nbatch = 1000000\n[axes]\nimu.imu1.gyro.bias_deg_per_s = {from = 0, to = 1, count = "
      "100}\n");
  open_result_folder(path("runs"), campaign_by_imud("one"));
  expect_refused(resume("runs"), "1000000000 cases write about ");
}

TEST_F(CampaignFolders, CasesOfShardsThatAreLostAreNotCounted) {
  plan("seeds = \"1..200000\"\nbatch = 997\n");
  Program program("imud");
  program.start({"campaign", "run", path("plan.toml"), "--into", path("runs"), "--jobs", "2"});
  while (!std::filesystem::exists(path("runs/shards/") + shard_name({997, 1993}))) ASSERT_TRUE(program.is_running());
  program.kill(SIGTERM);
  EXPECT_EQ(program.wait(), 3) << program.errors();
  const std::size_t stored = 997 * names("runs").size();
  EXPECT_TRUE(contains(program.errors(), fmt::format("incomplete: it was ended after {} of 200000 cases; ", stored)))
      << stored << program.errors();
}

TEST_F(CampaignFolders, CasesThatHaveFailedBeforeCount) {
  plan("seeds = \"1..8\"\nbatch = 4\n");
  ASSERT_EQ(run("runs", {"--case", "0..3"}).exit_code, 0);
  change_row("runs", {0, 3}, 1, [](const std::string& row) {
    nlohmann::json json = nlohmann::json::parse(row);
    json["exit_code"] = 3;
    json["expect"]["never"] = false;
    return json.dump();
  });
  for (const ProgramResult& done : {run("runs"), run("runs"), resume("runs")}) {
    EXPECT_EQ(done.exit_code, 3) << done.errors;
    EXPECT_TRUE(contains(done.output, "0 could not be run, 1 incomplete or with failed expectations")) << done.output;
  }
  const ProgramResult shown = status("runs", {"--json"});
  EXPECT_EQ(shown.exit_code, 3);
  EXPECT_EQ(nlohmann::json::parse(shown.output)["cases_done"], 8);
  EXPECT_EQ(nlohmann::json::parse(shown.output)["expectations_failed"], 1);
}

TEST_F(CampaignFolders, APlanThatWasMovedWithItsFolderIsFound) {
  std::filesystem::create_directory(path("here"));
  for (const char* name : {"truth.csv", "imu.toml"}) std::filesystem::copy(path(name), path("here/") + name);
  write("here/plan.toml", head + "seeds = \"1..8\"\nbatch = 4\n");
  const std::vector<std::string> first = {"campaign", "run", path("here/plan.toml"), "--into", path("here/runs"),
                                          "--case",   "0..3"};
  ASSERT_EQ(run_program("imud", first).exit_code, 0);
  std::filesystem::rename(path("here"), path("there"));
  const ProgramResult done = resume("there/runs");
  EXPECT_EQ(done.exit_code, 0) << done.errors;
  EXPECT_EQ(run_program("imud", {"campaign", "repeat", path("there/runs"), "2"}).exit_code, 0);
  // At another place than with the folder.
  std::filesystem::rename(path("there/plan.toml"), path("plan.toml"));
  expect_refused(resume("there/runs"),
                 fmt::format("its plan is not at {}, nor at {}; imud campaign run PLAN --into {} takes it",
                             path("here/plan.toml"), path("there/plan.toml"), path("there/runs")));
  EXPECT_EQ(run("there/runs").exit_code, 0);
}

TEST_F(CampaignFolders, TheCopyOfThePlanIsWrittenAgain) {
  plan("seeds = \"1..4\"\nbatch = 4\n");
  ASSERT_EQ(run("runs").exit_code, 0);
  std::filesystem::remove(path("runs/plan.toml"));
  ASSERT_EQ(resume("runs").exit_code, 0);
  EXPECT_EQ(read_file(path("runs/plan.toml")), read_file(path("plan.toml")));
  std::filesystem::remove(path("runs/plan.toml"));
  plan("seeds = \"1..5\"\nbatch = 4\n");
  expect_refused(resume("runs"), "the plan is another one (" + path("runs/plan.toml") + " is missing there)");
}

TEST_F(CampaignFolders, ARowWithoutAResultIsDamage) {
  plan("seeds = \"1..8\"\nbatch = 4\n");
  ASSERT_EQ(run("runs").exit_code, 0);
  for (const char* row : {"no JSON", "[]", "{\"exit_code\":0}", R"({"exit_code":0,"ended_by":"none","axes":{)"}) {
    change_row("runs", {4, 7}, 2, [&](const std::string&) { return row; });
    const ProgramResult shown = status("runs", {"--json"});
    EXPECT_EQ(shown.exit_code, 3) << shown.errors;
    EXPECT_EQ(nlohmann::json::parse(shown.output)["damaged"],
              nlohmann::json::array({shard_name({4, 7}) + " has no result in the row of case 6"}));
    EXPECT_EQ(resume("runs").exit_code, 0);
    EXPECT_EQ(status("runs").exit_code, 0);
  }
}

TEST_F(CampaignFolders, NumbersAndNamesThatNoCaseHasAreRefused) {
  plan("seeds = \"1..4\"\n");
  const ProgramResult negative = run_program("imud", {"campaign", "repeat", path("plan.toml"), "-1"});
  EXPECT_EQ(negative.exit_code, 2);
  EXPECT_FALSE(contains(negative.errors, "18446744073709551615")) << negative.errors;
  const std::string latin1 =
      "d\xe9"
      "part";
  std::filesystem::create_directory(path(latin1));
  for (const char* name : {"truth.csv", "imu.toml", "plan.toml"})
    std::filesystem::copy(path(name), path(latin1 + "/" + name));
  expect_refused(run_program("imud", {"campaign", "run", path(latin1 + "/plan.toml"), "--into", path("runs")}),
                 "its path must be UTF-8, as the results have it; rename the folder");
}

TEST_F(CampaignFolders, TheRateIsOfThePresentWork) {
  using namespace std::chrono_literals;
  plan("seeds = \"1..8\"\nbatch = 1\n");
  ASSERT_EQ(run("runs").exit_code, 0);
  const auto now = std::filesystem::file_time_type::clock::now();
  for (std::uint64_t i = 0; i < 8; ++i)
    std::filesystem::last_write_time(path("runs/shards/") + shard_name({i, i}),
                                     (i < 4 ? now - 24h : now) + static_cast<int>(i) * 10s);
  EXPECT_NEAR(nlohmann::json::parse(status("runs", {"--json"}).output)["cases_per_s"].get<double>(), 0.1, 1e-6);
}

// The case that could not be run was run again. Reading stops after one shard here.
TEST_F(CampaignFolders, AReplacedShardAloneIsCountedAgain) {
  plan("seeds = \"1..12\"\nbatch = 4\n");
  ASSERT_EQ(run("runs").exit_code, 0);
  change_row("runs", {4, 7}, 1, lost);
  CampaignStatus shown(path("runs"));
  EXPECT_TRUE(shown.update());
  EXPECT_EQ(shown.json()["cases_done"], 11);
  EXPECT_EQ(shown.json()["failed"], 1);
  ASSERT_EQ(resume("runs").exit_code, 0);
  EXPECT_TRUE(shown.update(0));
  EXPECT_EQ(shown.json()["cases_done"], 12);
  EXPECT_EQ(shown.json()["failed"], 0);
  EXPECT_TRUE(shown.is_good());
}

// The time of a shard at work is the time of its last written row.
TEST_F(CampaignFolders, FilesOfDeadHostsAreTakenAwayAfterADay) {
  using namespace std::chrono_literals;
  plan("seeds = \"1..12\"\nbatch = 4\n");
  ASSERT_EQ(run("runs", {"--case", "0..3"}).exit_code, 0);
  const auto temporary = [&](const char* name, std::chrono::hours age) {
    TemporaryFile file(name);
    file.host = "n2.example";
    const std::string at = write("runs/shards/" + file.file_name(), "{");
    std::filesystem::last_write_time(at, std::filesystem::file_time_type::clock::now() - age);
    return at;
  };
  const std::string of_whole = temporary("000000000-000000003", 1h), old = temporary("000000004-000000007", 25h),
                    young = temporary("000000008-000000011", 23h);
  const nlohmann::json running = nlohmann::json::parse(status("runs", {"--json"}).output)["running"];
  EXPECT_EQ(running.size(), 1U) << running;
  ASSERT_EQ(run("runs", {"--case", "4..7"}).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(old)) << "a task of an array does not list the folder";
  ASSERT_EQ(run("runs").exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(of_whole));
  EXPECT_FALSE(std::filesystem::exists(old));
  EXPECT_TRUE(std::filesystem::exists(young));
  EXPECT_EQ(nlohmann::json::parse(status("runs", {"--json"}).output)["running"], nlohmann::json::array());
}

// Cases that wait for a file of the test: a case C has begun when the file begun_C is there, and ends when go_C is.
class CampaignsAtWork : public CampaignFolders {
 protected:
  void plan_of_waiting_cases(const std::string& division) const {
    plan(division + R"([test]
time_limit_s = 600
command = "echo {case} >> cases; touch begun_{case}; until test -e go_{case}; do sleep 0.02; done; cat {port} > /dev/null; test {seed} != 2"
)");
  }
  void start(Program& program) const {
    program.start({"campaign", "run", path("plan.toml"), "--into", path("runs"), "--jobs", "1", "--quiet"});
  }
  void await(Program& program, const std::function<bool()>& holds) const {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!holds()) {
      ASSERT_TRUE(program.is_running()) << program.errors();
      ASSERT_LT(std::chrono::steady_clock::now(), limit);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  void await_case(Program& program, int number) const {
    await(program, [&] { return std::filesystem::exists(path(fmt::format("begun_{}", number))); });
  }
  void let_go(int number) const { write(fmt::format("go_{}", number), ""); }
  // Returns the file into which a run writes, once it has it open.
  std::string open_file(pid_t process) const {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(fmt::format("/proc/{}/fd", process), error))
      if (const std::string at = std::filesystem::read_symlink(entry.path(), error).string();
          at.starts_with(path("runs/shards/")) && at.ends_with(".tmp"))
        return at;
    return {};
  }
};

TEST_F(CampaignsAtWork, AreSeenFromTheirFirstCaseOnAndStayYoung) {
  using namespace std::chrono_literals;
  plan_of_waiting_cases("seeds = 1\nbatch = 1\n");
  Program program("imud");
  start(program);
  ASSERT_NO_FATAL_FAILURE(await_case(program, 0));
  const nlohmann::json running = nlohmann::json::parse(status("runs", {"--json"}).output)["running"];
  ASSERT_EQ(running.size(), 1U);
  EXPECT_EQ(running[0]["process"], program.pid());
  ASSERT_EQ(names("runs").size(), 1U);
  const std::string file = path("runs/shards/") + names("runs").front();
  const auto now = std::filesystem::file_time_type::clock::now();
  std::filesystem::last_write_time(file, now - 25h);
  ASSERT_NO_FATAL_FAILURE(await(program, [&] { return std::filesystem::last_write_time(file) > now - 1h; }));
  let_go(0);
  EXPECT_EQ(program.wait(), 0) << program.errors();
  EXPECT_EQ(names("runs"), std::vector<std::string>{shard_name({0, 0})});
}

TEST_F(CampaignsAtWork, AreDividedAmongTwoRuns) {
  plan_of_waiting_cases("seeds = \"1..4\"\nbatch = 1\n");
  Program a("imud"), b("imud");
  start(a);
  ASSERT_NO_FATAL_FAILURE(await_case(a, 0));
  start(b);
  ASSERT_NO_FATAL_FAILURE(await_case(b, 1));
  let_go(0);
  ASSERT_NO_FATAL_FAILURE(await_case(a, 2));
  let_go(1);
  ASSERT_NO_FATAL_FAILURE(await_case(b, 3));
  let_go(3);  // the last one of b, which comes back to case 2: that is still missing
  ASSERT_NO_FATAL_FAILURE(await(b, [&] { return read_file(path("cases")) == "0\n1\n2\n3\n2\n"; }));
  let_go(2);
  // Case 1, of the seed 2, fails. a has not run it.
  for (Program* program : {&a, &b}) {
    EXPECT_EQ(program->wait(), 3) << program->errors();
    EXPECT_TRUE(contains(program->output(), "0 could not be run, 1 incomplete or with failed expectations"))
        << program->output();
  }
  EXPECT_EQ(rows("runs").size(), 4U);
  EXPECT_EQ(names("runs").size(), 4U);
}

// In step they would do 60 cases. Each does some shards at the end at which the other is still at work.
TEST_F(CampaignsAtWork, AreNotDoneInStep) {
  plan(R"(seeds = "1..30"
batch = 1
[test]
command = "echo {case} >> cases; cat {port} > /dev/null; sleep 0.05"
)");
  Program a("imud"), b("imud");
  start(a);
  start(b);
  for (Program* program : {&a, &b}) EXPECT_EQ(program->wait(), 0) << program->errors();
  EXPECT_LT(lines_of(read_file(path("cases"))).size(), 45U);
  EXPECT_EQ(names("runs").size(), 30U);
}

TEST_F(CampaignsAtWork, AShardWhoseFileIsRemovedIsDoneAgain) {
  plan_of_waiting_cases("seeds = \"3..4\"\nbatch = 2\n");
  Program program("imud");
  start(program);
  let_go(0);
  ASSERT_NO_FATAL_FAILURE(await_case(program, 1));
  ASSERT_NO_FATAL_FAILURE(await(program, [&] { return !open_file(program.pid()).empty(); }));
  ASSERT_TRUE(std::filesystem::remove(open_file(program.pid())));
  let_go(1);
  EXPECT_EQ(program.wait(), 0) << program.errors();
  EXPECT_TRUE(contains(program.errors(), "was removed while it was written: its cases are run again"))
      << program.errors();
  EXPECT_EQ(names("runs"), std::vector<std::string>{shard_name({0, 1})});
  EXPECT_EQ(read_file(path("cases")), "0\n1\n0\n1\n");
}

// A worker that is ended has no row yet.
TEST_F(CampaignsAtWork, LeaveNoFileWhenASignalEndsThem) {
  plan_of_waiting_cases("seeds = \"3..4\"\nbatch = 1\n");
  Program program("imud");
  start(program);
  ASSERT_NO_FATAL_FAILURE(await_case(program, 0));
  program.kill(SIGTERM);
  EXPECT_EQ(program.wait(), 3) << program.errors();
  EXPECT_EQ(names("runs"), std::vector<std::string>());
}

TEST_F(CampaignFolders, ShardsAtWhichOthersAreAtWorkComeLast) {
  const Campaign campaign = read_campaign(plan("seeds = \"1..12\"\nbatch = 4\n"));
  const ResultFolder folder = open_result_folder(path("runs"), campaign);
  ShardWriter other(folder.shards_path(), folder.campaign().head({0, 3}));
  const MissingCases missing(folder, {0, 11}, campaign);
  ASSERT_EQ(missing.items(), 12U);
  EXPECT_EQ(missing.case_of(0), 4U);
  EXPECT_EQ(missing.case_of(7), 11U);
  EXPECT_EQ(missing.case_of(8), 0U);
}

}  // namespace
}  // namespace imud
