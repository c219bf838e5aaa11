#include "emulator/campaign/cases/distribution.hpp"

#include <gtest/gtest.h>
#include <toml++/toml.h>

#include "tests/emulator/campaign/expect_parts.hpp"
#include "tests/emulator/campaign/laws.hpp"

namespace imud {
namespace {

// cdf(quantile(p)) is p, in the tails, too.
TEST(CampaignDistributions, TheQuantileIsTheInverse) {
  for (const auto& [text, cdf] : laws()) {
    const Distribution law = distribution(text);
    double before = -1e300;
    for (const double p : {1e-9, 1e-6, 1e-3, 0.1, 0.3, 0.5, 0.7, 0.9, 0.999, 1 - 1e-6}) {
      const double x = law.quantile(p);
      EXPECT_NEAR(cdf(x), p, 1e-12 + 1e-9 * p) << text << " at " << p;
      EXPECT_GT(x, before) << text;
      before = x;
    }
  }
}

// The square of the width is no double.
TEST(CampaignDistributions, ATriangleMayBeWide) {
  const Distribution law = distribution("distribution = \"triangular\"\nfrom = -1e200\nmode = 0\nto = 1e200");
  EXPECT_NEAR(law.quantile(0.125) / 1e200, -0.5, 1e-12);
  EXPECT_NEAR(law.quantile(0.875) / 1e200, 0.5, 1e-12);
}

TEST(CampaignDistributions, FaultsNameTheKey) {
  const auto faults = [](const std::string& text) {
    const toml::table table = toml::parse(text);
    toml::table unused;
    Faults all("");
    TableReader reader(&table, "", 0, all, unused);
    static_cast<void>(Distribution(reader));
    return all.all();
  };
  expect_parts(faults("mean = 1"), {"distribution: missing; give one of \"normal\", "});
  expect_parts(faults("distribution = 3"), {"distribution: give text in quotes"});
  expect_parts(faults("distribution = \"normal\""), {"standard_deviation: missing"});
  expect_parts(faults("distribution = \"log_uniform\"\nfrom = 0\nto = 1"), {"from: 0 is out of "});
  expect_parts(faults("distribution = \"uniform_integer\"\nfrom = 0.5\nto = 2"),
               {"from: give whole numbers as from and to, less than 2^53 apart"});
  expect_parts(faults("distribution = \"triangular\"\nfrom = 0\nto = 2\nmode = 3"),
               {"mode: must lie between from and to"});
  expect_parts(faults("distribution = \"truncated_normal\"\nfrom = 80\nto = 90\nstandard_deviation = 1"),
               {"from: the values from here to `to` lie too far from the mean"});
  expect_parts(faults("distribution = \"choice\"\nvalues = []"), {"values: give a list of "});
}

}  // namespace
}  // namespace imud
