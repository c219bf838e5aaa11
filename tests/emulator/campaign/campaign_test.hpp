// Shared by the tests of campaigns: a folder with a configuration, a capture, and plans.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "emulator/campaign/campaign.hpp"
#include "emulator/campaign/shards/result_folder.hpp"
#include "tests/emulator/campaign/expect_parts.hpp"
#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"

namespace imud {

class CampaignFolder : public RunTest {
 protected:
  CampaignFolder() {
    write("truth.csv", truth_rows);
    write("imu.toml", base);
  }
  Campaign read(const std::string& plan) const { return read_campaign(write("plan.toml", head + plan)); }
  // Returns the faults of a plan, without the folder in them; none if it is right.
  std::vector<std::string> faults(const std::string& plan) const { return faults_of_file(head + plan); }
  std::vector<std::string> faults_of_file(const std::string& text) const {
    try {
      static_cast<void>(read_campaign(write("plan.toml", text)));
      return {};
    } catch (const ConfigError& error) {
      return without_folder(error.faults);
    }
  }
  std::vector<std::string> without_folder(std::vector<std::string> texts) const {
    for (std::string& text : texts)
      for (std::size_t at = 0; (at = text.find(folder_ + "/")) != text.npos;) text.erase(at, folder_.size() + 1);
    return texts;
  }

  // Two lines, so that those of a test begin at line 3.
  inline static const std::string head = "base = \"imu.toml\"\ncapture = \"truth.csv\"\n";
  inline static const std::string base = R"([truth]
port = "file:none.csv"
format = "csv"
[[imu]]
name = "imu1"
rate_hz = 100
protocol = "native"
port = "file:/dev/null"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 100
)";
  // 0.2 s at rest.
  inline static const std::string truth_rows = [] {
    std::string text =
        "time_ns,sigma_BN_1,sigma_BN_2,sigma_BN_3,omega_BN_B_x,omega_BN_B_y,omega_BN_B_z,"
        "nonConservativeAccelpntB_B_x,nonConservativeAccelpntB_B_y,nonConservativeAccelpntB_B_z\n";
    for (int i = 0; i <= 20; ++i) text += fmt::format("{}0000000,0,0,0,0,0,0,0,0,-9.8\n", i);
    return text;
  }();
};

// A campaign that runs: `plan.toml` in the folder, whose results are in other folders.
class CampaignWithResults : public CampaignFolder {
 protected:
  // Noise, so that each seed has its own bytes.
  CampaignWithResults() { write("imu.toml", base + "gyro.angle_random_walk_deg_per_rt_hr = 0.6\n"); }

  std::string plan(const std::string& more) const { return write("plan.toml", head + more); }
  ProgramResult run(const std::string& folder, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"campaign", "run", path("plan.toml"), "--into", path(folder)});
    return run_program("imud", more);
  }
  ProgramResult resume(const std::string& folder) const {
    return run_program("imud", {"campaign", "resume", path(folder), "--jobs", "2"});
  }
  ProgramResult status(const std::string& folder, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"campaign", "status", path(folder)});
    return run_program("imud", more);
  }
  // build_of() returns the build of the imud that has run a folder. campaign_by_imud() returns the plan as this imud
  // reads it: the imud is another program than the test.
  std::string build_of(const std::string& folder) const { return ResultFolder(path(folder)).campaign().build; }
  Campaign campaign_by_imud(const std::string& folder) const {
    Campaign campaign = read_campaign(path("plan.toml"));
    campaign.build = build_of(folder);
    return campaign;
  }
  // Returns the content of each file of the shards by its name.
  std::map<std::string, std::string> shards(const std::string& folder) const {
    std::map<std::string, std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(path(folder) + "/shards"))
      all[entry.path().filename().string()] = read_file(entry.path().string());
    return all;
  }
  std::vector<nlohmann::json> rows(const std::string& folder) const {
    std::vector<nlohmann::json> all;
    for (const auto& [name, text] : shards(folder)) {
      if (!name.ends_with(".jsonl")) continue;
      const std::vector<std::string> lines = lines_of(text);
      for (std::size_t i = 1; i + 1 < lines.size(); ++i) all.push_back(nlohmann::json::parse(lines[i]));
    }
    return all;
  }
};

inline std::vector<pid_t> children_of(pid_t process) {
  std::ifstream file(fmt::format("/proc/{0}/task/{0}/children", process));
  std::vector<pid_t> all;
  for (pid_t child = 0; file >> child;) all.push_back(child);
  return all;
}

}  // namespace imud
