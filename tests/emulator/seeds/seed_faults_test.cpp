// Faults that never begin, in replays with many seeds: named as in a single run.
#include <gtest/gtest.h>

#include <cstdint>
#include <set>

#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class SeedFaults : public RunTest {
 protected:
  void SetUp() override {
    const ProgramResult made =
        run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "1", "--rate", "100"});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
  }
  // Two imus, a1 and a2, and a fault on `imu` that begins when the rate is above `rate`.
  ProgramResult replay(const std::string& imu, const std::string& rate, const std::string& seeds,
                       const std::vector<std::string>& more = {}) {
    std::string text = "clock = \"fast\"\n[truth]\nport = \"file:none.csv\"\nformat = \"csv\"\n";
    for (const char* name : {"a1", "a2"})
      text += fmt::format(
          "[[imu]]\nname = \"{0}\"\nrate_hz = 100\nprotocol = \"csv\"\nport = \"file:{1}/{0}_{{seed}}.csv\"\n"
          "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n",
          name, folder_);
    text += fmt::format(
        "[[fault]]\nname = \"off\"\nimu = \"{}\"\ntarget = \"gyro.x\"\nkind = \"bias\"\nvalue = 1\n"
        "when = \"rate > {}\"\n",
        imu, rate);
    std::vector<std::string> arguments = {
        "replay", write("c.toml", text), path("truth.csv"),   "--seeds", seeds, "--jobs",
        "3",      "--summary",           path("summary.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program("imud", arguments);
  }
};

// With one seed and three jobs each imu has a process of its own; with eight, seeds run together.
TEST_F(SeedFaults, AFaultThatNeverBeginsIsNamed) {
  for (const std::string seeds : {"7", "1..8"})
    for (const std::string imu : {"*", "a1", "a2"}) {
      SCOPED_TRACE(seeds + " " + imu);
      const ProgramResult never = replay(imu, "1000", seeds, {"--labels", path("labels.csv")});
      EXPECT_EQ(never.exit_code, 3) << never.errors;
      EXPECT_TRUE(contains(never.errors, "is incomplete: fault off has never begun")) << never.errors;
      EXPECT_FALSE(summary()["complete"].get<bool>());
      const std::size_t runs = seeds == "7" ? 1 : 8;
      const nlohmann::json each = summary()["seeds"];
      ASSERT_EQ(each.size(), runs);
      for (const auto& seed : each) {
        EXPECT_EQ(seed["shortfalls"], nlohmann::json({"fault off has never begun"}));
        EXPECT_EQ(seed["exit_code"], 3);
        EXPECT_EQ(seed["faults"][0]["began"], false);
      }
      const std::vector<std::string> rows = lines_of(read_file(path("labels.csv")));
      ASSERT_EQ(rows.size(), 1 + runs * (imu == "*" ? 2 : 1));
      EXPECT_EQ(rows[1], (seeds == "7" ? "7,off," : "1,off,") + (imu == "*" ? "a1" : imu) +
                             ",gyro.x,bias,,,,,,,,,,,,never,,,");
      const ProgramResult begun = replay(imu, "0", seeds);
      EXPECT_EQ(begun.exit_code, 0) << begun.errors;
      const nlohmann::json each_begun = summary()["seeds"];
      for (const auto& seed : each_begun) {
        EXPECT_EQ(seed["faults"][0]["occurrences"], imu == "*" ? 2 : 1);
        EXPECT_EQ(seed["faults"][0]["began"], true);
      }
    }
}

// Each fifth sample of an lpms-ig1 has a message, counted from its start: a seed with more resets has more messages.
TEST_F(SeedFaults, AnArrayHasRoomForTheMessagesAfterResets) {
  const std::string text =
      "clock = \"fast\"\n[truth]\nport = \"file:none.csv\"\nformat = \"csv\"\n[[imu]]\nprotocol = \"lpms-ig1\"\n"
      "port = \"file:none.bin\"\ngyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n"
      "[[fault]]\ntarget = \"power\"\nkind = \"brown_out\"\nper_s = 10\noptional = true\n";
  const ProgramResult done =
      run_program("imud", {"replay", write("c.toml", text), path("truth.csv"), "--seeds", "1..24", "--npy",
                           path("a.npy"), "--summary", path("summary.json")});
  EXPECT_EQ(done.exit_code, 0) << done.errors;
  const nlohmann::json each = summary()["seeds"];
  ASSERT_EQ(each.size(), 24U);
  std::set<std::uint64_t> numbers;
  for (const auto& seed : each) numbers.insert(seed["imus"][0]["frames"].get<std::uint64_t>());
  EXPECT_GT(numbers.size(), 1U);
}

}  // namespace
}  // namespace imud
