// StopRule: when a campaign whose plan has the key `until` has enough cases.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace imud {

struct StopRule {
  std::string name;          // of an expectation, or all_cases
  double half_width = 0;     // of the interval of the pass rate, 0 to 0.5; half the distance of its bounds
  double confidence = 0.95;  // of Wilson's score interval, above 0 and below 1

  // The pass rate of whole cases: complete, and all expectations hold.
  static constexpr std::string_view all_cases = "cases";

  // Reads "NAME pass rate within 1 % at 95 %"; returns nullopt if the text is no such rule.
  static std::optional<StopRule> parse(std::string_view text);
  // Returns true if half the width of the pass rate's interval is at most `half_width`.
  bool is_met(std::uint64_t passes, std::uint64_t runs) const noexcept;
};

}  // namespace imud
