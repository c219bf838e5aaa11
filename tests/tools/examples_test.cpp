// The recipes in tools/examples: each is a configuration that imud accepts.
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/tools/run_program.hpp"

namespace imud {
namespace {

TEST(Examples, ImudAcceptsEach) {
  std::size_t checked = 0;
  for (const auto& entry : std::filesystem::directory_iterator(IMUD_SOURCE_DIR "/tools/examples")) {
    const std::string path = entry.path().string();
    SCOPED_TRACE(path);
    const ProgramResult result = run_program("imud", {"check", path});
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    EXPECT_NE(result.output.find(" of the line's "), std::string::npos) << "the line or bus has a speed, and a load";
    const std::string text = read_file(path);
    EXPECT_NE(text.find("# Parameters of "), std::string::npos) << "the settings of the other side";
    EXPECT_EQ(text.find("imud pty --background imu1") != std::string::npos,
              text.find("\"pty:imu1\"") != std::string::npos)
        << "the other side survives a restart of imud";
    ++checked;
  }
  EXPECT_EQ(checked, 9U);
}

// The line is less loaded by two fields than by those that the device has as delivered.
TEST(Examples, ImudAcceptsAListAsTheHelpOfSetWritesIt) {
  const std::string list = "imu.0.device.sensor_fields=[\"rate\", \"acceleration\"]";
  std::string help;  // on one line
  for (const std::string& line : lines_of(run_program("imud", {"check", "--help"}).output))
    help += line.substr(std::min(line.find_first_not_of(' '), line.size())) + ' ';
  EXPECT_NE(help.find(list), std::string::npos) << help;
  const std::string example = IMUD_SOURCE_DIR "/tools/examples/ros-microstrain.toml";
  const ProgramResult plain = run_program("imud", {"check", example});
  const ProgramResult changed = run_program("imud", {"check", example, "--set", list});
  EXPECT_EQ(changed.exit_code, 0) << changed.errors;
  EXPECT_NE(changed.output, plain.output);
}

}  // namespace
}  // namespace imud
