#include "emulator/campaign/campaign_run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/campaign/case_runner.hpp"
#include "emulator/campaign/cases/case_figures.hpp"
#include "emulator/campaign/missing_cases.hpp"
#include "emulator/campaign/shards/sequential_stop.hpp"
#include "emulator/campaign/shards_at_work.hpp"
#include "emulator/config/config_text.hpp"
#include "emulator/ground/exit_code.hpp"
#include "emulator/ground/host.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/seeds/worker_processes.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

std::string text_of_plan(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

CampaignDescription description_of(const Campaign& campaign) {
  return {campaign.file, campaign.sha256, campaign.cases(), batch_of(campaign), IMUD_VERSION, campaign.build, "",
          campaign.until};
}

// Returns about how many bytes a row has.
std::size_t expected_row_size(const Campaign& campaign, const Config& config) {
  constexpr std::size_t rest = 300, of_imu = 80, of_text = 6, of_digits = 6, of_error = 55;
  Summary summary;
  for (const ImuConfig& imu : config.imus)
    summary.imus.push_back({imu.name,
                            {},
                            device_counts(DeviceCounters(imu.protocol->counters)),
                            0,
                            drawn_terms(imu.model, config.seed, imu.name)});
  const nlohmann::ordered_json figures = case_figures(summary);
  std::size_t size = rest + figures.dump().size() + of_digits * figures.size() + of_imu * config.imus.size();
  const CampaignCase first = case_of(campaign, 0);
  for (const auto& [name, text] : columns_of(campaign, first)) size += name.size() + text.size() + of_text;
  for (const ExpectConfig& one : config.expectations) size += one.name.size() + 2 * of_text;
  if (campaign.integrated_errors) size += of_error * error_figures(campaign, config_of(campaign, first));
  return size + array_bytes(campaign, config);
}

// Throws OpenError unless the cases are whole shards.
void check_range(const CaseRange& cases, const CampaignDescription& campaign) {
  if (cases.last >= campaign.cases)
    throw OpenError(
        fmt::format("--case {}..{}: the campaign has the cases 0..{}", cases.first, cases.last, campaign.cases - 1));
  const CaseRange first = campaign.shard_of(cases.first), last = campaign.shard_of(cases.last);
  if (first.first != cases.first || last.last != cases.last)
    throw OpenError(fmt::format(
        "--case {}..{}: a shard has {} cases, and belongs to one call; give whole shards, such as {}..{}, or another "
        "`batch` in the plan of a new folder",
        cases.first, cases.last, campaign.batch, first.first, last.last));
}

// Throws OpenError if the rows of the missing cases do not fit on the disk. The size of a row is estimated by the
// rows in the folder, if there are any.
void require_room_for(const MissingCases& missing, const ResultFolder& folder, const Campaign& campaign,
                      CaseRunner& runner) {
  const MissingCases::Kept& kept = missing.kept();
  if (missing.items() == 0) return;
  double row_bytes = 0;
  if (kept.rows > 0) {
    row_bytes = static_cast<double>(kept.bytes) / static_cast<double>(kept.rows) +
                static_cast<double>(folder.campaign().arrays.bytes(1));
  } else {
    try {
      const Config& config = runner.prepare(case_of(campaign, missing.case_of(0)));
      row_bytes = static_cast<double>(expected_row_size(campaign, config));
    } catch (const std::exception&) {  // its row says why
      return;
    }
  }
  require_room(folder.path().string(), missing.items(), row_bytes);
}

// The texts that a worker returns in place of a row: another process has done the case; another process is at work on
// the case; a signal has ended the case.
constexpr std::string_view left_to_others = "-", put_off = "+", was_stopped;

// The run of the missing cases: work() runs in the worker processes, take() receives their texts in this process.
class MissingRun {
 public:
  MissingRun(const ResultFolder& folder, CaseRunner& runner, const MissingCases& missing,
             const CampaignRunOptions& options)
      : folder_(folder),
        runner_(runner),
        missing_(missing),
        options_(options),
        progress_(!options.quiet),
        claims_(folder),
        arrays_(folder.shards_path(), folder.campaign().arrays),
        shards_(folder, missing, claims_, arrays_) {}

  // Runs the cases until all are done, `stop` has ended, or a signal comes. Returns true if all are done.
  bool run(SequentialStop& stop);
  const ShardsAtWork& shards() const noexcept { return shards_; }

 private:
  std::string work(std::uint64_t item, bool yields);
  void take(std::uint64_t item, std::string text);
  void take_row(std::uint64_t item, std::string row);
  bool is_done_by_others(const ShardToWrite& shard, bool is_repaired) const;

  const ResultFolder& folder_;
  CaseRunner& runner_;
  const MissingCases& missing_;
  const CampaignRunOptions& options_;
  ProgressLine progress_;
  ShardClaims claims_;
  ShardArrays arrays_;
  ShardsAtWork shards_;
  std::uint64_t failed_ = 0, short_ = 0;  // cases that are logged
};

// A shard that the folder had at the begin of this run counts as repaired if all its cases could be run.
bool MissingRun::is_done_by_others(const ShardToWrite& shard, bool is_repaired) const {
  if (!shard.replaces) return folder_.has(shard.cases);
  std::string fault;
  const auto there = is_repaired ? folder_.read(shard.cases, fault) : std::nullopt;
  return there &&
         std::ranges::none_of(there->rows, [](const std::string& row) { return RowResult(row).could_not_be_run; });
}

std::string MissingRun::work(std::uint64_t item, bool yields) {
  const ShardToWrite& shard = missing_.shards()[missing_.shard_of(item)];
  if (is_done_by_others(shard, !yields && !options_.cases)) return std::string(left_to_others);
  if (!claims_.claim(shard.cases, yields)) return std::string(put_off);
  const std::uint64_t index = missing_.case_of(item);
  std::optional<CaseRunner::Result> result =
      runner_.run(index, workers_stop(), {.rows = arrays_.writer(shard.cases, index)});
  return result ? std::move(result->row) : std::string(was_stopped);
}

void MissingRun::take(std::uint64_t item, std::string text) {
  if (text == left_to_others)
    shards_.leave(item);
  else if (text == put_off)
    shards_.put_off(item);
  else if (text != was_stopped)
    take_row(item, std::move(text));
}

void MissingRun::take_row(std::uint64_t item, std::string row) {
  constexpr std::uint64_t most_logged = 10;
  if (shards_.has(item)) return shards_.drop(item);
  const RowResult result(row);
  if (result.could_not_be_run && ++failed_ <= most_logged)
    spdlog::error("case {}: {}", missing_.case_of(item), result.error);
  if (!result.shortfall.empty() && ++short_ <= most_logged)
    spdlog::warn("case {}: {}", missing_.case_of(item), result.shortfall);
  shards_.take(item, std::move(row));
}

bool MissingRun::run(SequentialStop& stop) {
  HostTime last_look = host_now();
  const auto is_enough = [&, written = shards_.written()]() mutable {
    constexpr double rarely_s = 2;  // other processes write shards, too
    if (shards_.written() == written && seconds(host_now() - last_look) < rarely_s) return stop.has_ended();
    written = shards_.written();
    last_look = host_now();
    return stop.look();
  };
  const unsigned jobs = options_.jobs > 0 ? options_.jobs : usable_processors();
  std::optional<std::vector<std::size_t>> again;  // the items of a later pass; nullopt: all
  const auto item_of = [&again](std::size_t number) { return again ? (*again)[number] : number; };
  const auto pass = [&](bool is_first) {
    return run_workers(
        {.jobs = jobs,
         // Several runs of the whole campaign divide the shards among them. The tasks of an array do not need this.
         .work = [&](std::size_t number) { return work(item_of(number), is_first && !options_.cases); },
         .take = [&](std::size_t number, std::string text) { take(item_of(number), std::move(text)); },
         .tick = [&] { progress_.show(shards_.done(), missing_.items(), "cases"); },
         .is_enough = is_enough,
         .lose =
             [&](std::size_t number, const std::string& cause) {
               const std::size_t item = item_of(number);
               take_row(item, runner_.row_of_failure(missing_.case_of(item), cause));
             },
         .at_work =
             [&](std::vector<std::size_t> items) {
               for (std::size_t& item : items) item = item_of(item);
               shards_.go_on(items);
             },
         .goes_on = !is_first},
        again ? again->size() : missing_.items());
  };
  // Bounds the number of passes, in case something removes the files again and again.
  constexpr int most_passes = 5;
  bool goes_on = pass(true);
  for (int i = 1; goes_on && i < most_passes && !stop.has_ended(); ++i) {
    again = shards_.end_of_pass();
    if (again->empty()) break;
    goes_on = pass(false);
  }
  progress_.clear();
  return goes_on && shards_.are_all_done();
}

int run_missing(const ResultFolder& folder, const Campaign& campaign, CaseRunner& runner,
                const CampaignRunOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a limit of the files' size is an error of the write, as a full disk is
  const HostTime begin = host_now();
  const CaseRange given = options.cases.value_or(CaseRange{0, folder.campaign().cases - 1});
  SequentialStop stop(folder);
  stop.look();
  const auto needed = stop.needed(given);
  if (!needed) {
    TextFile("-").write(fmt::format("until    {}\n", stop.text()));
    return 0;
  }
  const CaseRange all = *needed;
  if (!options.cases)
    if (const std::size_t removed = folder.remove_left_behind(); removed > 0)
      spdlog::info("{} temporary files of ended processes are removed", removed);
  const MissingCases missing(folder, all, campaign);
  require_room_for(missing, folder, campaign, runner);
  if (missing.items() < all.size())
    spdlog::info("{} of {} cases are done already", all.size() - missing.items(), all.size());
  MissingRun run(folder, runner, missing, options);
  const bool is_done = run.run(stop);
  const ShardsAtWork& shards = run.shards();
  CaseTally tally = missing.kept().tally;
  tally.add(shards.tally());
  if (stop.look()) {  // the cases behind the end do not count
    const auto counted = stop.needed(given);
    tally = counted ? MissingCases(folder, *counted, campaign).kept().tally : CaseTally();
  } else if (!is_done) {
    spdlog::error(
        "incomplete: it was ended after {} of {} cases; {} further ones are lost with their shards; imud campaign "
        "resume {} does the others",
        shards.stored(), missing.items(), shards.done() - shards.stored(), folder.path().string());
    tally.exit_code = worse_exit_code(tally.exit_code, 3);
  }
  TextFile("-").write(fmt::format("ran      {:.3f} s, {} cases, {} shards\n{}", seconds(host_now() - begin),
                                  shards.stored(), shards.written(), tally.text()));
  if (const std::string text = stop.text(); !text.empty()) TextFile("-").write(fmt::format("until    {}\n", text));
  return tally.exit_code;
}

}  // namespace

std::uint64_t batch_of(const Campaign& campaign) noexcept {
  if (campaign.batch > 0) return campaign.batch;
  constexpr std::uint64_t least_shards = 100, most = 1000, step = 10;
  std::uint64_t batch = 1;
  while (batch < most && campaign.cases() / (step * batch) >= least_shards) batch *= step;
  return batch;
}

void require_room(const std::string& folder, std::uint64_t cases, double row_bytes) {
  std::filesystem::path existing = std::filesystem::absolute(folder);
  while (!std::filesystem::exists(existing) && existing.has_relative_path()) existing = existing.parent_path();
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(existing, error);
  const double needed = static_cast<double>(cases) * row_bytes;
  if (error || needed <= static_cast<double>(space.available)) return;
  throw OpenError(
      fmt::format("{}: {} cases write about {:.3g} MB, a row of {:.0f} bytes each, and the disk has {:.3g} MB left; "
                  "give a folder on another disk",
                  folder, cases, 1e-6 * needed, row_bytes, 1e-6 * static_cast<double>(space.available)));
}

ResultFolder open_result_folder(const std::string& folder, const Campaign& campaign) {
  CampaignDescription description = description_of(campaign);
  description.arrays = arrays_of(campaign);
  return {folder, description, text_of_plan(campaign.file)};
}

Campaign campaign_of(const ResultFolder& folder) {
  const CampaignDescription& description = folder.campaign();
  std::vector<std::string> places = {description.plan};
  if (!description.plan_from_folder.empty())
    places.push_back(
        (std::filesystem::absolute(folder.path()) / description.plan_from_folder).lexically_normal().string());
  const auto is_same = [&](const std::string& place) {
    return sha256(text_of_plan(place)) == description.plan_sha256;
  };
  const auto is_file = [](const std::string& place) {
    std::error_code error;
    return std::filesystem::is_regular_file(place, error);
  };
  auto plan = std::ranges::find_if(places, is_same);
  if (plan == places.end()) plan = std::ranges::find_if(places, is_file);
  if (plan == places.end())
    throw OpenError(
        fmt::format("{0}: its plan is not at {1}; imud campaign run PLAN --into {0} takes it from its new "
                    "place",
                    folder.path().string(), fmt::join(places, ", nor at ")));
  Campaign campaign = read_campaign(*plan);
  folder.require_same(description_of(campaign), text_of_plan(campaign.file));
  return campaign;
}

void keep_plan_of(const ResultFolder& folder, const Campaign& campaign) {
  folder.keep_plan(text_of_plan(campaign.file));
}

int run_campaign(const std::string& plan, const std::string& folder, const CampaignRunOptions& options) {
  const Campaign campaign = read_campaign(plan);
  CaseRunner runner(campaign);
  CampaignDescription description = description_of(campaign);
  if (ResultFolder::is_at(folder)) {
    const ResultFolder present(folder);
    present.require_same(description, text_of_plan(campaign.file));
    description = present.campaign();
  }
  if (options.cases) check_range(*options.cases, description);
  const CaseRange range = options.cases.value_or(CaseRange{0, description.cases - 1});
  const Config& config = runner.prepare(case_of(campaign, range.first));
  for (const std::string& warning : config.warnings) spdlog::warn("{}", warning);
  if (!ResultFolder::is_at(folder))
    require_room(folder, range.size(), static_cast<double>(expected_row_size(campaign, config)));
  return run_missing(open_result_folder(folder, campaign), campaign, runner, options);
}

int resume_campaign(const std::string& folder, const CampaignRunOptions& options) {
  const ResultFolder present(folder);
  const Campaign campaign = campaign_of(present);
  present.check_writable();
  keep_plan_of(present, campaign);
  CaseRunner runner(campaign);
  return run_missing(present, campaign, runner, options);
}

}  // namespace imud
