// The system under test beside the cases of a campaign: what it reads, what joins the row, and its end.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "emulator/campaign/cases/test_command.hpp"
#include "emulator/campaign/cases/test_metrics.hpp"
#include "emulator/campaign/shards/result_folder.hpp"
#include "tests/emulator/campaign/campaign_test.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class TestedCases : public CampaignWithResults {
 protected:
  // Runs four seeds, with the command if there is one.
  ProgramResult run(const std::string& folder, const std::string& command, const std::string& limit_s = "60") const {
    std::string text = head + "seeds = \"1..4\"\nbatch = 4\n";
    if (!command.empty()) text += fmt::format("[test]\ntime_limit_s = {}\ncommand = '''{}'''\n", limit_s, command);
    return run_program("imud", {"campaign", "run", write("plan.toml", text), "--into", path(folder), "--jobs", "4"});
  }
};

TEST_F(TestedCases, TheCommandReadsAllBytesAndItsMetricsJoinTheRow) {
  ASSERT_EQ(run("alone", "").exit_code, 0);
  const ProgramResult done = run("tested", R"(cat {port} > bytes_{case}
printf '{"size": %d, "seed": {seed}}' $(wc -c < bytes_{case}) > {metrics})");
  EXPECT_EQ(done.exit_code, 0) << done.errors;
  const std::vector<nlohmann::json> alone = rows("alone"), tested = rows("tested");
  ASSERT_EQ(tested.size(), 4U);
  for (std::size_t i = 0; i < tested.size(); ++i) {
    const std::string bytes = read_file(path(fmt::format("bytes_{}", i)));
    Sha256Stream digest;
    digest.add(bytes);
    EXPECT_EQ(tested[i]["digest"]["imu1"], digest.end());
    EXPECT_EQ(tested[i]["digest"], alone[i]["digest"]);
    EXPECT_EQ(tested[i]["test"],
              nlohmann::json(
                  {{"exit_code", 0}, {"timed_out", false}, {"metrics", {{"size", bytes.size()}, {"seed", i + 1}}}}));
    EXPECT_NE(tested[i]["identity"], alone[i]["identity"]);
    EXPECT_FALSE(alone[i].contains("test"));
  }
}

// By the clock `fast` the two seconds take a few milliseconds. Samples of a machine that stalls are late, not
// skipped.
TEST_F(TestedCases, InRealTimeSamplesLeaveAtTheSensorsPace) {
  std::string truth = truth_rows.substr(0, truth_rows.find('\n') + 1);
  for (int i = 0; i <= 200; ++i) truth += fmt::format("{}0000000,0,0,0,0,0,0,0,0,-9.8\n", i);
  write("truth.csv", truth);
  const std::string plan = write("plan.toml", head + R"(seeds = "1..2"
set = "realtime.skip_after_ms=600000"
integrated_errors = true
[test]
clock = "realtime"
time_limit_s = 600
command = "cat {port} > bytes_{case}; echo '{\"seed\": {seed}}' > {metrics}"
)");
  const auto begin = std::chrono::steady_clock::now();
  const ProgramResult done = run_program("imud", {"campaign", "run", plan, "--into", path("runs"), "--jobs", "2"});
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));
  EXPECT_EQ(done.exit_code, 0) << done.errors;
  const std::vector<nlohmann::json> all = rows("runs");
  ASSERT_EQ(all.size(), 2U);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const nlohmann::json& figures = all[i]["figures"];
    EXPECT_EQ(figures.value("imu1.samples", 0), 201);
    for (const char* name : {"imu1.missed", "imu1.lateness_us.p99", "imu1.lateness_us.max"})
      EXPECT_GE(figures.value(name, -1.0), 0) << name;
    EXPECT_LT(std::abs(figures.value("imu1.angle_error_x_rad", 1.0)), 2e-3) << "eight times the random walk";
    EXPECT_EQ(all[i]["test"]["metrics"]["seed"], i + 1);
    EXPECT_GT(std::filesystem::file_size(path(fmt::format("bytes_{}", i))), 0U);
  }
  // Its lateness is another one each time.
  EXPECT_EQ(run_program("imud", {"campaign", "repeat", path("runs"), "0"}).exit_code, 0);
}

TEST_F(TestedCases, AFailureIsAShortfall) {
  const ProgramResult done = run("runs", "cat {port} > /dev/null; echo 5 > {metrics}; test {seed} -lt 3");
  EXPECT_EQ(done.exit_code, 3) << done.errors;
  const std::vector<nlohmann::json> all = rows("runs");
  ASSERT_EQ(all.size(), 4U);
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::vector<std::string> shortfalls;
    if (i >= 2) shortfalls.emplace_back("the test has ended with 1");
    shortfalls.emplace_back(
        "the metrics of the test: line 1: is a JSON number; write a JSON object, such as {\"error_deg\": 0.1}");
    EXPECT_EQ(all[i]["shortfalls"], nlohmann::json(shortfalls));
    EXPECT_EQ(all[i]["exit_code"], 3);
    EXPECT_EQ(all[i]["test"]["exit_code"], i < 2 ? 0 : 1);
  }
}

TEST_F(TestedCases, MetricsThatAreNoJsonAreNamedWithTheirPlace) {
  const ProgramResult done = run("runs", R"(cat {port} > /dev/null; printf '{"b": {seed},\n "a": NaN}' > {metrics})");
  EXPECT_EQ(done.exit_code, 3);
  const std::string fault =
      "the metrics of the test: line 2, column 7: `NaN` is no value of JSON; write null, or leave it out";
  EXPECT_EQ(rows("runs").at(2)["shortfalls"], nlohmann::json({fault}));
  EXPECT_TRUE(contains(done.errors, "case 2: " + fault)) << done.errors;
}

TEST(TestMetrics, FaultsHaveTheirPlaceAndTheRemedy) {
  const auto fault_of = [](const std::string& text) {
    std::string fault;
    const auto metrics = read_metrics(text, fault);
    EXPECT_EQ(fault.empty(), metrics.is_object()) << text;
    return fault;
  };
  EXPECT_EQ(fault_of("{\"a\": 1, \"b\": null}\n"), "");
  const std::string nan = "is no value of JSON; write null, or leave it out",
                    remedy = "; write a JSON object, such as {\"error_deg\": 0.1}";
  EXPECT_EQ(fault_of("{\"a\": -nan}"), "line 1, column 7: `-nan` " + nan);
  EXPECT_EQ(fault_of("{\"a\": 1,\n\n \"b\": [0, -Infinity]}"), "line 3, column 11: `-Infinity` " + nan);
  EXPECT_EQ(fault_of("nan"), "line 1, column 1: `nan` " + nan);
  EXPECT_EQ(fault_of("{\"a\":\n1e999}"),
            "line 2, column 1: `1e999` is beyond the range of a double; write null, or leave it out");
  EXPECT_EQ(fault_of("[1]"), "line 1: is a JSON array" + remedy);
  EXPECT_TRUE(contains(fault_of(""), "line 1, column 1: syntax error while parsing value - unexpected end of input"));
  EXPECT_EQ(
      fault_of("{'a': 1}"),
      "line 1, column 2: syntax error while parsing object key - invalid literal; expected string literal" + remedy);
  EXPECT_TRUE(fault_of("{\"a\": 1").ends_with("expected '}'" + remedy)) << fault_of("{\"a\": 1");
}

// The command does not end, nor does a process that it has started. On a busy machine the start of all takes a
// second.
TEST_F(TestedCases, TheGroupIsKilledAtTheTimeLimit) {
  const ProgramResult done =
      run("runs", "sh -c 'echo $$ > child_{case}; exec sleep 1000' & cat {port} > /dev/null; wait", "4");
  EXPECT_EQ(done.exit_code, 3) << done.errors;
  const std::vector<nlohmann::json> all = rows("runs");
  ASSERT_EQ(all.size(), 4U);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i]["shortfalls"], nlohmann::json({"the test was killed after 4 s"}));
    EXPECT_EQ(all[i]["test"]["exit_code"], 128 + SIGKILL);
    EXPECT_EQ(all[i]["test"]["timed_out"], true);
    const pid_t child = std::stoi(read_file(path(fmt::format("child_{}", i))));
    // Until its new parent has waited for it, its number remains.
    const std::string state = read_file(fmt::format("/proc/{}/stat", child));
    EXPECT_TRUE(state.empty() || contains(state, ") Z ")) << state;
  }
}

TEST_F(TestedCases, ACommandThatNeverReadsDoesNotHoldTheCase) {
  const ProgramResult done = run("runs", "exit 7");
  EXPECT_EQ(done.exit_code, 3) << done.errors;
  for (const nlohmann::json& row : rows("runs")) {
    EXPECT_EQ(row["test"]["exit_code"], 7);
    EXPECT_EQ(row["shortfalls"].at(0), "the test has not opened {port}") << row;
    EXPECT_EQ(row["shortfalls"].at(1), "the test has ended with 7") << "before the frames that nobody has read";
  }
  EXPECT_TRUE(contains(done.errors, "case 0: the test has not opened {port}")) << done.errors;
}

// A driver that discards its input after it has opened the port: when it has some, or 0.2 s later.
TEST_F(TestedCases, ADriverThatSettlesLosesNothing) {
  write("driver.py", R"(import os, select, sys, termios
port = os.open(sys.argv[1], os.O_RDONLY | os.O_NOCTTY)
with open("bytes", "wb") as file:
    try:
        select.select([port], [], [], float(sys.argv[2]))
        termios.tcflush(port, termios.TCIFLUSH)
        while data := os.read(port, 4096):
            file.write(data)
    except (OSError, termios.error):
        pass  # the other side has ended
)");
  for (const bool settles : {false, true}) {
    const std::string plan =
        write("plan.toml",
              head + fmt::format("seeds = 1\n[test]\nsettle_s = {}\ncommand = \"python3 driver.py {{port}} {}\"\n",
                                 settles ? 5 : 0, settles ? 0.2 : 60));
    const std::string into = path(settles ? "settled" : "hasty");
    const ProgramResult done = run_program("imud", {"campaign", "run", plan, "--into", into});
    EXPECT_EQ(done.exit_code, 0) << done.errors;
    const std::vector<nlohmann::json> all = rows(settles ? "settled" : "hasty");
    ASSERT_EQ(all.size(), 1U);
    Sha256Stream digest;
    digest.add(read_file(path("bytes")));
    EXPECT_EQ(all[0]["digest"]["imu1"] == digest.end(), settles);
  }
}

// Returns the processes that have the variable KEPT=`mark` in their environment.
std::vector<std::string> processes_with(const std::string& mark) {
  std::vector<std::string> all;
  std::error_code gone;
  for (const auto& process : std::filesystem::directory_iterator("/proc", gone))
    if (contains(read_file(process.path() / "environ"), "KEPT=" + mark)) all.push_back(process.path().filename());
  return all;
}

// Waits until all of them have ended, for half a minute at most. Returns those that have not.
std::vector<std::string> left_of(const std::string& mark) {
  std::vector<std::string> left;
  for (int i = 0; i < 300 && !(left = processes_with(mark)).empty(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  return left;
}

// A process of the command that has left its group ends with it, and so does all of it with imud, however that ends.
TEST_F(TestedCases, NothingOfTheCommandIsLeftBehind) {
  const std::string mark = fmt::format("{}-left", ::getpid()), scratch = path("scratch");
  std::filesystem::create_directory(scratch);
  const std::string plan = write("plan.toml", head + R"(seeds = "1..4"
batch = 4
[test]
command = "setsid sleep 1000 & sleep 1000 & cat {port} > /dev/null; test {seed} = 1 || { echo > begun; sleep 1000; }"
)");
  const SetVariable folder("TMPDIR", scratch), kept("KEPT", mark);
  for (const bool kills_worker : {false, true}) {
    Program program("imud");
    program.start({"campaign", "run", plan, "--into", path("runs"), "--jobs", "1"});
    // The first case has ended, and nothing of it is left; the second one sleeps: imud, a worker, the supervisor, the
    // shell, and three processes of the shell.
    constexpr std::size_t all = 7;
    const auto is_asleep = [&] {
      return std::filesystem::exists(path("begun")) && processes_with(mark).size() == all;
    };
    for (int i = 0; i < 600 && !is_asleep(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_EQ(processes_with(mark).size(), all);
    std::filesystem::remove(path("begun"));
    const std::vector<pid_t> workers = children_of(program.pid());
    ASSERT_EQ(workers.size(), 1U);
    if (kills_worker) ::kill(workers[0], SIGKILL);
    program.kill(SIGKILL);
    EXPECT_EQ(program.wait(), 128 + SIGKILL);
    EXPECT_EQ(left_of(mark), std::vector<std::string>());
    EXPECT_TRUE(std::filesystem::is_empty(scratch));
  }
}

// The folder for the files of a case is removed whenever its worker is killed: before the command has begun, too.
TEST_F(TestedCases, AKilledWorkerLeavesNoFolder) {
  const std::string mark = fmt::format("{}-killed", ::getpid()), scratch = path("scratch");
  std::filesystem::create_directory(scratch);
  const std::string plan =
      write("plan.toml", head + "seeds = \"1..5000\"\n[test]\ncommand = \"cat {port} > /dev/null\"\n");
  const SetVariable folder("TMPDIR", scratch), kept("KEPT", mark);
  Program program("imud");
  program.start({"campaign", "run", plan, "--into", path("runs"), "--jobs", "1"});
  std::mt19937 random(5);
  constexpr int kills = 40;  // of at most two workers of a case
  pid_t last = 0;
  for (int i = 0; i < kills; ++i) {
    std::vector<pid_t> workers;
    const auto is_new = [&] {
      workers = children_of(program.pid());
      return workers.size() == 1 && workers[0] != last;
    };
    for (int k = 0; k < 30000 && !is_new(); ++k) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ASSERT_TRUE(is_new()) << i;
    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 20));
    ASSERT_EQ(::kill(last = workers[0], SIGKILL), 0) << i;
  }
  program.kill(SIGKILL);
  EXPECT_EQ(program.wait(), 128 + SIGKILL);
  EXPECT_EQ(left_of(mark), std::vector<std::string>());
  EXPECT_TRUE(std::filesystem::is_empty(scratch));
}

// More cases than the log names.
TEST_F(TestedCases, CasesWithoutAFolderCouldNotBeRun) {
  write("plan.toml", head + "seeds = \"1..12\"\n[test]\ncommand = \"cat {port}\"\n");
  const SetVariable folder("TMPDIR", path("none"));
  const ProgramResult done = CampaignWithResults::run("runs");
  EXPECT_EQ(done.exit_code, 1);
  EXPECT_TRUE(contains(done.errors, "a folder for the files of a test: No such file or directory")) << done.errors;
  EXPECT_TRUE(contains(done.output, "12 could not be run, 0 incomplete")) << done.output;
}

TEST(TestCommands, AValueIsReplacedOnceAndStaysOneWord) {
  EXPECT_EQ(with_values("a {x} {y} {z {x}", {{"x", "{y}"}, {"y", "1"}}), "a '{y}' 1 {z '{y}'");
  const std::map<std::string, std::string> value = {{"x", "a 'b' $c"}};
  EXPECT_EQ(with_values("{x} \"{x}\" '{x}' \\\"{x}", value),
            R"('a '\''b'\'' $c' "a 'b' \$c" 'a '\''b'\'' $c' \"'a '\''b'\'' $c')");
}

TEST_F(TestedCases, AFolderWithABlankIsOneWord) {
  const std::string scratch = path("with 'a' blank");
  std::filesystem::create_directory(scratch);
  const SetVariable folder("TMPDIR", scratch);
  const ProgramResult done = run("runs", R"(cat "{port}" > /dev/null; echo {} > '{metrics}')");
  EXPECT_EQ(done.exit_code, 0) << done.errors;
  EXPECT_EQ(rows("runs").size(), 4U);
}

}  // namespace
}  // namespace imud
