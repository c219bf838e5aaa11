#include "emulator/campaign/shards/sequential_stop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "emulator/campaign/shards/wilson.hpp"

namespace imud {

bool SequentialStop::count(const std::string& row) {
  const RowResult result(row);
  if (result.could_not_be_run) return false;
  if (rule_->name == StopRule::all_cases) {
    ++runs_;
    passes_ += result.exit_code == 0 ? 1 : 0;
    return true;
  }
  const auto expectations = nlohmann::json::parse(row).at("expect");
  const auto holds = expectations.find(rule_->name);
  if (holds == expectations.end()) return true;
  ++runs_;
  passes_ += *holds == true ? 1 : 0;
  return true;
}

bool SequentialStop::look() {
  while (rule_ && !has_ended_ && next_ < folder_.campaign().cases) {
    const CaseRange cases = folder_.campaign().shard_of(next_);
    std::string fault;
    if (!folder_.has(cases)) break;
    const std::optional<Shard> shard = folder_.read(cases, fault);
    if (!shard) break;
    const std::uint64_t runs = runs_, passes = passes_;
    if (!std::ranges::all_of(shard->rows, [this](const std::string& row) { return count(row); })) {
      runs_ = runs;
      passes_ = passes;
      break;
    }
    next_ = cases.last + 1;
    has_ended_ = rule_->is_met(passes_, runs_);
  }
  return has_ended_;
}

std::optional<CaseRange> SequentialStop::needed(const CaseRange& range) const noexcept {
  if (range.first >= cases()) return std::nullopt;
  return CaseRange{range.first, std::min(range.last, cases() - 1)};
}

std::string SequentialStop::text() const {
  if (!rule_) return {};
  const std::uint64_t all = folder_.campaign().cases;
  const Interval interval = wilson_interval(passes_, runs_, rule_->confidence);
  constexpr double percent = 100;
  return fmt::format("{}: {} {} of {} cases: {} of {} passed, {:.2f} to {:.2f} %", folder_.campaign().until,
                     has_ended_    ? "reached after"
                     : next_ < all ? "not yet reached after"
                                   : "not reached after",
                     next_, all, passes_, runs_, percent * interval.low, percent * interval.high);
}

}  // namespace imud
