// The scenarios of tools/scenarios.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/faults/faulty_run.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class ScenariosTest : public FaultyRunTest {};

// Each can be added to a configuration, names its source, and is in the list; on the flight the faults that begin in
// its ten seconds act, and the others do not.
TEST_F(ScenariosTest, CanBeRun) {
  const std::filesystem::path folder = IMUD_SOURCE_DIR "/tools/scenarios";
  const std::string list = read_file((folder / "README.md").string());
  std::set<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".toml") files.insert(entry.path());
  ASSERT_GE(files.size(), 20U);
  for (const std::filesystem::path& file : files) {
    SCOPED_TRACE(file);
    const std::string text = read_file(file.string());
    const auto lines = lines_of(text);
    ASSERT_GT(lines.size(), 5U);
    EXPECT_TRUE(lines[0].starts_with("# ") && lines[0].ends_with(".")) << lines[0];
    EXPECT_TRUE(lines[1].starts_with("# Source: ")) << lines[1];
    const std::string stem = file.stem().string(), title = lines[0].substr(2, lines[0].size() - 3);
    EXPECT_TRUE(contains(list, fmt::format("| [{0}]({0}.toml) | {1} |\n", stem, title))) << title;
    const std::string scenario = file.string();
    const std::string config =
        write("run.toml", config_text("", "native", 2,
                                      "rate_hz = 100\nmodel = \"ideal\"\ngyro.max_deg_per_s = 400\n"
                                      "accelerometer.max_g = 30\n"));
    const Config read = load_config(config, {}, {}, std::span(&scenario, 1));
    EXPECT_GE(read.faults.size(), 1U);
    std::size_t acting = 0;
    for (const FaultConfig& fault : read.faults)
      if (fault.begin_s.a <= 10 && fault.condition.quantity == FaultCondition::Quantity::none)
        acting += fault.imus.size();
    const Result result = run(text, "native", 2);
    EXPECT_EQ(result.labels.size(), acting);
    EXPECT_GT(result.frames.size(), 4000U);
  }
}

}  // namespace
}  // namespace imud
