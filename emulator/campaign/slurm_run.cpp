#include "emulator/campaign/slurm_run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/vfs.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "emulator/campaign/campaign_run.hpp"
#include "emulator/campaign/case_cost.hpp"
#include "emulator/campaign/case_runner.hpp"
#include "emulator/campaign/missing_cases.hpp"
#include "emulator/campaign/shards/sequential_stop.hpp"
#include "emulator/campaign/slurm/slurm_queue.hpp"
#include "emulator/campaign/slurm/stored_tasks.hpp"
#include "emulator/ground/exit_code.hpp"
#include "emulator/ground/progress_line.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/seeds/worker_processes.hpp"
#include "transports/host_clock.hpp"

namespace imud {

namespace {

namespace fs = std::filesystem;

// Returns the options of sbatch: of the plan, then of the command line.
std::vector<std::string> sbatch_options(const CampaignSlurm& slurm, const std::vector<std::string>& more) {
  std::vector<std::string> options;
  if (!slurm.partition.empty()) options.push_back("--partition=" + slurm.partition);
  if (!slurm.account.empty()) options.push_back("--account=" + slurm.account);
  if (!slurm.time_limit.empty()) options.push_back("--time=" + slurm.time_limit);
  options.insert(options.end(), slurm.options.begin(), slurm.options.end());
  options.insert(options.end(), more.begin(), more.end());
  for (const std::string& option : options)
    if (const std::string fault = sbatch_option_fault(option); !fault.empty())
      throw OpenError("option of sbatch: " + fault);
  return options;
}

// Returns for how long a file that another host has made may be missing in a listing of the folder, s: NFS caches a
// listing for up to a minute (nfs(5), acdirmax).
double listing_delay_s(const fs::path& folder) {
  constexpr long nfs = 0x6969;  // NFS_SUPER_MAGIC of statfs(2)
  struct statfs system = {};
  return ::statfs(folder.c_str(), &system) == 0 && static_cast<long>(system.f_type) == nfs ? 65 : 2;
}

// Returns the time of a case with its system under test.
double tested_case_s(const Campaign& campaign) {
  const HostTime begin = host_now();
  const std::atomic<bool> no_stop = false;
  CaseRunner(campaign).run(0, no_stop, {});
  return seconds(host_now() - begin);
}

// Waits for so many seconds, or until a signal comes.
void pause_for(double duration_s) {
  for (const HostTime begin = host_now(); !workers_stop() && seconds(host_now() - begin) < duration_s;)
    ::poll(nullptr, 0, 100);
}

// Submits the tasks of a campaign that have missing shards, and waits for these shards.
class SlurmRun {
 public:
  SlurmRun(const ResultFolder& folder, const Campaign& campaign, StoredTasks stored, bool quiet)
      : folder_(folder), campaign_(campaign), stored_(std::move(stored)), progress_(!quiet), queue_(workers_stop()) {
    const auto queued = ask_queue();  // before the shards are read: a task that ends meanwhile is not submitted again
    if (!queued) throw OpenError("Slurm does not say which tasks wait or run, so that none is submitted; try again");
    stop_.look();
    const MissingCases missing(folder, {0, stop_.cases() - 1}, campaign);
    tally_ = missing.kept().tally;
    std::set<std::uint64_t> tasks;
    for (const ShardToWrite& shard : missing.shards()) {
      cases_ += shard.cases.size();
      awaited_.emplace(shard.cases.first, Awaited{shard.cases, shard.replaces ? time_of(shard.cases) : std::nullopt});
      tasks.insert(stored_.tasks.task_of(shard.cases.first));
    }
    for (const std::uint64_t task : tasks)
      to_submit_[task / stored_.tasks.tasks_per_array].insert(task % stored_.tasks.tasks_per_array);
    if (cases_ < stop_.cases())
      spdlog::info("{} of {} cases are done already", stop_.cases() - cases_, stop_.cases());
    leave_what_is_queued(*queued);
  }

  int run() {
    while (!awaited_.empty() && !workers_stop()) {
      if (!to_submit_.empty() && queued_ < refused_at_) submit();
      if (!follow()) break;
    }
    return end();
  }

 private:
  struct Awaited {
    CaseRange cases;
    std::optional<fs::file_time_type> before;  // of the shard that is replaced
  };

  std::optional<fs::file_time_type> time_of(const CaseRange& cases) const {
    std::error_code error;
    const fs::file_time_type time = fs::last_write_time(folder_.shards_path() / shard_name(cases), error);
    return error ? std::nullopt : std::optional(time);
  }
  std::string name_of(std::uint64_t array) const { return fmt::format("{}-{}", stored_.name, array); }
  // Returns the campaign's tasks in the queue; nullopt if Slurm does not answer, which is logged once.
  std::optional<std::vector<QueuedTask>> ask_queue() {
    std::vector<std::string> names;
    for (std::uint64_t array = 0; array < stored_.tasks.arrays(); ++array) names.push_back(name_of(array));
    std::string fault;
    auto tasks = queue_.tasks(names, fault);
    if (!tasks && !workers_stop() && !std::exchange(is_silent_, true))
      spdlog::warn("{}; the shards are looked at all the same", fault);
    if (tasks && std::exchange(is_silent_, false)) spdlog::info("Slurm answers again");
    return tasks;
  }

  // Removes the tasks that wait or run from to_submit_.
  void leave_what_is_queued(const std::vector<QueuedTask>& tasks);
  void submit();
  bool follow();
  void look_at_shards();
  void end_early();
  void show_progress(const std::vector<QueuedTask>& tasks);
  int end();

  const ResultFolder& folder_;
  const Campaign& campaign_;
  const StoredTasks stored_;
  ProgressLine progress_;
  const SlurmQueue queue_;
  SequentialStop stop_{folder_};
  const HostTime begin_ = host_now();
  std::map<std::uint64_t, Awaited> awaited_;                    // by the first case
  std::map<std::uint64_t, std::set<std::uint64_t>> to_submit_;  // numbers in the array, by the array
  std::uint64_t cases_ = 0, done_ = 0, shards_ = 0;             // done_: cases
  CaseTally tally_;
  std::string last_job_;                                   // of the arrays in the queue
  std::size_t queued_ = 0;                                 // tasks, when the queue was last asked
  std::size_t refused_at_ = static_cast<std::size_t>(-1);  // queued tasks when sbatch has refused an array
  std::optional<HostTime> empty_since_;
  bool is_silent_ = false, is_held_ = false;
};

void SlurmRun::leave_what_is_queued(const std::vector<QueuedTask>& tasks) {
  std::map<std::string, std::uint64_t> arrays;
  for (std::uint64_t array = 0; array < stored_.tasks.arrays(); ++array) arrays.emplace(name_of(array), array);
  for (const QueuedTask& task : tasks) {
    last_job_ = task.job;
    const auto named = arrays.find(task.name);
    const auto array = named == arrays.end() ? to_submit_.end() : to_submit_.find(named->second);
    if (array == to_submit_.end()) continue;
    array->second.erase(task.index);
    if (array->second.empty()) to_submit_.erase(array);
  }
  queued_ = tasks.size();
  if (queued_ > 0) spdlog::info("{} tasks run or wait already", queued_);
}

// Submits arrays until Slurm takes no more.
void SlurmRun::submit() {
  while (!to_submit_.empty() && !workers_stop()) {
    const auto& [number, indices] = *to_submit_.begin();
    const std::vector<std::uint64_t> list(indices.begin(), indices.end());
    SlurmArray array{.name = name_of(number),
                     .indices = array_indices(list),
                     .max_running = campaign_.slurm.max_running,
                     .options = stored_.options,
                     .script = (fs::absolute(StoredTasks::folder_in(folder_.path())) / "array.sh").string(),
                     .first_task = number * stored_.tasks.tasks_per_array};
    // Slurm applies the limit to each array alone. The arrays keep it together if each waits for the one before.
    if (campaign_.slurm.max_running > 0) array.after = last_job_;
    try {
      last_job_ = queue_.submit(array);
    } catch (const OpenError& error) {
      if (workers_stop()) return;
      if (queued_ == 0) throw;
      if (refused_at_ > queued_) spdlog::info("{}; {} arrays wait for tasks to end", error.what(), to_submit_.size());
      refused_at_ = queued_;
      return;
    }
    spdlog::info("submitted job {}: {} tasks of {} cases each", last_job_, list.size(), stored_.tasks.cases_per_task);
    queued_ += list.size();
    to_submit_.erase(to_submit_.begin());
  }
  refused_at_ = static_cast<std::size_t>(-1);
}

// Returns false if the tasks have ended.
bool SlurmRun::follow() {
  const double elapsed_s = seconds(host_now() - begin_);
  const auto tasks = ask_queue();
  look_at_shards();
  if (awaited_.empty()) return true;
  if (tasks) {
    queued_ = tasks->size();
    show_progress(*tasks);
    if (queued_ > 0 || !to_submit_.empty()) empty_since_.reset();
    if (queued_ == 0 && to_submit_.empty()) {
      if (!empty_since_) empty_since_ = host_now();
      if (seconds(host_now() - *empty_since_) > listing_delay_s(folder_.path())) return false;
    }
  }
  constexpr double shortest_s = 0.5, longest_s = 30, share = 0.05;
  pause_for(std::clamp(share * elapsed_s, shortest_s, longest_s));
  return true;
}

void SlurmRun::look_at_shards() {
  for (const CaseRange& cases : folder_.list().shards) {
    const auto shard = awaited_.find(cases.first);
    if (shard == awaited_.end() || time_of(cases) == shard->second.before) continue;
    std::string fault;
    const std::optional<Shard> read = folder_.read(cases, fault);
    if (!read) continue;  // MissingCases names a damaged one
    for (const std::string& row : read->rows) tally_.add(RowResult(row));
    done_ += cases.size();
    ++shards_;
    awaited_.erase(shard);
  }
  if (stop_.look()) awaited_.erase(awaited_.lower_bound(stop_.cases()), awaited_.end());
}

// Counts the cases before the end alone, and cancels the tasks of the others.
void SlurmRun::end_early() {
  tally_ = MissingCases(folder_, {0, stop_.cases() - 1}, campaign_).kept().tally;
  std::set<std::string> jobs;
  if (const auto tasks = ask_queue())
    for (const QueuedTask& task : *tasks) jobs.insert(task.job);
  queue_.cancel({jobs.begin(), jobs.end()});
}

void SlurmRun::show_progress(const std::vector<QueuedTask>& tasks) {
  const auto waiting = std::ranges::count_if(tasks, &QueuedTask::waits);
  progress_.show(
      static_cast<double>(done_) / static_cast<double>(cases_),
      fmt::format("{} cases ({} tasks run, {} wait)", cases_, queued_ - static_cast<std::size_t>(waiting), waiting));
  const auto held = std::ranges::find_if(tasks, &QueuedTask::is_held);
  if (held != tasks.end() && !std::exchange(is_held_, true)) {
    spdlog::warn("task {}_{} is held ({}): scontrol release {}_{}", held->job, held->index, held->reason, held->job,
                 held->index);
  }
}

int SlurmRun::end() {
  progress_.clear();
  const std::string folder = folder_.path().string();
  if (awaited_.empty() && stop_.has_ended()) end_early();
  const int exit_code = awaited_.empty() ? tally_.exit_code : worse_exit_code(tally_.exit_code, 3);
  if (awaited_.empty()) folder_.remove_left_behind();
  if (!awaited_.empty() && workers_stop()) {
    spdlog::info(
        "left: the jobs go on; imud campaign status {} shows how far they are, imud campaign resume {} follows "
        "them",
        folder, folder);
    if (!to_submit_.empty())
      spdlog::warn("{} arrays were not submitted yet, which imud campaign resume {} does", to_submit_.size(), folder);
  } else if (!awaited_.empty()) {
    constexpr std::size_t most_listed = 10;
    std::vector<std::string> missing;
    for (const auto& [first, shard] : awaited_)
      if (missing.size() < most_listed) missing.push_back(fmt::format("{}..{}", first, shard.cases.last));
    if (awaited_.size() > most_listed) missing.emplace_back("...");
    spdlog::error(
        "the tasks have ended without {} shards: the cases {}; {} has what failed tasks have printed; imud "
        "campaign resume {} submits them again",
        awaited_.size(), fmt::join(missing, ", "), (StoredTasks::folder_in(folder_.path()) / "log").string(), folder);
  }
  TextFile("-").write(fmt::format("ran      {:.3f} s, {} cases, {} shards\n{}", seconds(host_now() - begin_), done_,
                                  shards_, tally_.text()));
  if (const std::string text = stop_.text(); !text.empty()) TextFile("-").write(fmt::format("until    {}\n", text));
  return exit_code;
}

int run_stored(const ResultFolder& folder, const Campaign& campaign, const StoredTasks& stored,
               const SlurmRunOptions& options) {
  const fs::path here = fs::absolute(folder.path()).lexically_normal();
  const SlurmScript script{.program = fs::read_symlink("/proc/self/exe").string(),
                           .plan = campaign.file,
                           .folder = here.string(),
                           .logs = (StoredTasks::folder_in(here) / "log").string()};
  stored.write_script(folder.path(), script.text(stored.tasks));
  catch_workers_stop();
  SlurmRun run(folder, campaign, stored, options.quiet);
  return run.run();
}

}  // namespace

bool is_on_slurm(const std::string& folder) { return StoredTasks::are_in(folder); }

int run_on_slurm(const std::string& plan, const std::string& folder, const SlurmRunOptions& options) {
  Campaign campaign = read_campaign(plan);
  if (is_on_slurm(folder)) {
    open_result_folder(folder, campaign);  // throws if it has another plan
    return resume_on_slurm(folder, options);
  }
  const std::vector<std::string> sbatch = sbatch_options(campaign.slurm, options.options);
  const SlurmQueue queue(workers_stop());
  const SlurmLimits limits = queue.limits();
  CampaignCost cost = measure_cases(campaign);
  if (campaign.test) cost.case_s = std::max(cost.case_s, tested_case_s(campaign));
  // A campaign with `until` may end after any shard, so that the size of a shard must not depend on a measured time.
  if (campaign.batch == 0 && campaign.until.empty())
    campaign.batch = batch_for_slurm(campaign.cases(), cost.case_s, batch_of(campaign));
  require_room(folder, campaign.cases(), cost.row_bytes);
  const ResultFolder results = open_result_folder(folder, campaign);
  const SlurmTasks tasks = divide_into_tasks({.cases = campaign.cases(),
                                              .batch = results.campaign().batch,
                                              .case_s = cost.case_s,
                                              .processors = queue.processors(campaign.slurm.partition),
                                              .cases_per_task = options.cases_per_task},
                                             limits);
  spdlog::info("a case takes {:.3g} s here: {} tasks of {} cases in {} arrays", cost.case_s, tasks.count(),
               tasks.cases_per_task, tasks.arrays());
  return run_stored(results, campaign, StoredTasks::keep(folder, tasks, sbatch), options);
}

int resume_on_slurm(const std::string& folder, const SlurmRunOptions& options) {
  const ResultFolder results(folder);
  const Campaign campaign = campaign_of(results);
  results.check_writable();
  keep_plan_of(results, campaign);
  StoredTasks stored = StoredTasks::read(folder, results.campaign().cases);
  if (options.cases_per_task > 0 && options.cases_per_task != stored.tasks.cases_per_task)
    throw OpenError(fmt::format("{}: its tasks have {} cases; --slurm-task is for a new folder", folder,
                                stored.tasks.cases_per_task));
  if (!options.options.empty()) stored.options = sbatch_options(campaign.slurm, options.options);
  return run_stored(results, campaign, stored, options);
}

}  // namespace imud
