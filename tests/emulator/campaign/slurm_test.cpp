// Campaigns on Slurm: the division into tasks, the script, the commands' words and answers. Slurm's programs are
// scripts here; tests/slurm has a real cluster.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "emulator/campaign/slurm/slurm_queue.hpp"
#include "emulator/campaign/slurm/slurm_tasks.hpp"
#include "emulator/ground/shell_word.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/programs/command_output.hpp"
#include "tests/tools/run_program.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

// A folder whose programs are found before all others.
class SlurmPrograms : public ::testing::Test {
 protected:
  SlurmPrograms() {
    std::string name = (fs::temp_directory_path() / "imud slurm'.XXXXXX").string();  // as unpleasant as it may be
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder");
    folder_ = name;
    ::setenv("PATH", (folder_.string() + ":" + path_).c_str(), 1);
  }
  ~SlurmPrograms() override {
    ::setenv("PATH", path_.c_str(), 1);
    fs::remove_all(folder_);
  }
  void make_program(const std::string& name, const std::string& script) const {
    std::ofstream(folder_ / name) << "#!/bin/sh\n" << script << "\n";
    fs::permissions(folder_ / name, fs::perms::owner_all);
  }
  // A program that prints its words, each in a line with brackets.
  void make_printer(const std::string& name) const { make_program(name, "printf '[%s]\\n' \"$@\""); }

  fs::path folder_;
  const std::string path_ = std::getenv("PATH");
  std::atomic<bool> stop_ = false;
  const SlurmQueue queue_{stop_};
};

template <class Action>
std::string open_error_of(Action action) {
  try {
    action();
  } catch (const OpenError& error) {
    return error.what();
  }
  return "no error";
}

TEST(SlurmLimits, AreReadFromARealConfiguration) {
  const SlurmLimits limits = SlurmLimits::parse(read_file(IMUD_TEST_DATA "/slurm/scontrol_config.txt"));
  EXPECT_EQ(limits.array_size, 1001U);
  EXPECT_EQ(limits.jobs, 10'000U);
  EXPECT_EQ(limits.array_tasks, 1'000'000U);  // not there
}

TEST(SlurmLimits, AreThoseOfTheLines) {
  const SlurmLimits limits = SlurmLimits::parse(
      "MaxArraySizeOfAnother   = 3\nMaxArraySize            = 40001\nMaxJobCount             = 50000\n"
      "SchedulerParameters     = bf_interval=1,max_array_tasks=2000,defer\nSlurmctldParameters = (null)");
  EXPECT_EQ(limits.array_size, 40'001U);
  EXPECT_EQ(limits.jobs, 50'000U);
  EXPECT_EQ(limits.array_tasks, 2'000U);
  EXPECT_EQ(SlurmLimits::parse("").array_size, 1001U);
  EXPECT_EQ(SlurmLimits::parse("MaxArraySize = (null)\n").array_size, 1001U);
}

TEST(SlurmTasks, LastMinutes) {
  // A million cases of a second on 200 processors.
  const SlurmTasks tasks = divide_into_tasks({1'000'000, 100, 1, 200}, {});
  EXPECT_EQ(tasks.cases_per_task, 300U);
  EXPECT_EQ(tasks.count(), 3334U);
  EXPECT_EQ(tasks.tasks_per_array, 1001U);
  EXPECT_EQ(tasks.arrays(), 4U);
  // On ten thousand processors they are shorter: four for each.
  EXPECT_EQ(divide_into_tasks({1'000'000, 1, 1, 10'000}, {.jobs = 1'000'000}).cases_per_task, 25U);
  // But not shorter than 10 s, and whole shards.
  EXPECT_EQ(divide_into_tasks({1'000'000, 1, 1, 1'000'000}, {.jobs = 1'000'000}).cases_per_task, 10U);
  EXPECT_EQ(divide_into_tasks({1000, 7, 1, 1}, {}).cases_per_task, 252U);  // 250
  EXPECT_EQ(divide_into_tasks({1000, 100, 3600, 1}, {}).cases_per_task, 100U);
  // As wanted, in whole shards.
  EXPECT_EQ(divide_into_tasks({1000, 10, 1, 1, 25}, {}).cases_per_task, 30U);
}

TEST(SlurmTasks, AreWithinTheLimitsOfTheCluster) {
  std::mt19937_64 random(5);
  const auto number = [&](double most) {
    return static_cast<std::uint64_t>(std::exp(std::uniform_real_distribution<>(0, std::log(most))(random)));
  };
  for (int i = 0; i < 20'000; ++i) {
    const SlurmWork work{number(1e9), number(1e5), 1e-3 * static_cast<double>(number(1e8)), number(1e5),
                         i % 3 == 0 ? number(1e6) : 0};
    const SlurmLimits limits{number(1e5), number(1e5), number(1e6)};
    const SlurmTasks tasks = divide_into_tasks(work, limits);
    ASSERT_EQ(tasks.cases_per_task % work.batch, 0U);
    ASSERT_GE(tasks.count() * tasks.cases_per_task, work.cases);
    ASSERT_LE(tasks.count(), std::max<std::uint64_t>(1, limits.jobs / 2));
    ASSERT_LE(tasks.tasks_per_array, std::min(limits.array_size, limits.array_tasks));
    ASSERT_GE(tasks.arrays() * tasks.tasks_per_array, tasks.count());
    ASSERT_EQ(tasks.task_of(work.cases - 1), tasks.count() - 1);
  }
  EXPECT_EQ(open_error_of([] { divide_into_tasks({}, {.array_size = 0}); }),
            "the cluster allows no job arrays (MaxArraySize=0 in slurm.conf)");
}

TEST(SlurmTasks, AShardIsAMinuteAndThereAreTenThousandAtMost) {
  EXPECT_EQ(batch_for_slurm(1'000'000, 0.01, 1000), 1000U);
  EXPECT_EQ(batch_for_slurm(100'000, 1, 1000), 60U);
  EXPECT_EQ(batch_for_slurm(1'000'000, 10, 1000), 100U);
  EXPECT_EQ(batch_for_slurm(1'000'000, 1e9, 1000), 100U);
  EXPECT_EQ(batch_for_slurm(10, 1e9, 1), 1U);
  EXPECT_EQ(batch_for_slurm(1'000'000'000, 1e9, 1000), 1000U);  // `most` is before
}

TEST(SlurmTasks, IndicesAreRead) {
  EXPECT_EQ(array_indices({}), "");
  EXPECT_EQ(array_indices(std::vector<std::uint64_t>{5}), "5");
  EXPECT_EQ(array_indices(std::vector<std::uint64_t>{0, 1, 2, 3, 7, 9, 10}), "0-3,7,9-10");
  // The longest list is an argument of a program, which has 128 KiB at most.
  std::vector<std::uint64_t> odd;
  for (std::uint64_t i = 0; i < 10'000; ++i) odd.push_back(4'000'000 + 2 * i);
  EXPECT_LT(array_indices(odd).size(), 100'000U);
}

TEST_F(SlurmPrograms, AWordOfAShellIsTheText) {
  for (const std::string& text :
       {std::string("plain"), std::string("a b"), std::string("it's $HOME `id` \\ \"x\" *"),
        std::string("line\nfeed"), std::string(""), std::string("'''"), std::string("-n")}) {
    const CommandOutput result = run_command({"sh", "-c", "printf '%s' " + shell_word(text)}, stop_);
    EXPECT_EQ(result.output, text);
  }
}

TEST_F(SlurmPrograms, TheScriptCallsTheCasesOfItsNumber) {
  make_printer("imud");
  fs::create_directory(folder_ / "log");
  const SlurmTasks tasks{.cases = 1000, .cases_per_task = 30, .tasks_per_array = 10};
  const SlurmScript script{(folder_ / "imud").string(), "/a b/it's $plan.toml", "/a folder",
                           (folder_ / "log").string()};
  std::ofstream(folder_ / "array.sh") << script.text(tasks);
  const auto run = [&](const std::string& index, const std::string& first) {
    ::setenv("SLURM_ARRAY_TASK_ID", index.c_str(), 1);
    const CommandOutput result = run_command({"sh", (folder_ / "array.sh").string(), first}, stop_);
    ::unsetenv("SLURM_ARRAY_TASK_ID");
    EXPECT_EQ(result.output + result.errors, "");
    return result.exit_code;
  };
  // A task that succeeds leaves no log.
  EXPECT_EQ(run("3", "30"), 0);
  EXPECT_TRUE(fs::is_empty(folder_ / "log"));
  make_program("imud", "printf '[%s]' \"$@\"; echo fails >&2; exit 7");
  ::setenv("SLURM_CPUS_PER_TASK", "4", 1);
  EXPECT_EQ(run("3", "30"), 7);
  ::unsetenv("SLURM_CPUS_PER_TASK");
  EXPECT_EQ(read_file(folder_ / "log/33.txt"),
            "[campaign][run][/a b/it's $plan.toml][--into][/a folder][--case][990..999][--jobs][4][--quiet]fails\n");
  EXPECT_EQ(run("0", "0"), 7);
  EXPECT_EQ(read_file(folder_ / "log/0.txt"),
            "[campaign][run][/a b/it's $plan.toml][--into][/a folder][--case][0..29][--jobs][1][--quiet]fails\n");
}

TEST_F(SlurmPrograms, SbatchGetsEveryWordAsItIs) {
  const SlurmArray array{.name = "imud-1",
                         .indices = "0-3,7",
                         .max_running = 20,
                         .after = "11",
                         .options = {"--partition=a b", "--comment=$(id) `id` 'x'"},
                         .script = "/a folder/array.sh",
                         .first_task = 2002};
  make_program("sbatch", "printf '%s\\n' \"$@\" >\"$(dirname \"$0\")/words\"; echo '12;cluster'");
  EXPECT_EQ(queue_.submit(array), "12");
  EXPECT_EQ(
      read_file(folder_ / "words"),
      "--parsable\n--requeue\n--job-name=imud-1\n--array=0-3,7%20\n--output=/dev/null\n--dependency=afterany:11\n"
      "--partition=a b\n--comment=$(id) `id` 'x'\n/a folder/array.sh\n2002\n");
  EXPECT_EQ(fmt::format("{}", fmt::join(sbatch_words({.name = "n", .indices = "0", .script = "s"}), " ")),
            "sbatch --parsable --requeue --job-name=n --array=0 --output=/dev/null s 0");
}

TEST(SlurmOptions, ThatACampaignSetsItselfAreRefused) {
  for (const char* good : {"--mem=2G", "--partition=debug", "-pdebug", "--exclusive", "--wait-all-nodes=0",
                           "--output=/a/%A_%a", "--nice=100", "-A", "--qos=low"})
    EXPECT_EQ(sbatch_option_fault(good), "") << good;
  for (const char* bad : {"--array=0-3", "-a0-3", "--arr=1", "--job-name=x", "-Jx", "--wait", "-W", "--parsable",
                          "--wrap=x", "--test-only", "-Mall", "--clusters=x"})
    EXPECT_NE(sbatch_option_fault(bad).find("is set by the campaign itself"), std::string::npos) << bad;
  for (const char* none : {"", "-", "--", "mem=2G", "script.sh"})
    EXPECT_NE(sbatch_option_fault(none).find("is no option; give it as --NAME=VALUE"), std::string::npos) << none;
}

TEST(SlurmQueueTest, ReadsWhatSqueuePrints) {
  // By squeue of Slurm 22.05.8, but for the held task.
  const std::vector<QueuedTask> tasks = queued_tasks(
      "imud-0|1|2|PD|JobArrayTaskLimit\nimud-0|1|9|PD|launch failed requeued held\nimud-1|7|0|R|None\n"
      "imud-0|1|1|CG|None\nother|9|N/A|R|None\n\ncut|1");
  ASSERT_EQ(tasks.size(), 4U);
  EXPECT_EQ(tasks[0].name, "imud-0");
  EXPECT_EQ(tasks[0].job, "1");
  EXPECT_EQ(tasks[0].index, 2U);
  EXPECT_TRUE(tasks[0].waits());
  EXPECT_FALSE(tasks[0].is_held());
  EXPECT_TRUE(tasks[1].is_held());
  EXPECT_EQ(tasks[2].name, "imud-1");
  EXPECT_FALSE(tasks[2].waits());
  EXPECT_FALSE(tasks[3].waits());
  EXPECT_TRUE(queued_tasks("").empty());
}

TEST_F(SlurmPrograms, AnswersAndFailures) {
  make_program("scontrol", "printf 'MaxArraySize = 11\\n'");
  EXPECT_EQ(queue_.limits().array_size, 11U);
  make_program("sinfo", "printf '1/2/0/3\\n0/0/40/40\\n'");
  EXPECT_EQ(queue_.processors(""), 43U);
  make_program("sinfo", "exit 1");
  EXPECT_EQ(queue_.processors("nowhere"), 1U);
  std::string fault;
  make_program("squeue", "echo \"${3#--name=}|1|2|R|None\"");
  ASSERT_TRUE(queue_.tasks({"a", "b"}, fault));
  EXPECT_EQ(queue_.tasks({"a", "b"}, fault)->at(0).name, "a,b");
  make_program("squeue", "echo 'slurm_load_jobs error: Unable to contact slurm controller' >&2; exit 1");
  EXPECT_FALSE(queue_.tasks({"a"}, fault));
  EXPECT_EQ(fault, "slurm_load_jobs error: Unable to contact slurm controller");
  make_program("sbatch", "printf 'sbatch: error: one\\nsbatch: error: two\\n' >&2; exit 1");
  EXPECT_EQ(open_error_of([&] { queue_.submit({}); }), "sbatch: error: one; sbatch: error: two");
  make_program("scontrol", "exit 3");
  EXPECT_EQ(open_error_of([&] { queue_.limits(); }), "scontrol has ended with exit code 3");
}

TEST_F(SlurmPrograms, WithoutSlurmItsPackageIsNamed) {
  ::setenv("PATH", folder_.c_str(), 1);
  EXPECT_EQ(open_error_of([&] { queue_.limits(); }),
            "scontrol: No such file or directory: Slurm's commands must be in PATH (Debian: slurm-client)");
}

TEST_F(SlurmPrograms, ACommandIsRunToItsEnd) {
  const CommandOutput result =
      run_command({"sh", "-c", "head -c 300000 /dev/zero; head -c 200000 /dev/zero >&2; cat; exit 9"}, stop_);
  EXPECT_EQ(result.exit_code, 9);
  EXPECT_EQ(result.output.size(), 300'000U);
  EXPECT_EQ(result.errors.size(), 200'000U);
  EXPECT_EQ(run_command({"sh", "-c", "kill -KILL $$"}, stop_).exit_code, 128 + SIGKILL);
  // A stop ends one that would never end.
  make_program("waits", "echo waits; exec sleep 1000");
  std::jthread stopping([this] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    stop_ = true;
  });
  EXPECT_EQ(run_command({"waits"}, stop_).exit_code, 128 + SIGTERM);
}

}  // namespace
}  // namespace imud
