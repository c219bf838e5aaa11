// Shared by the tests of campaigns: a folder with a configuration, a capture, and plans.
#pragma once

#include <string>
#include <vector>

#include "emulator/campaign/campaign.hpp"
#include "tests/emulator/campaign/expect_parts.hpp"
#include "tests/emulator/run/run_test.hpp"

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

}  // namespace imud
