#include "emulator/campaign/campaign_status.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "emulator/campaign/shards/program_build.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/ground/text_file.hpp"

namespace imud {

namespace {

// The end of a shard, and how many cases it has.
struct ShardEnd {
  std::filesystem::file_time_type time;
  std::uint64_t cases = 0;
};

// Returns the time that the missing cases take at the rate of the newest shards; nullopt if fewer than two are whole.
std::optional<double> time_left_s(std::vector<ShardEnd> ends, std::uint64_t missing) {
  constexpr std::size_t newest = 20;
  std::ranges::sort(ends, {}, &ShardEnd::time);
  if (ends.size() > newest) ends.erase(ends.begin(), ends.end() - newest);
  if (ends.size() < 2) return std::nullopt;
  std::uint64_t cases = 0;
  for (std::size_t i = 1; i < ends.size(); ++i) cases += ends[i].cases;
  const std::chrono::duration<double> span = ends.back().time - ends.front().time;
  return span.count() * static_cast<double>(missing) / static_cast<double>(cases);
}

std::string difference_of_this_imud(const CampaignDescription& campaign) {
  return campaign.difference_of_imud(IMUD_VERSION, program_build());
}

nlohmann::ordered_json json_of(const CampaignStatus& status, const CampaignDescription& campaign) {
  nlohmann::ordered_json json = {{"plan", campaign.plan},
                                 {"version", campaign.version},
                                 {"build", campaign.build},
                                 {"is_of_this_imud", difference_of_this_imud(campaign).empty()},
                                 {"cases", campaign.cases},
                                 {"cases_done", status.cases_done},
                                 {"failed", status.failed},
                                 {"expectations_failed", status.expectations_failed},
                                 {"incomplete", status.incomplete},
                                 {"batch", campaign.batch},
                                 {"shards", status.shards},
                                 {"shards_whole", status.shards_whole},
                                 {"damaged", status.damaged},
                                 {"running", nlohmann::ordered_json::array()},
                                 {"left_s", nullptr}};
  for (const TemporaryFile& file : status.running)
    json["running"].push_back({{"host", file.host}, {"process", file.process}});
  if (status.left_s) json["left_s"] = *status.left_s;
  return json;
}

std::string text_of(const CampaignStatus& status, const CampaignDescription& campaign) {
  std::string text = fmt::format(
      "plan     {}\nshards   {} of {} whole\ncases    {} of {} done; {} could not be run, {} with failed "
      "expectations, {} otherwise incomplete\n",
      campaign.plan, status.shards_whole, status.shards, status.cases_done, campaign.cases, status.failed,
      status.expectations_failed, status.incomplete);
  if (const std::string difference = difference_of_this_imud(campaign); !difference.empty())
    text += fmt::format("imud     {}: go on with that imud, or run the plan into another folder\n", difference);
  for (const std::string& damaged : status.damaged) text += fmt::format("damaged  {}\n", damaged);
  for (const TemporaryFile& file : status.running)
    text += fmt::format("running  process {} of {}, cases {}\n", file.process, file.host, file.name);
  if (status.left_s) text += fmt::format("left     {}\n", time_left(*status.left_s, 0.5));
  return text;
}

}  // namespace

CampaignStatus status_of(const ResultFolder& folder) {
  CampaignStatus status;
  status.shards = folder.campaign().shards();
  std::vector<ShardEnd> ends;
  const ResultFolder::Listing listing = folder.list();
  for (const CaseRange& cases : listing.shards) {
    std::string fault;
    const std::optional<Shard> shard = folder.read(cases, fault);
    if (!shard) {
      status.damaged.push_back(fmt::format("{} {}", shard_name(cases), fault));
      continue;
    }
    ++status.shards_whole;
    std::error_code error;
    ends.push_back({std::filesystem::last_write_time(folder.shards_path() / shard_name(cases), error), cases.size()});
    for (const std::string& row : shard->rows) {
      const RowResult result(row);
      if (result.could_not_be_run)
        ++status.failed;
      else if (result.expectation_failed)
        ++status.expectations_failed;
      else if (result.exit_code != 0)
        ++status.incomplete;
      if (!result.could_not_be_run) ++status.cases_done;
    }
  }
  for (const auto& [file, cases] : listing.temporaries) status.running.push_back(file);
  const std::uint64_t missing = folder.campaign().cases - status.cases_done;
  if (!status.running.empty() && missing > 0) status.left_s = time_left_s(std::move(ends), missing);
  return status;
}

int campaign_status(const std::string& path, bool as_json) {
  const ResultFolder folder(path);
  const CampaignStatus status = status_of(folder);
  TextFile("-").write(as_json ? json_of(status, folder.campaign()).dump(1) + "\n"
                              : text_of(status, folder.campaign()));
  const bool is_good =
      status.cases_done == folder.campaign().cases && status.expectations_failed == 0 && status.incomplete == 0;
  return is_good ? 0 : 3;
}

}  // namespace imud
