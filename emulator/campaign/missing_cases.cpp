#include "emulator/campaign/missing_cases.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "emulator/campaign/campaign.hpp"
#include "emulator/ground/text_file.hpp"

namespace imud {

namespace {

// Throws OpenError if the present identity of a case differs from `there`, the identity in the row of the case.
void check_identity(const std::string& there, std::uint64_t index, const Campaign& campaign) {
  const std::string here = identity_of(campaign, case_of(campaign, index));
  if (there != here)
    throw OpenError(
        fmt::format("case {}: the plan is the same, but its configuration or a file that it names has changed since: "
                    "the identity is {} there and {} here; give another folder",
                    index, there, here));
}

// Returns the fault of a shard if a row is not JSON; empty if all rows are. ResultFolder::read() has checked only the
// part of each row that says how the case has ended.
std::string fault_of_rows(const Shard& shard) {
  const auto damaged =
      std::ranges::find_if_not(shard.rows, [](const std::string& row) { return nlohmann::json::accept(row); });
  return damaged == shard.rows.end()
             ? std::string()
             : no_result_in_row_of(shard.head.cases.first + static_cast<std::uint64_t>(damaged - shard.rows.begin()));
}

// Moves the shards at which another process is at work behind the others.
void put_last(std::vector<ShardToWrite>& shards, const std::vector<CaseRange>& at_work) {
  std::stable_partition(shards.begin(), shards.end(), [&](const ShardToWrite& shard) {
    return std::ranges::find(at_work, shard.cases) == at_work.end();
  });
}

}  // namespace

MissingCases::MissingCases(const ResultFolder& folder, const CaseRange& range, const Campaign& campaign) {
  constexpr std::uint64_t most_logged = 10;
  std::uint64_t damaged = 0;
  for (std::uint64_t first = range.first; first <= range.last;) {
    const CaseRange cases = folder.campaign().shard_of(first);
    first = cases.last + 1;
    if (!folder.has(cases)) {
      shards_.push_back({.cases = cases});
      continue;
    }
    std::string fault;
    std::optional<Shard> shard = folder.read(cases, fault);
    if (shard) fault = fault_of_rows(*shard);
    if (shard && fault.empty()) fault = folder.fault_of_arrays(*shard);
    if (!fault.empty()) shard.reset();
    if (!shard) {
      if (++damaged <= most_logged) spdlog::warn("{} {}: its cases are run again", shard_name(cases), fault);
      shards_.push_back({.cases = cases, .replaces = true});
      continue;
    }
    ShardToWrite again{.cases = cases, .replaces = true};
    std::optional<std::uint64_t> checked;  // the last group of cases, equal but for the seed, that was checked
    for (std::uint64_t index = cases.first; index <= cases.last; ++index) {
      const std::string& row = shard->rows[index - cases.first];
      const RowResult result(row);
      if (result.could_not_be_run) {
        again.to_run.push_back(index);
        continue;
      }
      const std::uint64_t group = index / campaign.seeds.size();
      if (checked != group) check_identity(nlohmann::json::parse(row).at("identity"), index, campaign);
      checked = group;
      ++kept_.rows;
      kept_.bytes += row.size() + 1;
      kept_.tally.add(result);
    }
    if (!again.to_run.empty()) shards_.push_back(std::move(again));
  }
  if (range.size() == campaign.cases()) put_last(shards_, folder.at_work());
  for (ShardToWrite& shard : shards_) {
    shard.before = items_;
    items_ += shard.items();
  }
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
