#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <set>

#include "emulator/campaign/shards/program_build.hpp"
#include "tests/emulator/campaign/campaign_test.hpp"

namespace imud {
namespace {

class CampaignIdentity : public CampaignFolder {
 protected:
  CampaignIdentity() {
    write("fail.toml", fault);
    write("almanac.txt", "");
  }
  std::string identity(const std::string& plan, std::uint64_t index = 0) {
    const Campaign campaign = read(plan);
    return identity_of(campaign, case_of(campaign, index));
  }
  inline static const std::string fault =
      "[[fault]]\nname = \"off\"\nimu = \"imu1\"\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue = 1\nat_s = 0.1\n";
  inline static const std::string plan =
      "seeds = \"1..2\"\nscenario = \"fail.toml\"\n[axes]\nimu.imu1.gyro.bias_rad_per_s = [0.1, 0.2]\n"
      "[draws]\ncount = 2\n[draws.keys]\n\"imu.imu1.accelerometer.max_m_per_s2\" = {distribution = \"uniform\", "
      "from = 50, to = 100}\n[test]\ncommand = \"./estimator\"\n";
};

TEST_F(CampaignIdentity, EachInputChangesIt) {
  std::set<std::string> all;
  const auto is_new = [&](const std::string& identity) {
    EXPECT_EQ(identity.size(), 64U);
    return all.insert(identity).second;
  };
  for (std::uint64_t index = 0; index < 8; ++index) EXPECT_TRUE(is_new(identity(plan, index))) << index;
  EXPECT_FALSE(is_new(identity(plan, 0)));
  EXPECT_TRUE(is_new(identity(plan + "time_limit_s = 3\n")));
  EXPECT_TRUE(is_new(identity(plan + "settle_s = 1\n")));
  EXPECT_TRUE(is_new(identity(plan + "clock = \"realtime\"\n")));
  EXPECT_TRUE(is_new(identity(plan.substr(0, plan.find("[test]")) + "[test]\ncommand = \"./other\"\n")));
  EXPECT_TRUE(is_new(identity(plan.substr(0, plan.find("[test]")))));
  EXPECT_TRUE(is_new(identity("set = [\"imu.0.rate_hz=50\"]\n" + plan)));
  write("fail.toml", fault + "for_s = 0.05\n");
  EXPECT_TRUE(is_new(identity(plan)));
  write("fail.toml", fault);
  EXPECT_FALSE(is_new(identity(plan)));
  write("imu.toml", base + "gyro.lsb_rad_per_s = 0.001\n");
  EXPECT_TRUE(is_new(identity(plan)));
  write("imu.toml", base + "# a comment\n");
  EXPECT_FALSE(is_new(identity(plan)));
  write("truth.csv", truth_rows + "210000000,0,0,0,0,0,0,0,0,-9.8\n");
  EXPECT_TRUE(is_new(identity(plan)));
}

TEST_F(CampaignIdentity, TheBuildOfImudChangesIt) {
  Campaign campaign = read(plan);
  EXPECT_EQ(campaign.build, program_build());
  const std::string before = identity_of(campaign, case_of(campaign, 0));
  campaign.build += "0";
  EXPECT_NE(identity_of(campaign, case_of(campaign, 0)), before);
}

// No case opens the port of an imu, and a model is no file.
TEST_F(CampaignIdentity, PortsThatAreNotOpenedDoNotChangeIt) {
  const std::string before = identity("");
  EXPECT_EQ(identity("set = [\"imu.0.port=udp:127.0.0.1:9000\"]\n"), before);
  EXPECT_EQ(identity("set = [\"imu.0.port=file:elsewhere.bin\"]\n"), before);
  const std::filesystem::path here = std::filesystem::current_path();
  std::filesystem::current_path(folder_);
  const std::string white = identity("set = [\"imu.0.model=white\"]\n");
  write("white", "no model");
  EXPECT_EQ(identity("set = [\"imu.0.model=white\"]\n"), white);
  std::filesystem::current_path(here);
}

// A file that a key of the configuration names.
TEST_F(CampaignIdentity, AFileOfAKeyChangesIt) {
  const auto dbc = [](int scale) {
    return fmt::format("BO_ 256 RATES: 8 X\n SG_ RATE_X : 0|16@1- ({},0) [0|0] \"\" X\n", scale);
  };
  write("imu.toml", base.substr(0, base.find("protocol")) +
                        "protocol = \"dbc\"\nport = \"canfile:/dev/null\"\ndevice.dbc_file = \"a.dbc\"\n"
                        "device.signals = [\"RATE_X=rate_x_rad_per_s\"]\n"
                        "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n");
  write("a.dbc", dbc(1));
  const std::string one = identity("");
  write("a.dbc", dbc(2) + "\n");
  EXPECT_NE(identity(""), one);
}

TEST_F(CampaignIdentity, MovingTheFolderDoesNotChangeIt) {
  const std::string here = identity(plan);
  const std::string elsewhere = folder_ + "_moved";
  std::filesystem::copy(folder_, elsewhere);
  const Campaign moved = read_campaign(elsewhere + "/plan.toml");
  EXPECT_EQ(identity_of(moved, case_of(moved, 0)), here);
  std::filesystem::remove_all(elsewhere);
}

// It is not read again for each case: a file whose size and time of change stay is taken as unchanged.
TEST_F(CampaignIdentity, TheDigestOfAFileIsKept) {
  const std::string before = identity("");
  const auto time = std::filesystem::last_write_time(path("truth.csv"));
  std::string changed = truth_rows;
  changed[changed.rfind('8')] = '7';
  write("truth.csv", changed);
  std::filesystem::last_write_time(path("truth.csv"), time);
  EXPECT_EQ(identity(""), before);
  std::filesystem::last_write_time(path("truth.csv"), time + std::chrono::seconds(1));
  EXPECT_NE(identity(""), before);
}

}  // namespace
}  // namespace imud
