// Runs whose CAN frames go to a log, without a bus.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

const std::string can_flight = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap";

class CanLogRun : public RunTest {
 protected:
  // Replays the flight as fast as possible to `port` and returns what standard output had.
  std::string replay(const std::string& port, const std::vector<std::string>& options = {}) const {
    const std::string c = config("fast", "udp:127.0.0.1:5140", "jsbsim", 150, "native-can", port);
    std::vector<std::string> arguments = {"replay", c, can_flight, "--summary", path("summary.json")};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const ProgramResult run = run_program("imud", arguments);
    EXPECT_EQ(run.exit_code, 0) << run.errors;
    return run.output;
  }
};

TEST_F(CanLogRun, TheSameRunMakesTheSameLog) {
  for (const char* name : {"x.log", "x.asc"}) {
    const std::string log = path(name);
    replay("canfile:" + log);
    EXPECT_EQ(summary()["imus"][0]["frames"], 10507);
    EXPECT_FALSE(std::filesystem::exists(log + ".incomplete"));
    const std::string first = read_file(log);
    EXPECT_EQ(lines_of(first).size(), 10507U + (first.starts_with("date") ? 3 : 0));
    replay("canfile:" + log);
    EXPECT_TRUE(read_file(log) == first);
  }
  EXPECT_TRUE(replay("canfile:-") == read_file(path("x.log"))) << "standard output";
}

TEST_F(CanLogRun, TheLogDecodesToTheNumbersOfTheRunAtTheTimesOfItsSamples) {
  const std::string c = config("fast", "udp:127.0.0.1:5140", "jsbsim", 150, "csv", "file:" + path("ideal.csv"));
  ASSERT_EQ(run_program("imud", {"replay", c, can_flight}).exit_code, 0);
  const auto expected = rows(read_file(path("ideal.csv")));
  ASSERT_EQ(expected.size(), 1501U);
  for (const std::string name : {"x.log", "x.asc"}) {
    replay("canfile:" + path(name), {"--set", "imu.0.clock_error_ppm=0"});
    const ProgramResult decode =
        run_program("imu-decode", {"native-can", "canfile:" + path(name), "--json", path("report.json")});
    ASSERT_EQ(decode.exit_code, 0) << decode.errors;
    const auto all = rows(decode.output);
    ASSERT_EQ(all.size(), expected.size());
    for (std::size_t k = 0; k < all.size(); ++k)
      for (std::size_t field = 2; field < 5; ++field)
        EXPECT_NEAR(std::stod(all[k][field]), std::stod(expected[k][field]), std::ldexp(1.0, -23)) << k;
    const auto report = nlohmann::json::parse(read_file(path("report.json")));
    EXPECT_NEAR(report["rate_hz"]["arrival"].get<double>(), 150, 1e-3) << "the frames have the times of the samples";
  }
  // Stamps are those of the device, in us.
  const auto lines = lines_of(read_file(path("x.log")));
  for (const std::size_t k : {0U, 1U, 700U, 1500U}) {
    const std::int64_t us = std::stoll(expected[k][0]) / 1000;
    for (std::size_t i = 7 * k; i < 7 * k + 7; ++i)
      EXPECT_TRUE(lines[i].starts_with(fmt::format("({:010}.{:06}) can0 ", us / 1'000'000, us % 1'000'000)))
          << lines[i];
  }
}

TEST_F(CanLogRun, ImuDecodeReadsALogFromStandardInput) {
  replay("canfile:" + path("x.log"));
  const ProgramResult shell = run_program(
      "/bin/sh", {"-c", fmt::format("{}/imu-decode native-can - < {} && cat {} | {}/imu-decode native-can -",
                                    IMUD_BIN_DIR, path("x.log"), path("x.log"), IMUD_BIN_DIR)});
  EXPECT_EQ(shell.exit_code, 0) << shell.errors;
  EXPECT_EQ(rows(shell.output).size(), 2U * 1501);
}

TEST_F(CanLogRun, ALogIsNoTruth) {
  const std::string c = config("fast", "canfile:" + path("x.log"), "csv", 150, "native-can", "canfile:" + path("y"));
  const ProgramResult check = run_program("imud", {"check", c});
  EXPECT_EQ(check.exit_code, 2);
  EXPECT_NE(check.errors.find("truth.port"), std::string::npos) << check.errors;
}

}  // namespace
}  // namespace imud
