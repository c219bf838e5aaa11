#include "emulator/campaign/slurm/slurm_queue.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <boost/algorithm/string/classification.hpp>
#include <boost/algorithm/string/predicate.hpp>
#include <boost/algorithm/string/split.hpp>
#include <boost/algorithm/string/trim.hpp>
#include <optional>

#include "core/numbers/number_text.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/programs/command_output.hpp"

namespace imud {

namespace {

std::vector<std::string> parts_of(std::string_view text, const char* separator) {
  std::vector<std::string> parts;
  boost::split(parts, text, boost::is_any_of(separator));
  return parts;
}

// Returns the words of a command that has failed, in one line.
std::string fault_of(const std::string& command, const CommandOutput& result) {
  if (result.exit_code == 127) return result.errors + ": Slurm's commands must be in PATH (Debian: slurm-client)";
  const std::string words = boost::trim_copy(result.errors);
  if (words.empty()) return fmt::format("{} has ended with exit code {}", command, result.exit_code);
  return fmt::format("{}", fmt::join(parts_of(words, "\n"), "; "));
}

}  // namespace

std::vector<std::string> sbatch_words(const SlurmArray& array) {
  std::vector<std::string> words = {"sbatch",
                                    "--parsable",
                                    "--requeue",
                                    "--job-name=" + array.name,
                                    "--array=" + array.indices,
                                    "--output=/dev/null"};
  if (array.max_running > 0) words[4] += fmt::format("%{}", array.max_running);
  if (!array.after.empty()) words.push_back("--dependency=afterany:" + array.after);
  words.insert(words.end(), array.options.begin(), array.options.end());
  words.insert(words.end(), {array.script, fmt::format("{}", array.first_task)});
  return words;
}

std::string sbatch_option_fault(std::string_view option) {
  // By these a campaign finds its tasks, and reads the answer of sbatch.
  constexpr std::array<std::string_view, 9> own = {"--array", "--job-name",  "--parsable", "--quiet",    "--wait",
                                                   "--wrap",  "--test-only", "--clusters", "--het-group"};
  constexpr std::array<std::string_view, 5> own_letters = {"-a", "-J", "-Q", "-W", "-M"};
  const std::string_view name = option.substr(0, option.find('='));
  if (!option.starts_with('-') || option.size() < 2 || option == "--")
    return fmt::format("`{}` is no option; give it as --NAME=VALUE", option);
  // sbatch takes the beginning of a long name for the name.
  const auto is_long = [&](std::string_view one) { return name.starts_with("--") && one.starts_with(name); };
  const auto is_letter = [&](std::string_view one) { return option.starts_with(one); };
  const bool is_own = std::ranges::any_of(own, is_long) || std::ranges::any_of(own_letters, is_letter);
  return is_own ? fmt::format("`{}` is set by the campaign itself", name) : std::string();
}

std::vector<QueuedTask> queued_tasks(std::string_view output) {
  std::vector<QueuedTask> tasks;
  for (const std::string& line : parts_of(output, "\n")) {
    std::vector<std::string> fields = parts_of(line, "|");
    const auto index = fields.size() < 5 ? std::nullopt : number_in<std::uint64_t>(fields[2]);
    if (!index) continue;
    QueuedTask task;
    task.index = *index;
    task.name = std::move(fields[0]);
    task.job = std::move(fields[1]);
    task.state = std::move(fields[3]);
    task.reason = std::move(fields[4]);
    tasks.push_back(std::move(task));
  }
  return tasks;
}

SlurmLimits SlurmQueue::limits() const {
  const CommandOutput result = run_command({"scontrol", "show", "config"}, stop_);
  if (result.exit_code != 0) throw OpenError(fault_of("scontrol", result));
  return SlurmLimits::parse(result.output);
}

std::uint64_t SlurmQueue::processors(const std::string& partition) const {
  std::vector<std::string> words = {"sinfo", "--noheader", "--format=%C"};
  if (!partition.empty()) words.push_back("--partition=" + partition);
  std::uint64_t sum = 0;
  for (const std::string& line : parts_of(run_command(words, stop_).output, "\n")) {
    const std::vector<std::string> states = parts_of(boost::trim_copy(line), "/");  // allocated/idle/other/total
    if (states.size() == 4) sum += number_in<std::uint64_t>(states[3]).value_or(0);
  }
  return std::max<std::uint64_t>(1, sum);
}

std::string SlurmQueue::submit(const SlurmArray& array) const {
  const CommandOutput result = run_command(sbatch_words(array), stop_);
  if (result.exit_code != 0) throw OpenError(fault_of("sbatch", result));
  return boost::trim_copy(result.output.substr(0, result.output.find(';')));  // "ID" or "ID;CLUSTER"
}

void SlurmQueue::cancel(const std::vector<std::string>& jobs) const {
  std::vector<std::string> words = {"scancel", "--quiet"};
  words.insert(words.end(), jobs.begin(), jobs.end());
  if (!jobs.empty()) run_command(words, stop_);
}

std::optional<std::vector<QueuedTask>> SlurmQueue::tasks(const std::vector<std::string>& names,
                                                         std::string& fault) const {
  const CommandOutput result = run_command(
      {"squeue", "--noheader", "--array", fmt::format("--name={}", fmt::join(names, ",")), "--format=%j|%F|%K|%t|%r"},
      stop_);
  if (result.exit_code == 0) return queued_tasks(result.output);
  fault = fault_of("squeue", result);
  return std::nullopt;
}

}  // namespace imud
