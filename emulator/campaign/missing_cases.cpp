#include "emulator/campaign/missing_cases.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "emulator/campaign/case_runner.hpp"
#include "emulator/ground/text_file.hpp"

namespace imud {

namespace {

// Throws OpenError if the configuration of a case is not the one that its row comes from.
void check_identity(const std::string& row, std::uint64_t index, const Campaign& campaign, CaseRunner& runner) {
  const std::string there = nlohmann::json::parse(row).at("identity");
  const std::string here = identity_of(campaign, runner.prepare(case_of(campaign, index)));
  if (there != here)
    throw OpenError(
        fmt::format("case {}: the plan is the same, but its configuration or a file that it names has changed since: "
                    "the identity is {} there and {} here; give another folder",
                    index, there, here));
}

}  // namespace

MissingCases::MissingCases(const ResultFolder& folder, const CaseRange& range, const Campaign& campaign,
                           CaseRunner& runner) {
  constexpr std::uint64_t most_logged = 10;
  std::uint64_t damaged = 0;
  for (std::uint64_t first = range.first; first <= range.last;) {
    const CaseRange cases = folder.campaign().shard_of(first);
    first = cases.last + 1;
    if (!folder.has(cases)) {
      add({.cases = cases});
      continue;
    }
    std::string fault;
    std::optional<Shard> shard = folder.read(cases, fault);
    if (!shard) {
      if (++damaged <= most_logged) spdlog::warn("{} {}: its cases are run again", shard_name(cases), fault);
      add({.cases = cases, .replaces = true});
      continue;
    }
    ShardToWrite again{.cases = cases, .replaces = true};
    for (std::uint64_t i = 0; i < cases.size(); ++i) {
      if (RowResult(shard->rows[i]).could_not_be_run)
        again.to_run.push_back(cases.first + i);
      else
        again.kept.emplace(cases.first + i, std::move(shard->rows[i]));
    }
    if (!again.kept.empty()) check_identity(again.kept.begin()->second, again.kept.begin()->first, campaign, runner);
    if (!again.to_run.empty()) add(std::move(again));
  }
}

void MissingCases::add(ShardToWrite shard) {
  shard.before = items_;
  items_ += shard.items();
  shards_.push_back(std::move(shard));
}

std::size_t MissingCases::shard_of(std::uint64_t item) const noexcept {
  const auto after = std::ranges::upper_bound(shards_, item, {}, &ShardToWrite::before);
  return static_cast<std::size_t>(after - shards_.begin()) - 1;
}

std::uint64_t MissingCases::case_of(std::uint64_t item) const noexcept {
  const ShardToWrite& shard = shards_[shard_of(item)];
  return shard.case_of_item(item - shard.before);
}

}  // namespace imud
