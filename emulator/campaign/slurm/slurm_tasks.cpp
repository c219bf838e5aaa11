#include "emulator/campaign/slurm/slurm_tasks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "emulator/ground/shell_word.hpp"
#include "emulator/ground/text_file.hpp"

namespace imud {

namespace {

constexpr double task_s = 300, least_task_s = 10, shard_s = 60;

// Sets `value` to the number with which the text begins, if it does.
void read_number(std::string_view text, std::uint64_t& value) noexcept {
  std::uint64_t number = 0;
  if (std::from_chars(text.data(), text.data() + text.size(), number).ec == std::errc()) value = number;
}

// Returns the value of a line "KEY   = VALUE"; empty for another key.
std::string_view value_of(std::string_view line, std::string_view key) noexcept {
  if (!line.starts_with(key)) return {};
  line.remove_prefix(key.size());
  const std::size_t value = line.find_first_not_of(' ');
  if (value == line.npos || line[value] != '=') return {};
  line.remove_prefix(value + 1);
  line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
  return line;
}

}  // namespace

SlurmLimits SlurmLimits::parse(std::string_view config) {
  constexpr std::string_view option = "max_array_tasks=";
  SlurmLimits limits;
  while (!config.empty()) {
    const std::string_view line = config.substr(0, config.find('\n'));
    config.remove_prefix(std::min(line.size() + 1, config.size()));
    read_number(value_of(line, "MaxArraySize"), limits.array_size);
    read_number(value_of(line, "MaxJobCount"), limits.jobs);
    const std::string_view parameters = value_of(line, "SchedulerParameters");
    if (const std::size_t at = parameters.find(option); at != parameters.npos)
      read_number(parameters.substr(at + option.size()), limits.array_tasks);
  }
  return limits;
}

SlurmTasks divide_into_tasks(const SlurmWork& work, const SlurmLimits& limits) {
  // A longer list of single numbers would not be one argument of a program (128 KiB).
  constexpr std::uint64_t most_in_list = 10'000;
  constexpr double tasks_per_processor = 4;
  if (limits.array_size == 0) throw OpenError("the cluster allows no job arrays (MaxArraySize=0 in slurm.conf)");
  const std::uint64_t most_tasks = std::max<std::uint64_t>(1, limits.jobs / 2);
  const auto cases = static_cast<double>(work.cases);
  const double share_s = cases * work.case_s / (tasks_per_processor * static_cast<double>(work.processors));
  const double wanted_s = std::clamp(share_s, least_task_s, task_s);
  std::uint64_t per_task = work.cases_per_task > 0
                               ? work.cases_per_task
                               : static_cast<std::uint64_t>(std::clamp(wanted_s / work.case_s, 1.0, cases));
  per_task = std::max(per_task, (work.cases + most_tasks - 1) / most_tasks);
  const std::uint64_t shards = (per_task + work.batch - 1) / work.batch;
  return {.cases = work.cases,
          .cases_per_task = shards * work.batch,
          .tasks_per_array = std::max<std::uint64_t>(
              1, std::min({limits.array_size, limits.array_tasks, most_tasks, most_in_list}))};
}

std::uint64_t batch_for_slurm(std::uint64_t cases, double case_s, std::uint64_t most) {
  constexpr std::uint64_t most_shards = 10'000;
  const auto of_time = static_cast<std::uint64_t>(std::clamp(shard_s / case_s, 1.0, static_cast<double>(most)));
  const std::uint64_t least = (cases + most_shards - 1) / most_shards;
  return std::clamp(of_time, std::min(least, most), most);
}

std::string array_indices(std::span<const std::uint64_t> numbers) {
  std::string text;
  for (std::size_t begin = 0, end = 0; begin < numbers.size(); begin = end) {
    end = begin + 1;
    while (end < numbers.size() && numbers[end] == numbers[end - 1] + 1) ++end;
    text += fmt::format("{}{}", begin > 0 ? "," : "", numbers[begin]);
    if (end - begin > 1) text += fmt::format("-{}", numbers[end - 1]);
  }
  return text;
}

std::string SlurmScript::text(const SlurmTasks& tasks) const {
  return fmt::format(R"(#!/bin/sh
# Written by imud campaign run. A task of the array does {0} cases; the argument is the task of number 0.
task=$((${{1:-0}} + SLURM_ARRAY_TASK_ID))
first=$((task * {0}))
last=$((first + {0} - 1))
[ "$last" -le {1} ] || last={1}
log={2}/"$task.txt"
{3} campaign run {4} --into {5} --case "$first..$last" --jobs "${{SLURM_CPUS_PER_TASK:-1}}" --quiet >>"$log" 2>&1
status=$?
[ "$status" -ne 0 ] || rm -f "$log"
exit "$status"
)",
                     tasks.cases_per_task, tasks.cases - 1, shell_word(logs), shell_word(program), shell_word(plan),
                     shell_word(folder));
}

}  // namespace imud
