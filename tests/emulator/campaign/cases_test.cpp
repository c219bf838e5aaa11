#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/emulator/campaign/campaign_test.hpp"

namespace imud {
namespace {

const std::string axes_draws_seeds = R"(seeds = "5..6"
set = ["imu.0.rate_hz=50"]
[axes]
"imu.imu1.gyro.bias_rad_per_s" = [0.1, 0.2]
"imu.imu1.gyro.max_rad_per_s" = [7, 8, 9]
[draws]
count = 4
[draws.keys]
"imu.imu1.accelerometer.max_m_per_s2" = { distribution = "uniform", from = 50, to = 100 }
)";

class CampaignCases : public CampaignFolder {};

TEST_F(CampaignCases, TheFirstAxisIsTheSlowestAndSeedsAreTheFastest) {
  const Campaign campaign = read(axes_draws_seeds);
  ASSERT_EQ(campaign.cases(), 48U);
  std::uint64_t index = 0;
  for (std::size_t a = 0; a < 2; ++a)
    for (std::size_t b = 0; b < 3; ++b)
      for (std::uint64_t draw = 0; draw < 4; ++draw)
        for (std::uint64_t seed = 5; seed <= 6; ++seed, ++index) {
          const CampaignCase c = case_of(campaign, index);
          EXPECT_EQ(c.index, index);
          EXPECT_EQ(c.at, (std::vector{a, b}));
          EXPECT_EQ(c.draw, draw);
          EXPECT_EQ(c.seed, seed);
          ASSERT_EQ(c.overrides.size(), 4U);
          EXPECT_EQ(c.overrides[0], "imu.0.rate_hz=50");
          EXPECT_EQ(c.overrides[1], fmt::format("imu.imu1.gyro.bias_rad_per_s={}", a == 0 ? 0.1 : 0.2));
          EXPECT_EQ(c.overrides[2], fmt::format("imu.imu1.gyro.max_rad_per_s={}", 7 + b));
        }
  EXPECT_THROW(static_cast<void>(case_of(campaign, 48)), std::out_of_range);
}

// In any order, and from a plan that is read again.
TEST_F(CampaignCases, AreAFunctionOfPlanAndNumber) {
  const Campaign first = read(axes_draws_seeds), second = read(axes_draws_seeds);
  for (std::uint64_t index = 48; index-- > 0;) {
    const CampaignCase a = case_of(first, index), b = case_of(second, index);
    EXPECT_EQ(a.overrides, b.overrides);
    EXPECT_EQ(columns_of(first, a), columns_of(second, b));
  }
}

// A number in the table is the number in the configuration.
TEST_F(CampaignCases, TheTableShowsWhatTheConfigurationHas) {
  const Campaign campaign = read(axes_draws_seeds);
  const CampaignCase c = case_of(campaign, 13);
  const auto columns = columns_of(campaign, c);
  ASSERT_EQ(columns.size(), 4U);
  EXPECT_EQ(columns[0], std::pair(std::string("imu.imu1.gyro.bias_rad_per_s"), std::string("0.1")));
  EXPECT_EQ(columns[1], std::pair(std::string("imu.imu1.gyro.max_rad_per_s"), std::string("8")));
  EXPECT_EQ(columns[2], std::pair(std::string("draw"), std::string("2")));
  EXPECT_EQ(columns[3].first, "imu.imu1.accelerometer.max_m_per_s2");
  const Config config = config_of(campaign, c);
  EXPECT_EQ(config.seed, 6U);
  EXPECT_EQ(config.clock, ClockMode::fast);
  EXPECT_EQ(config.imus.at(0).rate_hz, 50);
  EXPECT_EQ(config.imus.at(0).model.gyro.max, 8);
  EXPECT_EQ(config.imus.at(0).model.accelerometer.max, std::stod(columns[3].second));
}

TEST_F(CampaignCases, SeedsAreUpToTheLargest) {
  const Campaign campaign = read("seeds = \"18446744073709551614..18446744073709551615\"\n");
  EXPECT_EQ(config_of(campaign, case_of(campaign, 1)).seed, ~std::uint64_t{0});
}

TEST_F(CampaignCases, AFaultNamesTheCase) {
  const Campaign campaign = read("[axes]\nimu.imu1.rate_hz = [10, -1]\n");
  EXPECT_NO_THROW(static_cast<void>(config_of(campaign, case_of(campaign, 0))));
  try {
    static_cast<void>(config_of(campaign, case_of(campaign, 1)));
    FAIL() << "a negative rate was accepted";
  } catch (const ConfigError& error) {
    expect_parts(error.faults, {("case 1: " + path("imu.toml") + ": imu.0.rate_hz: ")});
  }
}

}  // namespace
}  // namespace imud
