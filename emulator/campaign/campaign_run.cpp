#include "emulator/campaign/campaign_run.hpp"

#include <fmt/format.h>
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
#include <string_view>
#include <thread>
#include <utility>

#include "emulator/campaign/case_runner.hpp"
#include "emulator/campaign/cases/case_figures.hpp"
#include "emulator/campaign/missing_cases.hpp"
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
  return {campaign.file, campaign.sha256, campaign.cases(), batch_of(campaign), IMUD_VERSION};
}

// Returns about how many bytes a row has.
std::size_t expected_row_size(const Campaign& campaign, const Config& config) {
  constexpr std::size_t rest = 300, of_imu = 80, of_text = 6, of_digits = 6;
  Summary summary;
  for (const ImuConfig& imu : config.imus)
    summary.imus.push_back({imu.name,
                            {},
                            device_counts(DeviceCounters(imu.protocol->counters)),
                            0,
                            drawn_terms(imu.model, config.seed, imu.name)});
  const nlohmann::ordered_json figures = case_figures(summary);
  std::size_t size = rest + figures.dump().size() + of_digits * figures.size() + of_imu * config.imus.size();
  for (const auto& [name, text] : columns_of(campaign, case_of(campaign, 0)))
    size += name.size() + text.size() + of_text;
  for (const ExpectConfig& one : config.expectations) size += one.name.size() + 2 * of_text;
  return campaign.integrated_errors ? size + 6 * of_imu / 2 * config.imus.size() : size;
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
    AtWork& at_work = at_work_.try_emplace(number, shard.kept, shard.cases.first).first->second;
    const std::uint64_t index = shard.case_of_item(item - shard.before);
    if (index < at_work.next || !at_work.rows.emplace(index, std::move(row)).second) return;
    ++done_;
    if (!at_work.writer)
      at_work.writer = std::make_unique<ShardWriter>(folder_.shards_path(), folder_.campaign().head(shard.cases));
    for (auto row = at_work.rows.begin(); row != at_work.rows.end() && row->first == at_work.next;
         row = at_work.rows.erase(row), ++at_work.next)
      at_work.writer->add(row->second);
    if (at_work.next <= shard.cases.last) return;
    at_work.writer->commit();
    end(number);
    ++written_;
  }
  // Another process has written the shard of the item.
  void leave(std::uint64_t item) {
    const std::size_t number = cases_.shard_of(item);
    if (is_done(number)) return;
    const auto at_work = at_work_.find(number);
    const ShardToWrite& shard = cases_.shards()[number];
    const std::uint64_t had = at_work == at_work_.end() ? 0
                                                        : at_work->second.next - shard.cases.first +
                                                              at_work->second.rows.size() - shard.kept.size();
    done_ += shard.items() - had;
    end(number);
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
  std::uint64_t written() const noexcept { return written_; }  // shards
  bool are_all_done() const noexcept { return ended_ == cases_.shards().size(); }

 private:
  struct AtWork {
    AtWork(const std::map<std::uint64_t, std::string>& kept, std::uint64_t first) : rows(kept), next(first) {}
    std::map<std::uint64_t, std::string> rows;  // that have come, and are not written, by their cases
    std::uint64_t next;                         // the case of the next row to write
    std::unique_ptr<ShardWriter> writer;
  };
  bool is_done(std::size_t number) const { return number < first_not_done_ || (done_ahead_.contains(number)); }
  void end(std::size_t number) {
    at_work_.erase(number);
    ++ended_;
    done_ahead_.insert(number);
    while (done_ahead_.erase(first_not_done_) > 0) ++first_not_done_;
  }

  const ResultFolder& folder_;
  const MissingCases& cases_;
  std::map<std::size_t, AtWork> at_work_;  // by the number of the shard
  std::size_t first_not_done_ = 0;
  std::set<std::size_t> done_ahead_;  // shards behind it that are done
  std::uint64_t done_ = 0, written_ = 0, ended_ = 0;
};

// The text of a worker for a case that another process has done meanwhile, and for one that a signal has ended.
constexpr std::string_view left_to_others = "-", was_stopped;

int run_missing(const ResultFolder& folder, const Campaign& campaign, CaseRunner& runner,
                const CampaignRunOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a limit of the files' size is an error of the write, as a full disk is
  const HostTime begin = host_now();
  const CaseRange all = options.cases.value_or(CaseRange{0, folder.campaign().cases - 1});
  const MissingCases missing(folder, all, campaign, runner);
  if (missing.items() < all.size())
    spdlog::info("{} of {} cases are done already", all.size() - missing.items(), all.size());
  ShardsAtWork shards(folder, missing);
  SeedProgress progress(missing.items(), options.quiet);
  const unsigned jobs = options.jobs > 0 ? options.jobs : std::max(1U, std::thread::hardware_concurrency());
  int exit_code = 0;
  std::uint64_t failed = 0, incomplete = 0;
  const auto take = [&](std::uint64_t item, std::string row) {
    constexpr std::uint64_t most_logged = 10;
    const RowResult result(row);
    exit_code = worse_exit_code(exit_code, result.exit_code);
    if (result.could_not_be_run && ++failed <= most_logged)
      spdlog::error("case {}: {}", missing.case_of(item), result.error);
    else if (result.exit_code != 0)
      ++incomplete;
    shards.take(item, std::move(row));
  };
  const auto work = [&](std::size_t item) {
    const ShardToWrite& shard = missing.shards()[missing.shard_of(item)];
    if (!shard.replaces && folder.has(shard.cases)) return std::string(left_to_others);
    std::optional<CaseRunner::Result> result = runner.run(missing.case_of(item), workers_stop(), {});
    return result ? std::move(result->row) : std::string(was_stopped);
  };
  const bool is_whole = run_workers({.jobs = jobs,
                                     .work = work,
                                     .take =
                                         [&](std::size_t item, std::string text) {
                                           if (text == left_to_others)
                                             shards.leave(item);
                                           else if (text != was_stopped && !shards.has(item))
                                             take(item, std::move(text));
                                         },
                                     .tick = [&] { progress.show(shards.done()); },
                                     .lose =
                                         [&](std::size_t item, const std::string& cause) {
                                           if (!shards.has(item))
                                             take(item, runner.row_of_failure(missing.case_of(item), cause));
                                         }},
                                    missing.items()) &&
                        shards.are_all_done();
  if (!is_whole) {
    spdlog::error("incomplete: it was ended after {} of {} cases; imud campaign resume {} does the others",
                  shards.done(), missing.items(), folder.path().string());
    exit_code = worse_exit_code(exit_code, 3);
  }
  const double duration_s = seconds(host_now() - begin);
  TextFile("-").write(
      fmt::format("ran      {:.3f} s, {} cases, {} shards\ncases    {} could not be run, {} incomplete or with "
                  "failed expectations\n",
                  duration_s, shards.done(), shards.written(), failed, incomplete));
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
  Campaign campaign = read_campaign(folder.campaign().plan);
  folder.require_same(description_of(campaign), text_of_plan(campaign.file));
  return campaign;
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
  require_room(folder, range.size(), static_cast<double>(expected_row_size(campaign, config)));
  return run_missing(open_result_folder(folder, campaign), campaign, runner, options);
}

int resume_campaign(const std::string& folder, const CampaignRunOptions& options) {
  const ResultFolder present(folder);
  const Campaign campaign = campaign_of(present);
  present.check_writable();
  if (const std::size_t removed = present.remove_left_behind(); removed > 0)
    spdlog::info("{} temporary files of ended processes are removed", removed);
  CaseRunner runner(campaign);
  return run_missing(present, campaign, runner, options);
}

}  // namespace imud
