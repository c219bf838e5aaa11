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

TEST_F(RunFiles, FiguresAreNotWrittenOverAnotherFileOfTheRun) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "1"}).exit_code, 0);
  const std::string c = config("fast", "file:" + path("truth.csv"), "csv", 100, "csv", "file:" + path("out.csv"));
  const std::string truth = read_file(path("truth.csv")), configuration = read_file(c);
  for (const std::string& file : {c, path("truth.csv"), path("out.csv"), path("./out.csv")})
    for (const std::string option : {"--summary", "--quality"}) {
      const ProgramResult refused = run_program("imud", {"run", c, option, file});
      EXPECT_EQ(refused.exit_code, 2) << option << file;
      EXPECT_NE(refused.errors.find(file + ": the run reads or writes this file already"), std::string::npos);
    }
  EXPECT_EQ(run_program("imud", {"run", c, "--summary", path("a"), "--quality", path("a")}).exit_code, 2);
  EXPECT_EQ(read_file(path("truth.csv")), truth);
  EXPECT_EQ(read_file(c), configuration);
  EXPECT_FALSE(std::filesystem::exists(path("out.csv")));
}

TEST_F(RunFiles, TheSummaryIsIncompleteUntilTheEnd) {
  const std::string c = config("realtime", "udp:127.0.0.1:5140", "jsbsim", 100, "csv", "file:/dev/null");
  const std::string capture = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap";
  Program imud("imud");
  imud.start({"replay", c, capture, "--summary", path("summary.json")});
  ASSERT_TRUE(eventually([&] { return !read_file(path("summary.json")).empty(); }));
  EXPECT_EQ(summary()["complete"], false);
  EXPECT_TRUE(summary()["ended_by"].is_null());
  imud.kill(SIGKILL);
  imud.wait();
  EXPECT_EQ(summary()["complete"], false) << "of a run that was killed";
  const ProgramResult printed = run_program("imud", {"replay", c, capture, "--fast", "--summary", "-"});
  EXPECT_EQ(printed.exit_code, 0);
  EXPECT_EQ(printed.output.find("\"complete\": false"), std::string::npos);
  EXPECT_NE(printed.output.find("\"complete\": true"), std::string::npos);
}

}  // namespace
}  // namespace imud
