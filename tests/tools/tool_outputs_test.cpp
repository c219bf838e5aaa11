// The outputs of the tools do not overwrite the files that the tools read.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class ToolOutputs : public testing::Test {
 protected:
  ToolOutputs() {
    std::filesystem::copy_file(IMUD_SOURCE_DIR "/emulator/presets/stim300.toml", model);
    std::ofstream(frames) << "frame_version = 1\nname = \"mine\"\n[[message]]\n"
                             "layout = [\"55 AA\", \"rate_x_deg_per_s:f32\"]\n";
    std::ofstream(plan) << "begin_s,end_s,rate_x_deg_per_s\n0,10,5\n";
    std::ofstream(data) << "no frames";
  }
  // The tool refuses the command line, and `file` stays as it is.
  static void expect_refused(const std::string& tool, const std::vector<std::string>& arguments,
                             const std::string& file, std::string_view cause) {
    const std::string before = read_file(file);
    const ProgramResult result = run_program(tool, arguments);
    EXPECT_EQ(result.exit_code, 2) << tool << result.errors;
    EXPECT_TRUE(contains(result.errors, cause)) << tool << result.errors;
    EXPECT_EQ(read_file(file), before) << tool;
  }
  ScratchFolder folder;
  const std::string model = folder / "model.toml", frames = folder / "frames.toml", plan = folder / "plan.csv",
                    data = folder / "data";
};

TEST_F(ToolOutputs, AreNotTheToolsInputs) {
  for (const std::string option : {"--json", "--hdf5", "--npy", "--mcap"})
    expect_refused("imu-decode", {"frame", "file:" + data, "--frame-file", frames, option, frames}, frames,
                   "is the file of frame_file; give another file");
  for (const std::string option : {"--json", "--data", "--to-config"}) {
    expect_refused("imu-allan", {"native", "file:" + data, "--against", model, option, model}, model,
                   "is the file of --against; give another file");
    expect_refused("imu-allan", {"frame", "file:" + data, "--frame-file", frames, option, frames}, frames,
                   "is the file of frame_file; give another file");
  }
  for (const std::string option : {"--json", "--to-config"})
    expect_refused("imu-fit", {"native", "file:" + data, "--dwells", plan, "--noise", model, option, model}, model,
                   "is the file of --noise; give another file");
  expect_refused("imu-fit", {"native", "file:" + data, "--dwells", plan, "--json", plan}, plan, "is the plan");
}

TEST_F(ToolOutputs, StayIfTheCommandLineIsWrong) {
  const std::string json = folder / "report.json";
  std::ofstream(json) << "old";
  expect_refused("imu-decode", {"native", "file:" + data, "--json", json, "--imu", "imu1"}, json, "--imu: is for");
}

// setrlimit(2): a write beyond RLIMIT_FSIZE raises SIGXFSZ, which ends a process that has not chosen otherwise.
TEST_F(ToolOutputs, ALimitOfFileSizesIsAnError) {
  for (const std::string& output : {"--csv " + (folder / "truth.csv"), "--csv - > " + (folder / "output.csv")}) {
    const ProgramResult result = run_program(
        "/bin/sh", {"-c", fmt::format("ulimit -f 8; exec {}/imu-truth spiral --for 100 {}", IMUD_BIN_DIR, output)});
    EXPECT_EQ(result.exit_code, 1) << output;
    EXPECT_TRUE(contains(result.errors, "File too large")) << result.errors;
  }
}

}  // namespace
}  // namespace imud
