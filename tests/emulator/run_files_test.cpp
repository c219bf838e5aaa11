// The files that a run writes beside the sensors' output.
#include "tests/emulator/run_test.hpp"

namespace imud {
namespace {

using RunFiles = RunTest;

TEST_F(RunFiles, ASummaryThatCannotBeWrittenIsReportedBeforeTheRun) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "1"}).exit_code, 0);
  const std::string c = config("fast", "file:" + path("truth.csv"), "csv", 100, "csv", "file:" + path("out.csv"));
  const ProgramResult good = run_program("imud", {"run", c, "--summary", path("summary.json")});
  EXPECT_EQ(good.exit_code, 0) << good.errors;
  EXPECT_EQ(summary()["imus"][0]["samples"], 101);
  std::filesystem::remove(path("out.csv"));

  const ProgramResult result = run_program("imud", {"run", c, "--summary", path("none/summary.json")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.errors.find(path("none/summary.json")), std::string::npos) << result.errors;
  EXPECT_FALSE(std::filesystem::exists(path("out.csv"))) << "a run whose summary is lost is not begun";
}

}  // namespace
}  // namespace imud
