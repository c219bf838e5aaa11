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
    EXPECT_NE(result.output.find("% of the line's"), std::string::npos) << "the line has a speed, and a load";
    const std::string text = read_file(path);
    EXPECT_NE(text.find("# Parameters of "), std::string::npos) << "the settings of the other side";
    EXPECT_NE(text.find("imud pty imu1"), std::string::npos) << "the other side survives a restart of imud";
    ++checked;
  }
  EXPECT_EQ(checked, 7U);
}

}  // namespace
}  // namespace imud
