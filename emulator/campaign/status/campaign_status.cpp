#include "emulator/campaign/status/campaign_status.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "emulator/campaign/shards/program_build.hpp"
#include "emulator/campaign/shards/wilson.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/ground/text_file.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

std::string difference_of_this_imud(const CampaignDescription& campaign) {
  return campaign.difference_of_imud(IMUD_VERSION, program_build());
}

nlohmann::ordered_json json_of(const CaseRate& rate) {
  nlohmann::ordered_json json = {{"runs", rate.runs}, {"passes", rate.passes}};
  const Interval interval = wilson_interval(rate.passes, rate.runs);
  json["wilson_95"] = {interval.low, interval.high};
  return json;
}

std::string text_of(const CaseRate& rate) {
  const Interval interval = wilson_interval(rate.passes, rate.runs);
  const double share = rate.runs == 0 ? 0 : static_cast<double>(rate.passes) / static_cast<double>(rate.runs);
  return fmt::format("{} of {}, {:.2f} % ({:.2f} to {:.2f} %)", rate.passes, rate.runs, 100 * share,
                     100 * interval.low, 100 * interval.high);
}

}  // namespace

bool CampaignStatus::update(double limit_s) {
  const HostTime begin = host_now();
  ResultFolder::Listing listing = folder_.list();
  running_.clear();
  for (auto& [file, cases] : listing.temporaries) running_.push_back(std::move(file));
  if (stop_.look())  // the shards behind the end do not count
    std::erase_if(listing.shards, [this](const CaseRange& cases) { return cases.first >= stop_.cases(); });
  present_ = listing.shards.size();
  const auto time_of = [this](const CaseRange& cases) {
    std::error_code error;
    return std::filesystem::last_write_time(folder_.shards_path() / shard_name(cases), error);
  };
  bool is_reset = false;
  for (auto seen = seen_.begin(); seen != seen_.end();) {
    const auto shard = std::ranges::lower_bound(listing.shards, seen->first, {}, &CaseRange::first);
    const bool is_there = shard != listing.shards.end() && shard->first == seen->first;
    if (is_there && (seen->second.counts || !seen->second.fault.empty() || time_of(*shard) == seen->second.time)) {
      ++seen;
      continue;
    }
    is_reset = is_reset || (!seen->second.counts && seen->second.fault.empty());
    seen = seen_.erase(seen);
  }
  if (is_reset) {  // a shard that nobody replaces has changed
    seen_.clear();
    lasting_ = {};
  }
  bool is_first = true, is_all = true;
  for (const CaseRange& cases : listing.shards) {
    const auto time = time_of(cases);
    if (const auto seen = seen_.find(cases.first); seen != seen_.end() && seen->second.time == time) continue;
    if (!std::exchange(is_first, false) && seconds(host_now() - begin) > limit_s) {
      is_all = false;
      break;
    }
    SeenShard shard{.time = time, .cases = cases.size(), .fault = {}, .counts = {}};
    if (const std::optional<Shard> read = folder_.read(cases, shard.fault)) try {
        CaseCounts counts;
        counts.add(*read);
        if (counts.tally.could_not_be_run > 0)
          shard.counts = std::move(counts);
        else
          lasting_.add(counts);
      } catch (const std::runtime_error& error) {
        shard.fault = error.what();
      }
    seen_.insert_or_assign(cases.first, std::move(shard));
  }
  counts_ = lasting_;
  for (const auto& [first, shard] : seen_)
    if (shard.counts) counts_.add(*shard.counts);
  return is_all;
}

bool CampaignStatus::is_good() const noexcept {
  return counts_.done == stop_.cases() && counts_.tally.expectations_failed == 0 && counts_.tally.incomplete == 0;
}

std::uint64_t CampaignStatus::whole() const noexcept {
  return static_cast<std::uint64_t>(
      std::ranges::count_if(seen_, [](const auto& shard) { return shard.second.fault.empty(); }));
}

std::vector<std::string> CampaignStatus::damaged() const {
  std::vector<std::string> all;
  for (const auto& [first, shard] : seen_)
    if (!shard.fault.empty())
      all.push_back(fmt::format("{} {}", shard_name(folder_.campaign().shard_of(first)), shard.fault));
  return all;
}

// By the times of the newest shards of the present work; nullopt if fewer than two are whole.
std::optional<double> CampaignStatus::cases_per_s() const {
  using Ends = std::vector<const SeenShard*>;
  // The work was taken up again where nothing has ended for a minute and for ten times the median of such times.
  const auto begin_of_work = [](const Ends& all) {
    constexpr double least_s = 60, many = 10;
    std::vector<double> gaps_s;
    for (std::size_t i = 1; i < all.size(); ++i)
      gaps_s.push_back(std::chrono::duration<double>(all[i]->time - all[i - 1]->time).count());
    std::vector<double> sorted = gaps_s;
    std::ranges::sort(sorted);
    std::size_t begin = 0;
    for (std::size_t i = 0; i < gaps_s.size(); ++i)
      if (gaps_s[i] > std::max(least_s, many * sorted[(sorted.size() - 1) / 2])) begin = i + 1;
    return all.begin() + static_cast<std::ptrdiff_t>(begin);
  };
  constexpr std::size_t newest = 20;
  std::vector<const SeenShard*> ends;
  for (const auto& [first, shard] : seen_)
    if (shard.fault.empty()) ends.push_back(&shard);
  std::ranges::sort(ends, {}, [](const SeenShard* shard) { return shard->time; });
  if (ends.size() > newest) ends.erase(ends.begin(), ends.end() - newest);
  ends.erase(ends.begin(), begin_of_work(ends));
  if (ends.size() < 2) return std::nullopt;
  std::uint64_t cases = 0;
  for (std::size_t i = 1; i < ends.size(); ++i) cases += ends[i]->cases;
  const std::chrono::duration<double> span = ends.back()->time - ends.front()->time;
  return span.count() > 0 ? std::optional(static_cast<double>(cases) / span.count()) : std::nullopt;
}

std::optional<double> CampaignStatus::left_s() const {
  const std::uint64_t missing = stop_.cases() - counts_.done;
  const std::optional<double> rate = cases_per_s();
  if (running_.empty() || missing == 0 || !rate) return std::nullopt;
  return static_cast<double>(missing) / *rate;
}

nlohmann::ordered_json CampaignStatus::json() const {
  using Json = nlohmann::ordered_json;
  const CampaignDescription& campaign = folder_.campaign();
  const std::string difference = difference_of_this_imud(campaign);
  const std::optional<double> rate = cases_per_s(), left = left_s();
  Json json = {{"plan", campaign.plan},
               {"version", campaign.version},
               {"build", campaign.build},
               {"is_of_this_imud", difference.empty()},
               {"difference_of_imud", difference},
               {"cases", stop_.cases()},
               {"until", stop_.text()},
               {"cases_done", counts_.done},
               {"failed", counts_.tally.could_not_be_run},
               {"expectations_failed", counts_.tally.expectations_failed},
               {"incomplete", counts_.tally.incomplete},
               {"batch", campaign.batch},
               {"shards", shards()},
               {"shards_whole", whole()},
               {"shards_present", present_},
               {"shards_read", seen_.size()},
               {"damaged", damaged()},
               {"running", Json::array()},
               {"cases_per_s", rate ? Json(*rate) : Json()},
               {"left_s", left ? Json(*left) : Json()},
               {"left", left ? Json(rough_time(*left)) : Json()},
               {"resume", folder_.resume_command()},
               {"rates", Json::array()},
               {"axes", Json::array()},
               {"failed_cases", Json::array()}};
  for (const TemporaryFile& file : running_)
    json["running"].push_back({{"host", file.host}, {"process", file.process}});
  for (std::size_t i = 0; i < counts_.names().size(); ++i) {
    json["rates"].push_back({{"name", counts_.names()[i]}});
    json["rates"].back().update(json_of(counts_.rates()[i]));
  }
  for (const CaseCounts::Axis& axis : counts_.axes()) {
    Json values = Json::array();
    for (const CaseCounts::Value& value : axis.values) {
      Json rates = Json::array();
      for (std::size_t i = 0; i < counts_.names().size(); ++i)
        rates.push_back(json_of(i < value.rates.size() ? value.rates[i] : CaseRate()));
      values.push_back({{"value", value.text}, {"rates", std::move(rates)}});
    }
    json["axes"].push_back({{"name", axis.name}, {"is_divided", axis.is_divided}, {"values", std::move(values)}});
  }
  for (const auto& [index, failed] : counts_.failed())
    json["failed_cases"].push_back({{"case", index},
                                    {"seed", failed.seed},
                                    {"axes", failed.axes},
                                    {"why", failed.why},
                                    {"repeat", folder_.repeat_command(index)}});
  return json;
}

std::string CampaignStatus::text() const {
  constexpr std::size_t most_listed = 10;
  const CampaignDescription& campaign = folder_.campaign();
  std::string text = fmt::format(
      "plan     {}\nshards   {} of {} whole\ncases    {} of {} done; {} could not be run, {} with failed "
      "expectations, {} otherwise incomplete\n",
      campaign.plan, whole(), shards(), counts_.done, stop_.cases(), counts_.tally.could_not_be_run,
      counts_.tally.expectations_failed, counts_.tally.incomplete);
  for (std::size_t i = 0; i < counts_.names().size() && counts_.done > 0; ++i)
    text += fmt::format("passed   {}: {}\n", counts_.names()[i], text_of(counts_.rates()[i]));
  if (const std::string until = stop_.text(); !until.empty()) text += fmt::format("until    {}\n", until);
  if (const std::string difference = difference_of_this_imud(campaign); !difference.empty())
    text += fmt::format("build    {}: go on with that imud, or run the plan into another folder\n", difference);
  for (const std::string& one : damaged()) text += fmt::format("damaged  {}\n", one);
  std::size_t listed = 0;
  for (const auto& [index, failed] : counts_.failed()) {
    if (++listed > most_listed) break;
    text += fmt::format("failed   case {}: seed {}{}{}: {}\n         {}\n", index, failed.seed,
                        failed.axes.empty() ? "" : ", ", failed.axes, failed.why, folder_.repeat_command(index));
  }
  if (listed > most_listed) text += "failed   and others: imud campaign report lists as many as its --count\n";
  for (const TemporaryFile& file : running_)
    text += fmt::format("running  process {} of {}, cases {}\n", file.process, file.host, file.name);
  if (const auto rate = cases_per_s(); rate && !running_.empty())
    text += fmt::format("rate     {:.3g} cases/s\n", *rate);
  if (const auto left = left_s()) text += fmt::format("left     {}\n", rough_time(*left));
  return text;
}

int campaign_status(const std::string& path, bool as_json) {
  CampaignStatus status(path);
  status.update();
  constexpr auto replaced = nlohmann::ordered_json::error_handler_t::replace;
  TextFile("-").write(as_json ? status.json().dump(1, ' ', false, replaced) + "\n" : status.text());
  return status.is_good() ? 0 : 3;
}

}  // namespace imud
