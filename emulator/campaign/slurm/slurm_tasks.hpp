// SlurmTasks: how the cases of a campaign become tasks of Slurm's job arrays.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace imud {

// The limits of a cluster (slurm.conf(5) of Slurm 22.05).
struct SlurmLimits {
  std::uint64_t array_size = 1001;        // MaxArraySize: the numbers of an array's tasks are below it; 0: no arrays
  std::uint64_t array_tasks = 1'000'000;  // max_array_tasks of SchedulerParameters: tasks of one array
  std::uint64_t jobs = 10'000;            // MaxJobCount: jobs of all users, each task counted

  // Reads the output of `scontrol show config`. A value that is absent keeps its default.
  static SlurmLimits parse(std::string_view config);
};

// The division of cases into tasks, and of tasks into arrays. A task has the same number of cases whenever it is
// submitted, so that its number alone says which cases it does.
struct SlurmTasks {
  std::uint64_t cases = 0;
  std::uint64_t cases_per_task = 1;   // a multiple of the cases of a shard
  std::uint64_t tasks_per_array = 1;  // array n has the tasks from n times this on

  std::uint64_t count() const noexcept { return (cases + cases_per_task - 1) / cases_per_task; }
  std::uint64_t arrays() const noexcept { return (count() + tasks_per_array - 1) / tasks_per_array; }
  std::uint64_t task_of(std::uint64_t index) const noexcept { return index / cases_per_task; }
};

// The quantities on which the division depends.
struct SlurmWork {
  std::uint64_t cases = 1;
  std::uint64_t batch = 1;           // cases of a shard
  double case_s = 1;                 // time of a case
  std::uint64_t processors = 1;      // of the cluster
  std::uint64_t cases_per_task = 0;  // wanted; 0: chosen
};

// Divides the cases into tasks of 5 min. The tasks are shorter, but at least 10 s long, if there would be fewer than
// four tasks for each processor. The tasks are longer if they would be more than half of the jobs that the cluster
// can hold. Throws OpenError if the cluster allows no arrays.
SlurmTasks divide_into_tasks(const SlurmWork& work, const SlurmLimits& limits);

// Returns how many cases a shard should have: at most `most` and at most a minute's cases, because a task that is
// killed loses its open shard; but if `most` permits, enough for at most 10,000 shards.
std::uint64_t batch_for_slurm(std::uint64_t cases, double case_s, std::uint64_t most);

// Returns ascending numbers as sbatch takes them: "0-3,7,9-12".
std::string array_indices(std::span<const std::uint64_t> numbers);

// The script of an array, whose argument is the task of number 0. All paths are absolute.
struct SlurmScript {
  std::string program;  // imud
  std::string plan;
  std::string folder;  // of the campaign
  std::string logs;    // folder for the output of failed tasks, a file for each task

  std::string text(const SlurmTasks& tasks) const;
};

}  // namespace imud
