// Campaigns whose processes are killed, and a campaign whose answer is known.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "emulator/campaign/shards/result_folder.hpp"
#include "emulator/campaign/shards/shard_arrays.hpp"
#include "emulator/campaign/shards/wilson.hpp"
#include "tests/emulator/campaign/campaign_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class CampaignDeaths : public CampaignWithResults {
 protected:
  // Returns the number of kills: IMUD_CAMPAIGN_KILLS, or 20.
  static int kills() {
    const char* const given = std::getenv("IMUD_CAMPAIGN_KILLS");
    return given != nullptr ? std::atoi(given) : 20;
  }
};

// Each process is killed after a time that may be anywhere in its life. A case at which two workers were killed has a
// row with an error, which the next call does again.
TEST_F(CampaignDeaths, KillsAtRandomLoseNothing) {
  write("plan.toml",
        head + "seeds = \"1..400\"\nbatch = 20\narrays = 20\n[axes]\n\"imu.imu1.rate_hz\" = [100, 200]\n");
  const std::vector<std::string> whole = {"campaign", "run", path("plan.toml"), "--into", path("whole"), "--quiet"};
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_EQ(run_program("imud", whole).exit_code, 0);
  const auto takes = std::chrono::steady_clock::now() - begin;
  std::mt19937 random(7);
  std::filesystem::create_directories(path("killed"));
  int parents = 0, workers = 0;
  bool is_new = true;
  for (int i = 0; i < kills(); ++i) {
    if (is_new) std::filesystem::remove_all(path("killed"));
    is_new = !std::filesystem::exists(path("killed/campaign.json"));
    Program program("imud");
    program.start(is_new ? std::vector<std::string>{"campaign", "run", path("plan.toml"), "--into", path("killed"),
                                                    "--jobs", "3", "--quiet"}
                         : std::vector<std::string>{"campaign", "resume", path("killed"), "--jobs", "3", "--quiet"});
    is_new = false;
    std::this_thread::sleep_for(takes * (random() % 100) / 200);
    const bool of_worker = random() % 2 != 0;
    std::vector<pid_t> children = children_of(program.pid());
    while (of_worker && children.empty() && program.is_running()) {  // a busy machine forks late
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      children = children_of(program.pid());
    }
    const bool has_worker = of_worker && !children.empty();
    if (!has_worker)
      program.kill(SIGKILL);
    else if (::kill(children[random() % children.size()], SIGKILL) == 0)
      ++workers;
    const int exit_code = program.wait();
    if (!has_worker && exit_code == 128 + SIGKILL) {
      ++parents;
      continue;
    }
    EXPECT_TRUE(exit_code == 0 || (has_worker && exit_code == 1)) << exit_code << program.errors();
    if (exit_code != 0) continue;
    EXPECT_EQ(shards("killed"), shards("whole"));
    is_new = true;
  }
  EXPECT_GT(parents, 0);
  EXPECT_GT(workers, 0);
  RecordProperty("parents", parents);
  RecordProperty("workers", workers);
  if (!std::filesystem::exists(path("killed/campaign.json"))) {
    ASSERT_EQ(run_program("imud", {"campaign", "run", path("plan.toml"), "--into", path("killed")}).exit_code, 0);
  }
  const ProgramResult last = run_program("imud", {"campaign", "resume", path("killed")});
  EXPECT_EQ(last.exit_code, 0) << last.errors;
  EXPECT_EQ(shards("killed"), shards("whole"));
}

// Whatever becomes of the file of a shard's arrays is found, and the shard is made again, or a row of it alone.
TEST_F(CampaignDeaths, ArraysThatAreDamagedAreMadeAgain) {
  plan("seeds = \"1..3\"\nbatch = 4\narrays = 15\n[axes]\n\"imu.imu1.rate_hz\" = [100, 50]\n");
  ASSERT_EQ(run("runs", {"--jobs", "1"}).exit_code, 0);
  ASSERT_EQ(run("many", {"--jobs", "4"}).exit_code, 0);
  const auto whole = shards("runs");
  EXPECT_EQ(shards("many"), whole);
  const std::string name = "000000000-000000003.rows", file = path("runs/shards/") + name, bytes = whole.at(name);
  EXPECT_EQ(bytes.size(), 4U * 15 * 128);
  EXPECT_EQ(whole.size(), 4U);  // a shard and its arrays, twice
  // 20 measurements at 100 Hz are cut to 15; 10 at 50 Hz are not.
  EXPECT_GT(rows("runs").at(0)["figures"]["imu1.rows_cut"], 0);
  EXPECT_EQ(rows("runs").at(5)["figures"]["imu1.rows_cut"], 0);
  const auto expect_repaired = [&](const std::string& said) {
    const ProgramResult done = resume("runs");
    EXPECT_EQ(done.exit_code, 0) << done.errors;
    EXPECT_TRUE(contains(done.errors, said)) << done.errors;
    EXPECT_EQ(shards("runs"), whole);
  };
  const std::string lacks = "000000000-000000003.jsonl lacks its arrays: " + name + " must have 7680 bytes";
  std::filesystem::resize_file(file, bytes.size() - 1);
  EXPECT_EQ(status("runs").exit_code, 3);
  EXPECT_TRUE(contains(status("runs").output, lacks)) << status("runs").output;
  expect_repaired(lacks);
  std::filesystem::remove(file);
  expect_repaired(lacks);
  std::ofstream(file, std::ios::binary) << bytes.substr(0, 5000) << '!' << bytes.substr(5001);
  expect_repaired("has other arrays than its footer says: " + name + " has changed");

  // A case that could not be run has no values; the others of its shard keep theirs when it is run again.
  const ResultFolder folder(path("runs"));
  std::string fault;
  Shard shard = folder.read({0, 3}, fault).value();
  nlohmann::json lost = nlohmann::json::parse(shard.rows[1]);
  lost.update({{"exit_code", 1}, {"error", "a worker process was ended by signal 9"}});
  const ShardArrays arrays(folder.shards_path(), folder.campaign().arrays);
  for (const std::uint64_t kept : {0U, 2U, 3U}) arrays.keep({0, 3}, kept);
  arrays.clear({0, 3}, 1);
  const auto digest = arrays.commit({0, 3});
  ASSERT_TRUE(digest);
  EXPECT_NE(digest, shard.arrays);
  ShardWriter writer(folder.shards_path(), shard.head);
  for (std::size_t i = 0; i < shard.rows.size(); ++i) writer.add(i == 1 ? lost.dump() : shard.rows[i]);
  ASSERT_TRUE(writer.commit(digest));
  expect_repaired("5 of 6 cases are done already");
}

TEST_F(CampaignDeaths, ArraysThatDoNotFitAreRefused) {
  plan("seeds = \"1..10000000\"\narrays = 1000000\n");
  const ProgramResult checked = run_program("imud", {"campaign", "check", path("plan.toml")});
  EXPECT_TRUE(contains(checked.output, "128 MB a case, 1.28e+06 GB for all")) << checked.output << checked.errors;
  const ProgramResult refused = run("runs");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_TRUE(contains(refused.errors, "10000000 cases write about 1.28e+09 MB")) << refused.errors;
}

// The sum of delta-angles about an axis of a gyro whose only error is an angular random walk N is normal, with the
// standard deviation N sqrt(t) (IEEE Std 952). Of n seeds, (n - 1) s^2 / sigma^2 has the distribution chi^2 of n - 1
// degrees of freedom: the bound of 5 standard errors, sqrt(1 / (2 n)) each, has a false-alarm probability of 6e-7 for
// each of three axes; so has the bound of the mean.
TEST_F(CampaignDeaths, TheIntegratedHeadingOfARandomWalkIsKnown) {
  write("plan.toml", head + "seeds = \"1..10000\"\nintegrated_errors = true\nintegrated_errors_every_s = 0.05\n");
  const ProgramResult done = run_program("imud", {"campaign", "run", path("plan.toml"), "--into", path("runs")});
  ASSERT_EQ(done.exit_code, 0) << done.errors;
  const double n = 10'000, of_a_second = 0.6 * std::numbers::pi / 180 / 60;
  const std::vector<nlohmann::json> all = rows("runs");
  ASSERT_EQ(all.size(), 10'000U);
  for (const auto& [axis, at, t_s] :
       {std::tuple("x", "", 0.2), std::tuple("y", "@0.05", 0.05), std::tuple("z", "@0.15", 0.15)}) {
    double sum = 0, squares = 0;
    for (const nlohmann::json& row : all) {
      const double error = row["figures"][fmt::format("imu1.angle_error_{}_rad{}", axis, at)].get<double>();
      sum += error;
      squares += error * error;
    }
    const double sigma = of_a_second * std::sqrt(t_s);
    const double mean = sum / n, deviation = std::sqrt((squares - sum * mean) / (n - 1));
    EXPECT_NEAR(deviation / sigma, 1, 5 * std::sqrt(1 / (2 * n))) << axis << at;
    EXPECT_NEAR(mean / sigma, 0, 5 / std::sqrt(n)) << axis << at;
  }
  EXPECT_NEAR(all[0]["figures"]["imu1.velocity_error_x_m_per_s"].get<double>(), 0, 1e-12);
}

// Rates alone are sent: they are summed over the interval, and a constant error of the rate is known.
TEST_F(CampaignDeaths, TheIntegratedErrorOfABiasIsKnown) {
  write("imu.toml", base + "gyro.bias_deg_per_s = 1\naccelerometer.bias_mg = 10\n");
  for (const std::string protocol : {"native", "csv"}) {
    write("plan.toml", head + fmt::format("integrated_errors = true\nintegrated_errors_every_s = 0.03\n"
                                          "set = [\"imu.imu1.protocol={}\"]\n",
                                          protocol));
    ASSERT_EQ(run_program("imud", {"campaign", "run", path("plan.toml"), "--into", path(protocol)}).exit_code, 0);
    const nlohmann::json figures = rows(protocol).at(0)["figures"];
    for (const char* axis : {"x", "y", "z"}) {
      EXPECT_NEAR(figures[fmt::format("imu1.angle_error_{}_rad", axis)].get<double>(), std::numbers::pi / 180 * 0.2,
                  1e-9)
          << figures;
      EXPECT_NEAR(figures[fmt::format("imu1.velocity_error_{}_m_per_s", axis)].get<double>(), 0.0980665 * 0.2, 1e-9)
          << figures;
      for (const auto& [at, t_s] : {std::pair("0.03", 0.03), std::pair("0.18", 0.18)})
        EXPECT_NEAR(figures[fmt::format("imu1.angle_error_{}_rad@{}", axis, at)].get<double>(),
                    std::numbers::pi / 180 * t_s, 1e-9);
    }
    EXPECT_FALSE(figures.contains("imu1.angle_error_x_rad@0.21"));
  }
}

// An expectation holds if its time, which begins at a uniform instant, ends before the run: with known probability.
// The number that passes is binomial; a bound of 5 standard deviations has a false-alarm probability of 6e-7.
// Wilson's interval of 95 % has the probability in it for 19 of 20 seeds of the draws, and for the default one.
TEST_F(CampaignDeaths, ThePassRateOfAKnownProbabilityIsInItsInterval) {
  write("imu.toml", base + "[[expect]]\nname = \"quiet\"\nwhat = \"host_is_silent\"\nat_s = 0\nwithin_s = 0.05\n");
  for (const double to_s : {0.2, 0.3, 1.0}) {
    write("plan.toml",
          head + fmt::format("[draws]\ncount = 4000\n[draws.keys]\n\"expect.0.at_s\" = {{ distribution = "
                             "\"uniform\", from = 0, to = {} }}\n",
                             to_s));
    const std::string folder = fmt::format("to_{}", to_s);
    ASSERT_EQ(run(folder).exit_code, 3);
    const std::vector<nlohmann::json> all = rows(folder);
    ASSERT_EQ(all.size(), 4000U);
    std::uint64_t passes = 0;
    for (const nlohmann::json& row : all) passes += row["expect"]["quiet"].get<bool>() ? 1U : 0U;
    // The run has samples to 0.2 s.
    const double p = 0.15 / to_s, n = 4000;
    EXPECT_NEAR(static_cast<double>(passes), p * n, 5 * std::sqrt(n * p * (1 - p))) << to_s;
    const Interval interval = wilson_interval(passes, all.size());
    EXPECT_LT(interval.low, p) << to_s;
    EXPECT_GT(interval.high, p) << to_s;
    EXPECT_LT(interval.high - interval.low, 0.035) << to_s;
  }
}

}  // namespace
}  // namespace imud
