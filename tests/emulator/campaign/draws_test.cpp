// The draws of campaigns: their laws, the Latin hypercube, and that each is a pure function.
#include "emulator/campaign/cases/draws.hpp"

#include <gtest/gtest.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/emulator/campaign/laws.hpp"

namespace imud {
namespace {

// Kolmogorov's statistic of 20,000 draws exceeds 2.4/sqrt(n) with probability 2 exp(-2 2.4^2) = 2e-5: 1.6e-4 for the
// eight laws, if the seed were chosen at random.
TEST(CampaignDistributions, DrawsHaveTheirLaw) {
  constexpr std::uint64_t count = 20'000;
  for (const auto& [text, cdf] : laws()) {
    const DrawnKey key("key", distribution(text), {.count = count, .seed = 1});
    std::vector<double> values;
    for (std::uint64_t i = 0; i < count; ++i) values.push_back(std::stod(key.text(i)));
    std::ranges::sort(values);
    double distance = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      const double share = cdf(values[i]);
      distance =
          std::max({distance, share - static_cast<double>(i) / count, static_cast<double>(i + 1) / count - share});
    }
    EXPECT_LT(distance, 2.4 / std::sqrt(double{count})) << text;
  }
}

// Each of n values has n draws on average: chi squared of 9 degrees of freedom exceeds 44 with probability 1.4e-6.
TEST(CampaignDistributions, WholeNumbersAndChoicesAreEquallyProbable) {
  const Distribution whole = distribution("distribution = \"uniform_integer\"\nfrom = -4\nto = 5");
  const Distribution choice =
      distribution("distribution = \"choice\"\nvalues = [0, 1, 2, 3, 4, 5, 6, 7, \"8\", 9.0]");
  constexpr std::uint64_t count = 100'000;
  std::vector<double> of_whole(10), of_choice(10);
  const DrawnKey whole_key("a", whole, {.count = count, .seed = 3}),
      choice_key("b", choice, {.count = count, .seed = 3});
  for (std::uint64_t i = 0; i < count; ++i) {
    ++of_whole.at(static_cast<std::size_t>(std::stoi(whole_key.text(i)) + 4));
    const std::string text = choice_key.text(i);
    ++of_choice.at(text == "\"8\"" ? 8 : static_cast<std::size_t>(std::stod(text)));
  }
  for (const auto& counts : {of_whole, of_choice}) {
    double chi_squared = 0;
    for (const double n : counts) chi_squared += (n - count / 10.0) * (n - count / 10.0) / (count / 10.0);
    EXPECT_LT(chi_squared, 44);
  }
}

TEST(CampaignDistributions, AListHasIndependentNumbers) {
  const DrawnKey key("key", distribution("distribution = \"uniform\"\nfrom = 0\nto = 1\ncomponents = 3"),
                     {.count = 1, .seed = 1});
  const toml::table table = toml::parse("v = " + key.text(0));
  const toml::array& list = *table["v"].as_array();
  ASSERT_EQ(list.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(list[i].value<double>(), key.share(0, i));
  EXPECT_NE(key.share(0, 0), key.share(0, 1));
  EXPECT_NE(key.share(0, 1), key.share(0, 2));
}

const std::string unit_law = "distribution = \"uniform\"\nfrom = 0\nto = 1";

TEST(CampaignDraws, AreAFunctionOfSeedKeyAndNumber) {
  const auto value = [](const std::string& key, std::uint64_t seed, std::uint64_t count, std::uint64_t draw) {
    return DrawnKey(key, distribution(unit_law), {.count = count, .seed = seed}).text(draw);
  };
  EXPECT_EQ(value("a", 7, 10, 3), value("a", 7, 1000, 3));
  EXPECT_NE(value("a", 7, 10, 3), value("b", 7, 10, 3));
  EXPECT_NE(value("a", 7, 10, 3), value("a", 8, 10, 3));
  EXPECT_NE(value("a", 7, 10, 3), value("a", 7, 10, 4));
  EXPECT_NE(value("a", 7, 10, 3), value("a", (std::uint64_t{1} << 32U) + 7, 10, 3));
  // They never change, so that a plan of today has the same cases later.
  EXPECT_EQ(value("imu.imu1.gyro.bias_rad_per_s", 7, 10, 0), "0.2613846339370297");
  EXPECT_EQ(value("imu.imu1.gyro.bias_rad_per_s", 7, 10, 1), "0.45005643531915884");
}

TEST(LatinHypercube, EachStratumHasOneDraw) {
  for (const std::uint64_t count : {1U, 2U, 3U, 10U, 1000U, 100'000U})
    for (const std::string name : {"a", "b"}) {
      const DrawnKey key(name, distribution(unit_law + "\ncomponents = 2"),
                         {.count = count, .seed = 5, .method = DrawMethod::latin_hypercube});
      for (std::size_t component = 0; component < 2; ++component) {
        std::vector<int> draws(count);
        for (std::uint64_t i = 0; i < count; ++i)
          ++draws.at(static_cast<std::size_t>(key.share(i, component) * static_cast<double>(count)));
        EXPECT_EQ(std::ranges::count(draws, 1), static_cast<std::ptrdiff_t>(count)) << name << component;
      }
    }
}

// Within its stratum a draw is uniform (Kolmogorov as above, 2e-5), and the orders of two keys, and of the numbers of
// a list, are independent: with n = 10,000 their correlation is normal with deviation 1/sqrt(n), and beyond 4.5 of
// them with probability 7e-6.
TEST(LatinHypercube, KeysAreIndependent) {
  constexpr std::uint64_t count = 10'000;
  const DrawPlan plan{.count = count, .seed = 5, .method = DrawMethod::latin_hypercube};
  const DrawnKey a("a", distribution(unit_law + "\ncomponents = 2"), plan), b("b", distribution(unit_law), plan);
  const auto correlation = [&](const auto& x, const auto& y) {
    double sum = 0;
    for (std::uint64_t i = 0; i < count; ++i) sum += (x(i) - 0.5) * (y(i) - 0.5);
    return 12 * sum / count;
  };
  const auto a0 = [&](std::uint64_t i) { return a.share(i, 0); };
  const auto a1 = [&](std::uint64_t i) { return a.share(i, 1); };
  const auto b0 = [&](std::uint64_t i) { return b.share(i, 0); };
  const auto number = [&](std::uint64_t i) { return (static_cast<double>(i) + 0.5) / count; };
  const double bound = 4.5 / std::sqrt(double{count});
  EXPECT_LT(std::abs(correlation(a0, a1)), bound);
  EXPECT_LT(std::abs(correlation(a0, b0)), bound);
  EXPECT_LT(std::abs(correlation(a0, number)), bound);
  std::vector<double> within;
  for (std::uint64_t i = 0; i < count; ++i) {
    const double at = a.share(i, 0) * count;
    within.push_back(at - std::floor(at));
  }
  std::ranges::sort(within);
  double distance = 0;
  for (std::uint64_t i = 0; i < count; ++i) distance = std::max(distance, std::abs(within[i] - number(i)));
  EXPECT_LT(distance, 2.4 / std::sqrt(double{count}));
}

// Other draws of a hypercube than those of another seed or key, but of the same strata.
TEST(LatinHypercube, IsAFunctionOfSeedKeyNumberAndCount) {
  const auto value = [](const std::string& key, std::uint64_t seed, std::uint64_t count) {
    return DrawnKey(key, distribution(unit_law),
                    {.count = count, .seed = seed, .method = DrawMethod::latin_hypercube})
        .text(3);
  };
  EXPECT_EQ(value("a", 7, 10), value("a", 7, 10));
  EXPECT_NE(value("a", 7, 10), value("b", 7, 10));
  EXPECT_NE(value("a", 7, 10), value("a", 8, 10));
  EXPECT_EQ(value("imu.imu1.gyro.bias_rad_per_s", 7, 10), "0.3092677369523905");
}

}  // namespace
}  // namespace imud
