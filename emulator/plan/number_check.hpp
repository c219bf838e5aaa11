// number_check: checks a number of a command line against its limits, and refuses NaN.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <string>

namespace imud {

inline CLI::Validator number_check(double min, double max) {
  return CLI::Validator(
      [min, max](std::string& text) -> std::string {
        double number = 0;
        if (CLI::detail::lexical_cast(text, number) && number >= min && number <= max) return {};
        return fmt::format("{}: right would be a number from {} to {}", text, min, max);
      },
      "");
}

}  // namespace imud
