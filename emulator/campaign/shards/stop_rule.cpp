#include "emulator/campaign/shards/stop_rule.hpp"

#include "core/numbers/number_text.hpp"
#include "emulator/campaign/shards/wilson.hpp"

namespace imud {

namespace {

// Takes "NUMBER %" from the end of `text`, and `before` in front of it. Returns the number as a share.
std::optional<double> take_percent(std::string_view& text, std::string_view before) {
  constexpr std::string_view unit = "%";
  const std::size_t at = text.rfind(before);
  if (at == text.npos || !text.ends_with(unit)) return std::nullopt;
  std::string_view number = text.substr(at + before.size());
  number.remove_suffix(unit.size());
  while (number.ends_with(' ')) number.remove_suffix(1);
  text = text.substr(0, at);
  const std::optional<double> percent = number_in<double>(number);
  return percent ? std::optional(*percent / 100) : std::nullopt;
}

}  // namespace

std::optional<StopRule> StopRule::parse(std::string_view text) {
  const auto confidence = take_percent(text, " at ");
  const auto half_width = take_percent(text, " pass rate within ");
  if (!confidence || !half_width || text.empty()) return std::nullopt;
  const bool is_possible = *half_width > 0 && *half_width < 0.5 && *confidence > 0 && *confidence < 1;
  return is_possible ? std::optional(StopRule{std::string(text), *half_width, *confidence}) : std::nullopt;
}

bool StopRule::is_met(std::uint64_t passes, std::uint64_t runs) const noexcept {
  const Interval interval = wilson_interval(passes, runs, confidence);
  return runs > 0 && (interval.high - interval.low) / 2 <= half_width;
}

}  // namespace imud
