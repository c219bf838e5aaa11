#include "emulator/campaign/campaign_run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "emulator/campaign/case_runner.hpp"
#include "emulator/campaign/cases/case_figures.hpp"
#include "emulator/campaign/missing_cases.hpp"
#include "emulator/campaign/shards/sequential_stop.hpp"
#include "emulator/config/config_text.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/seeds/seed_results.hpp"
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
  return size;
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

// Writes the shards from rows that come in any order.
class ShardsAtWork {
 public:
  ShardsAtWork(const ResultFolder& folder, const MissingCases& cases) : folder_(folder), cases_(cases) {}

  // Takes the row of an item. A row that has come before changes nothing.
  void take(std::uint64_t item, std::string row) {
    const std::size_t number = cases_.shard_of(item);
    const ShardToWrite& shard = cases_.shards()[number];
    if (is_done(number)) return;
    const auto [entry, is_new] = at_work_.try_emplace(number, shard.cases.first);
    AtWork& at_work = entry->second;
    if (is_new && shard.kept() > 0) at_work.rows = rows_that_stay(shard);
    const std::uint64_t index = shard.case_of_item(item - shard.before);
    const bool has_failed = RowResult(row).could_not_be_run;
    if (index < at_work.next || !at_work.rows.emplace(index, std::move(row)).second) return;
    ++done_;
    at_work.failed += has_failed ? 1 : 0;
    if (!at_work.writer)
      at_work.writer = std::make_unique<ShardWriter>(folder_.shards_path(), folder_.campaign().head(shard.cases));
    for (auto row = at_work.rows.begin(); row != at_work.rows.end() && row->first == at_work.next;
         row = at_work.rows.erase(row), ++at_work.next)
      at_work.writer->add(row->second);
    if (at_work.next <= shard.cases.last) return;
    if (!is_there_as_good(shard, at_work.failed)) {
      at_work.writer->commit();
      ++written_;
    }
    end(number);
  }
  // Another process has written the shard of the item. Returns false if that was known.
  bool leave(std::uint64_t item) {
    const std::size_t number = cases_.shard_of(item);
    if (is_done(number)) return false;
    const auto at_work = at_work_.find(number);
    const ShardToWrite& shard = cases_.shards()[number];
    const std::uint64_t had = at_work == at_work_.end() ? 0
                                                        : at_work->second.next - shard.cases.first +
                                                              at_work->second.rows.size() - shard.kept();
    done_ += shard.items() - had;
    end(number);
    return true;
  }

  bool has(std::uint64_t item) const {
    const std::size_t number = cases_.shard_of(item);
    if (is_done(number)) return true;
    const auto at_work = at_work_.find(number);
    if (at_work == at_work_.end()) return false;
    const ShardToWrite& shard = cases_.shards()[number];
    const std::uint64_t index = shard.case_of_item(item - shard.before);
    return index < at_work->second.next || at_work->second.rows.contains(index);
  }
  std::uint64_t done() const noexcept { return done_; }        // items
  std::uint64_t stored() const noexcept { return stored_; }    // items in shards that are whole
  std::uint64_t written() const noexcept { return written_; }  // shards
  bool are_all_done() const noexcept { return ended_ == cases_.shards().size(); }

 private:
  struct AtWork {
    explicit AtWork(std::uint64_t first) : next(first) {}
    std::map<std::uint64_t, std::string> rows = {};  // that have come, and are not written, by their cases
    std::uint64_t next;                              // the case of the next row to write
    std::uint64_t failed = 0;                        // cases that could not be run
    std::unique_ptr<ShardWriter> writer;
  };
  bool is_done(std::size_t number) const { return number < first_not_done_ || (done_ahead_.contains(number)); }
  std::map<std::uint64_t, std::string> rows_that_stay(const ShardToWrite& shard) const {
    std::string fault;
    std::optional<Shard> there = folder_.read(shard.cases, fault);
    if (!there)
      throw std::runtime_error(fmt::format("{} {} since this began; try again", shard_name(shard.cases), fault));
    std::map<std::uint64_t, std::string> rows;
    for (std::uint64_t index = shard.cases.first; index <= shard.cases.last; ++index)
      if (!std::ranges::binary_search(shard.to_run, index))
        rows.emplace(index, std::move(there->rows[index - shard.cases.first]));
    return rows;
  }
  // Returns true if another process has written the shard meanwhile, with as few cases that could not be run.
  bool is_there_as_good(const ShardToWrite& shard, std::uint64_t failed) const {
    if (!folder_.has(shard.cases)) return false;
    std::string fault;
    const std::optional<Shard> there = folder_.read(shard.cases, fault);
    if (!there) return false;
    const auto failed_there =
        std::ranges::count_if(there->rows, [](const std::string& row) { return RowResult(row).could_not_be_run; });
    const auto most = static_cast<std::ptrdiff_t>(failed);
    return shard.replaces ? failed_there < most : failed_there <= most;
  }
  void end(std::size_t number) {
    at_work_.erase(number);
    stored_ += cases_.shards()[number].items();
    ++ended_;
    done_ahead_.insert(number);
    while (done_ahead_.erase(first_not_done_) > 0) ++first_not_done_;
  }

  const ResultFolder& folder_;
  const MissingCases& cases_;
  std::map<std::size_t, AtWork> at_work_;  // by the number of the shard
  std::size_t first_not_done_ = 0;
  std::set<std::size_t> done_ahead_;  // shards behind it that are done
  std::uint64_t done_ = 0, stored_ = 0, written_ = 0, ended_ = 0;
};

// Throws OpenError if the missing cases do not fit the disk. Rows that are there say how long one is.
void require_room_for(const MissingCases& missing, const ResultFolder& folder, const Campaign& campaign,
                      CaseRunner& runner) {
  const MissingCases::Kept& kept = missing.kept();
  if (missing.items() == 0) return;
  double row_bytes = 0;
  if (kept.rows > 0) {
    row_bytes = static_cast<double>(kept.bytes) / static_cast<double>(kept.rows);
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

// The text of a worker for a case that another process has done meanwhile, and for one that a signal has ended.
constexpr std::string_view left_to_others = "-", was_stopped;

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
  ShardsAtWork shards(folder, missing);
  ProgressLine progress(!options.quiet);
  const unsigned jobs = options.jobs > 0 ? options.jobs : std::max(1U, std::thread::hardware_concurrency());
  int exit_code = missing.kept().exit_code;
  std::uint64_t failed = 0, incomplete = missing.kept().incomplete, short_cases = 0;
  const auto take = [&](std::uint64_t item, std::string row) {
    constexpr std::uint64_t most_logged = 10;
    const RowResult result(row);
    exit_code = worse_exit_code(exit_code, result.exit_code);
    if (result.could_not_be_run) {
      if (++failed <= most_logged) spdlog::error("case {}: {}", missing.case_of(item), result.error);
    } else if (result.exit_code != 0) {
      ++incomplete;
    }
    if (!result.shortfall.empty() && ++short_cases <= most_logged)
      spdlog::warn("case {}: {}", missing.case_of(item), result.shortfall);
    shards.take(item, std::move(row));
  };
  const auto leave = [&](std::uint64_t item) {
    if (!shards.leave(item)) return;
    std::string fault;
    if (const auto there = folder.read(missing.shards()[missing.shard_of(item)].cases, fault))
      for (const std::string& row : there->rows) exit_code = worse_exit_code(exit_code, RowResult(row).exit_code);
  };
  const auto work = [&](std::size_t item) {
    const ShardToWrite& shard = missing.shards()[missing.shard_of(item)];
    if (!shard.replaces && folder.has(shard.cases)) return std::string(left_to_others);
    std::optional<CaseRunner::Result> result = runner.run(missing.case_of(item), workers_stop(), {});
    return result ? std::move(result->row) : std::string(was_stopped);
  };
  HostTime last_look = begin;
  const auto is_enough = [&, written = shards.written()]() mutable {
    constexpr double rarely_s = 2;  // other processes write shards, too
    if (shards.written() == written && seconds(host_now() - last_look) < rarely_s) return stop.has_ended();
    written = shards.written();
    last_look = host_now();
    return stop.look();
  };
  const bool is_done = run_workers({.jobs = jobs,
                                    .work = work,
                                    .take =
                                        [&](std::size_t item, std::string text) {
                                          if (text == left_to_others)
                                            leave(item);
                                          else if (text != was_stopped && !shards.has(item))
                                            take(item, std::move(text));
                                        },
                                    .tick = [&] { progress.show(shards.done(), missing.items(), "cases"); },
                                    .is_enough = is_enough,
                                    .lose =
                                        [&](std::size_t item, const std::string& cause) {
                                          if (!shards.has(item))
                                            take(item, runner.row_of_failure(missing.case_of(item), cause));
                                        }},
                                   missing.items()) &&
                       shards.are_all_done();
  progress.clear();
  if (stop.look()) {  // the cases behind the end do not count
    failed = 0;
    const auto counted = stop.needed(given);
    const MissingCases::Kept kept = counted ? MissingCases(folder, *counted, campaign).kept() : MissingCases::Kept();
    incomplete = kept.incomplete;
    exit_code = kept.exit_code;
  } else if (!is_done) {
    spdlog::error(
        "incomplete: it was ended after {} of {} cases; {} further ones are lost with their shards; imud campaign "
        "resume {} does the others",
        shards.stored(), missing.items(), shards.done() - shards.stored(), folder.path().string());
    exit_code = worse_exit_code(exit_code, 3);
  }
  const double duration_s = seconds(host_now() - begin);
  TextFile("-").write(
      fmt::format("ran      {:.3f} s, {} cases, {} shards\ncases    {} could not be run, {} incomplete or with "
                  "failed expectations\n",
                  duration_s, shards.stored(), shards.written(), failed, incomplete));
  if (const std::string text = stop.text(); !text.empty()) TextFile("-").write(fmt::format("until    {}\n", text));
  return exit_code;
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
  return {folder, description_of(campaign), text_of_plan(campaign.file)};
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
