// What a capture contradicts in its configuration: faults after its end, a place beside [earth].
#include "emulator/truth/capture_check.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/emulator/run/run_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class CaptureCheck : public RunTest {
 protected:
  // 2 s of truth at 100 Hz.
  void SetUp() override {
    const ProgramResult made =
        run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "2", "--rate", "100"});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
  }
  // A configuration whose truth is live, with a fault that has these keys.
  std::string with_fault(const std::string& keys) const {
    const std::string toml =
        config("fast", "file:" + path("truth.csv"), "csv", 200, "csv", "file:" + path("{seed}.csv"));
    return write("fault.toml", read_file(toml) +
                                   "[[fault]]\nname = \"off\"\ntarget = \"gyro.x\"\nkind = \"bias\"\n"
                                   "value = 1\n" +
                                   keys);
  }
  // The exit code of a command with that fault; the output is in `text_`.
  int exit_code(const std::string& keys, std::vector<std::string> command) {
    command.insert(command.begin() + 1, with_fault(keys));
    const ProgramResult result = run_program("imud", command);
    text_ = result.output + result.errors;
    return result.exit_code;
  }
  std::string text_;
};

TEST_F(CaptureCheck, AFaultAfterTheEndIsRefused) {
  const std::string truth = path("truth.csv");
  const std::vector<std::vector<std::string>> commands = {{"check"},
                                                          {"check", truth},
                                                          {"check", truth, "--json"},
                                                          {"run"},
                                                          {"replay", truth, "--fast"},
                                                          {"replay", truth, "--seeds", "1..2"},
                                                          {"replay", truth}};
  for (const auto& command : commands) {
    EXPECT_EQ(exit_code("at_s = 7.5\n", command), 2) << text_;
    EXPECT_TRUE(contains(text_, "fault off: at_s = 7.5 is after the end of the capture")) << text_;
    EXPECT_TRUE(contains(text_, "which has 2 s of truth")) << text_;
  }
  for (const char* keys : {"at_s = 2.001\n", "at_s = {uniform = [2.5, 3]}\n", "at_s = 3\nprobability = 0.5\n"})
    EXPECT_EQ(exit_code(keys, {"check"}), 2) << keys;
  for (const char* keys : {"at_s = 7.5\noptional = true\n", "at_s = 2\n", "at_s = {uniform = [1, 3]}\n",
                           "at_s = {normal = [3, 1]}\n", "at_sample = 100000\n"})
    EXPECT_EQ(exit_code(keys, {"check", truth}), 0) << keys << text_;
}

// A capture on the command line of `check` must have truth; a replay of it says so itself.
TEST_F(CaptureCheck, ACaptureWithoutTruthIsRefused) {
  write("foo.csv", "time_s,foo\n0,1\n");
  write("empty.csv", "");
  write("flight.pcap", read_file(IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap"));
  const std::pair<std::string, std::string> captures[] = {
      {path("none.csv"), "No such file or directory"},
      {path("none.pcap"), "No such file or directory"},
      {path("."), "is not a regular file"},
      {"file:" + path("."), "is a directory"},
      {path("foo.csv"), "has no truth of the format csv: "},
      {path("empty.csv"), "has no truth of the format csv; give"},
      {path("flight.pcap") + "?port=9",
       "has no truth of the format csv: 2002 datagrams to port 5140 and none to 9; give"}};
  for (const auto& [capture, fault] : captures)
    for (const bool json : {false, true}) {
      std::vector<std::string> command = {"check", capture};
      if (json) command.emplace_back("--json");
      EXPECT_EQ(exit_code("optional = true\n", command), 2) << capture << text_;
      EXPECT_TRUE(contains(text_, fault)) << capture << text_;
    }
  // Without a capture on the command line, the file of truth.port may be made later.
  std::filesystem::remove(path("truth.csv"));
  EXPECT_EQ(exit_code("", {"check"}), 0) << text_;
}

// Standard input and a pipe can be read only once, by the run: check takes nothing of them.
TEST_F(CaptureCheck, APipeIsNotRead) {
  EXPECT_EQ(exit_code("", {"check", "-"}), 0) << text_;
  ASSERT_EQ(::mkfifo(path("fifo").c_str(), 0600), 0);
  EXPECT_EQ(exit_code("", {"check", "file:" + path("fifo")}), 0) << text_;
}

// A fault that begins too late in a pipe is a shortfall at the end of the run, because check cannot read ahead.
TEST_F(CaptureCheck, AnUnknownLengthIsNoFault) {
  const std::string toml = with_fault("at_s = 7.5\n");
  const ProgramResult piped =
      run_program("imud", {"replay", toml, "-", "--fast", "--set", "imu.0.port=file:" + path("out.csv")},
                  read_file(path("truth.csv")));
  EXPECT_EQ(piped.exit_code, 3) << piped.errors;
  EXPECT_TRUE(contains(piped.errors, "fault off has never begun")) << piped.errors;
}

// A simulator that starts again in a capture: no run of it is longer than the span of its times.
TEST_F(CaptureCheck, TwoRunsAreNotOneThatIsLonger) {
  std::string text = read_file(path("truth.csv"));
  const std::size_t head = text.find('\n') + 1;
  write("truth.csv", text + text.substr(head));
  EXPECT_EQ(exit_code("at_s = 2.5\n", {"check"}), 2) << text_;
  EXPECT_EQ(exit_code("at_s = 1.5\n", {"check"}), 0) << text_;
}

TEST_F(CaptureCheck, AContradictionOfThePlaceIsWarnedOf) {
  write("place.csv",
        "time_s,q_LB_w,q_LB_x,q_LB_y,q_LB_z,p_deg_per_s,q_deg_per_s,r_deg_per_s,specific_force_x_m_per_s2,"
        "specific_force_y_m_per_s2,specific_force_z_m_per_s2,latitude_deg,longitude_deg,height_m,v_north_m_per_s,"
        "v_east_m_per_s,v_down_m_per_s\n0,1,0,0,0,0,0,0,0,0,-9.81,47.5,8.5,500,0,0,0\n");
  const std::string toml = config("fast", "file:" + path("place.csv"), "csv", 200, "csv", "file:" + path("out.csv"));
  const std::string wrong = "earth.frame=local";
  const auto check = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"check", toml});
    const ProgramResult result = run_program("imud", more);
    EXPECT_EQ(result.exit_code, 0) << result.errors;
    return result.output;
  };
  const std::vector<std::string> elsewhere = {
      "--set", wrong, "--set", "earth.latitude_deg=47.5", "--set", "earth.longitude_deg=127.355"};
  const std::string text = check(elsewhere);
  EXPECT_TRUE(contains(text, "warning: truth: it is at latitude 47.500000, longitude 8.500000 deg by its own place"))
      << text;
  EXPECT_TRUE(contains(text, "the origin of N at 47.500000, 127.355000")) << text;
  std::vector<std::string> as_json = elsewhere;
  as_json.emplace_back("--json");
  EXPECT_EQ(nlohmann::json::parse(check(as_json))["warnings"].size(), 1U);
  EXPECT_FALSE(contains(check({}), "warning: truth"));
  // A capture on the command line takes the place of truth.port.
  as_json.insert(as_json.begin(), path("truth.csv"));
  EXPECT_EQ(nlohmann::json::parse(check(as_json))["warnings"].size(), 0U);
}

}  // namespace
}  // namespace imud
