#include "emulator/campaign/campaign_repeat.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <atomic>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "emulator/campaign/campaign_run.hpp"
#include "emulator/campaign/case_runner.hpp"
#include "emulator/ground/text_file.hpp"
#include "transports/file/files_in_use.hpp"

namespace imud {

namespace {

// Returns the row of a case in a folder; empty if the folder does not have the row.
std::string stored_row(const ResultFolder& folder, std::uint64_t index) {
  const CaseRange cases = folder.campaign().shard_of(index);
  std::string fault;
  const std::optional<Shard> shard = folder.has(cases) ? folder.read(cases, fault) : std::nullopt;
  return shard ? shard->rows[index - cases.first] : std::string();
}

// Returns a text for each member in which two rows differ, with both values.
std::vector<std::string> differences(const std::string& there, const std::string& here) {
  using Json = nlohmann::ordered_json;
  const Json a = Json::parse(there), b = Json::parse(here);
  std::vector<std::string> all;
  for (const Json& change : Json::diff(a, b)) {
    const Json::json_pointer path(change.at("path").get<std::string>());
    const auto value = [&](const Json& row) { return row.contains(path) ? row.at(path).dump() : "absent"; };
    all.push_back(fmt::format("{} is {} there and {} here", path.to_string(), value(a), value(b)));
  }
  return all;
}

// Throws OpenError if the record would be written over a file that the case reads, or into the folder of results.
void refuse_inputs(const Config& config, const Campaign& campaign, const std::optional<ResultFolder>& folder,
                   const std::string& record) {
  FilesInUse files = config.files;
  files.add(campaign.file, "the plan");
  for (const std::string& scenario : campaign.scenarios) files.add(scenario, "a scenario");
  if (const std::string fault = files.claim(record, "the record"); !fault.empty())
    throw OpenError("--record: " + fault);
  if (folder && canonical_path(record).starts_with(canonical_path(folder->path()) + "/"))
    throw OpenError(fmt::format("--record: {}: is in the folder of results; give another file", record));
}

}  // namespace

int repeat_case(const std::string& plan_or_folder, std::uint64_t index, const std::string& record,
                const std::vector<std::string>& values) {
  std::optional<ResultFolder> folder;
  if (ResultFolder::is_at(plan_or_folder)) folder.emplace(plan_or_folder);
  Campaign campaign = folder ? campaign_of(*folder) : read_campaign(plan_or_folder);
  if (index >= campaign.cases())
    throw OpenError(
        fmt::format("{}: there is no case {}: they are 0 to {}", plan_or_folder, index, campaign.cases() - 1));
  for (const std::string& value : values) {
    const std::size_t at = value.find('=');
    if (at == value.npos) throw OpenError(fmt::format("--axis {}: give AXIS=VALUE", value));
    campaign = with_axis_value(campaign, index, value.substr(0, at), value.substr(at + 1));
  }
  const bool is_paced = campaign.test && campaign.test->clock == ClockMode::realtime;
  const bool is_compared = folder && values.empty() && !is_paced;
  const std::string there = is_compared ? stored_row(*folder, index) : std::string();
  CaseRunner runner(campaign);
  if (!record.empty()) {
    refuse_inputs(runner.prepare(case_of(campaign, index)), campaign, folder, record);
    if (record != "-") TextFile opened(record);  // it can be written
  }
  const std::atomic<bool> no_stop = false;
  const std::optional<CaseRunner::Result> here = runner.run(index, no_stop, {.record = record, .of_test = true});
  TextFile("-").write(here->row + "\n");
  if (is_compared && there.empty()) fmt::print(stderr, "case {} has no row in {} yet\n", index, plan_or_folder);
  if (there.empty() || there == here->row) return here->exit_code;
  fmt::print(stderr, "case {} differs from its row in {}: {}\n", index, plan_or_folder,
             fmt::join(differences(there, here->row), "; "));
  return 1;
}

}  // namespace imud
