// The golden logs: every CAN product sends the captured flight as it did, and imu-decode reads the same from it.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "protocols/protocol.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

const std::string golden = IMUD_TEST_DATA "/regression/can";

TEST_F(RunTest, TheGoldenLogsOfTheCanProducts) {
  const std::string flight_for_can = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap";
  std::vector<std::string> arguments = {"replay", golden + ".toml", flight_for_can, "--for", "0.6"};
  std::size_t products = 0;
  for (const Protocol* protocol : protocols()) {
    if (protocol->link != Link::can) continue;
    ++products;
    const std::string name(protocol->name);
    arguments.insert(arguments.end(), {"--set", "imu." + name + ".port=canfile:" + path(name)});
  }
  ASSERT_GE(products, 2U);
  const ProgramResult run = run_program("imud", arguments);
  ASSERT_EQ(run.exit_code, 3)
      << golden + ".toml needs an [[imu]] with the name of each CAN product; and the flight is longer\n"
      << run.errors;
  for (const Protocol* protocol : protocols()) {
    if (protocol->link != Link::can) continue;
    const std::string name(protocol->name), log = golden + "/" + name + ".log";
    const std::string expected = read_file(log);
    EXPECT_FALSE(expected.empty()) << log;
    EXPECT_TRUE(read_file(path(name)) == expected) << name;
    const ProgramResult decoded = run_program("imu-decode", {name, "canfile:" + log});
    EXPECT_EQ(decoded.exit_code, 0) << decoded.errors;
    EXPECT_GT(lines_of(decoded.output).size(), 5U) << name;
    EXPECT_TRUE(decoded.output == read_file(golden + "/" + name + ".csv")) << name;
  }
}

}  // namespace
}  // namespace imud
