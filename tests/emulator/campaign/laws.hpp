// Distributions as a plan has them, beside their distribution functions.
#pragma once

#include <gtest/gtest.h>
#include <toml++/toml.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "emulator/campaign/cases/distribution.hpp"

namespace imud {

inline Distribution distribution(const std::string& text) {
  const toml::table table = toml::parse(text);
  toml::table unused;
  Faults faults("");
  TableReader reader(&table, "", 0, faults, unused);
  Distribution made(reader);
  EXPECT_TRUE(faults.all().empty()) << text;
  return made;
}

inline double cdf_of_normal(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }

struct Law {
  std::string text;
  std::function<double(double)> cdf;  // written independently of the quantile function
};

inline std::vector<Law> laws() {
  // Shares of a normal distribution between two bounds.
  const auto truncated = [](double mean, double sigma, double from, double to) {
    return [=](double x) {
      // The upper tail is counted from above, where it is exact.
      const auto above = [&](double y) { return 0.5 * std::erfc((y - mean) / sigma / std::sqrt(2.0)); };
      return (above(from) - above(x)) / (above(from) - above(to));
    };
  };
  return {
      {"distribution = \"normal\"\nmean = 3\nstandard_deviation = 2",
       [](double x) { return cdf_of_normal((x - 3) / 2); }},
      {"distribution = \"truncated_normal\"\nmean = 3\nstandard_deviation = 2\nfrom = 0\nto = 4",
       truncated(3, 2, 0, 4)},
      {"distribution = \"truncated_normal\"\nstandard_deviation = 1\nfrom = 8\nto = 9", truncated(0, 1, 8, 9)},
      {"distribution = \"log_normal\"\nmedian = 5\nstandard_deviation_of_log = 0.5",
       [](double x) { return cdf_of_normal(std::log(x / 5) / 0.5); }},
      {"distribution = \"uniform\"\nfrom = -1\nto = 4", [](double x) { return (x + 1) / 5; }},
      {"distribution = \"log_uniform\"\nfrom = 1e-3\nto = 10",
       [](double x) { return std::log(x / 1e-3) / std::log(1e4); }},
      {"distribution = \"exponential\"\nmean = 2", [](double x) { return 1 - std::exp(-x / 2); }},
      {"distribution = \"triangular\"\nfrom = 1\nmode = 2\nto = 5",
       [](double x) { return x < 2 ? (x - 1) * (x - 1) / 4 : 1 - (5 - x) * (5 - x) / 12; }},
  };
}

}  // namespace imud
