// Other programs that are run to their end, several at the same time.
#include "emulator/programs/command_output.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

namespace imud {
namespace {

using namespace std::chrono_literals;

ProgramCall shell_call(const std::string& script, std::string input = {}) {
  return {{"sh", "-c", script}, std::move(input)};
}

class Programs : public ::testing::Test {
 protected:
  std::vector<CommandOutput> run(const std::vector<ProgramCall>& calls, std::optional<Nanoseconds> limit = {}) const {
    return run_commands(calls, limit, stop_);
  }
  std::atomic<bool> stop_ = false;
};

// Returns true once no process of that number runs; one that nobody has waited for counts as ended.
bool has_ended(pid_t process) {
  for (int i = 0; i < 6000; ++i) {
    std::ifstream file("/proc/" + std::to_string(process) + "/stat");
    std::string number, name, state;
    if (!(file >> number >> name >> state) || state == "Z") return true;
    std::this_thread::sleep_for(10ms);
  }
  return false;
}

TEST_F(Programs, RunAtTheSameTime) {
  // The first one ends after the second one has begun.
  std::string fifo = "/tmp/imud_programs.XXXXXX";
  ASSERT_NE(::mkdtemp(fifo.data()), nullptr);
  const std::string path = fifo + "/fifo";
  const auto outputs = run({shell_call("mkfifo " + path + "; cat " + path),
                            shell_call("while [ ! -p " + path + " ]; do sleep 0.01; done; echo second > " + path),
                            {{"imud-no-such-program"}, {}}});
  EXPECT_EQ(outputs[0].output, "second\n");
  EXPECT_EQ(outputs[1].exit_code, 0);
  EXPECT_EQ(outputs[2].exit_code, 127);
  EXPECT_EQ(outputs[2].errors, "imud-no-such-program: No such file or directory");
  ::unlink(path.c_str());
  ::rmdir(fifo.c_str());
}

TEST_F(Programs, HaveAnInput) {
  const std::string large(1'000'000, 'x');
  const auto outputs =
      run({shell_call("cat", large), shell_call("exec <&-; exit 4", large), shell_call("cat; wc -c")});
  EXPECT_EQ(outputs[0].output, large);
  EXPECT_EQ(outputs[1].exit_code, 4) << "one that reads nothing";
  EXPECT_EQ(outputs[2].output, "0\n");
}

TEST_F(Programs, AreKilledAfterTheLimitWithTheirChildren) {
  const auto outputs =
      run({shell_call("sleep 1000 & echo $!; wait"), shell_call("trap '' TERM; echo here; sleep 1000")}, 5s);
  for (const CommandOutput& one : outputs) {
    EXPECT_TRUE(one.is_late);
    EXPECT_EQ(one.exit_code, 128 + SIGKILL);
  }
  EXPECT_EQ(outputs[1].output, "here\n");
  EXPECT_TRUE(has_ended(std::stoi(outputs[0].output)));
}

// As ssh's connection for later calls does.
TEST_F(Programs, DoNotWaitForAChildThatHoldsTheOutput) {
  const CommandOutput output = run({shell_call("sleep 1000 & echo $!")}).front();
  EXPECT_EQ(output.exit_code, 0);
  EXPECT_FALSE(output.is_late);
  ASSERT_FALSE(output.output.empty());
  EXPECT_EQ(::kill(std::stoi(output.output), SIGKILL), 0) << "the child still runs";
}

}  // namespace
}  // namespace imud
