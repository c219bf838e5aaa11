// The files that a run writes beside the sensors' output.
#include <fcntl.h>

#include <regex>

#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

using RunFiles = RunTest;

// The options of `run` that name a file to be written; an input's may be repeated.
std::vector<std::string> file_options() {
  const std::string help = run_program("imud", {"run", "--help"}).output;
  std::vector<std::string> all;
  const std::regex option("(--[a-z0-9-]+) FILE(?! \\.\\.\\.)");
  for (std::sregex_iterator found(help.begin(), help.end(), option), end; found != end; ++found)
    all.push_back((*found)[1].str());
  EXPECT_GE(all.size(), 5U) << help;
  return all;
}

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
  for (const auto& [file, use] :
       {std::pair(c, "the configuration"), std::pair(path("truth.csv"), "the truth"),
        std::pair(path("out.csv"), "imu.0.port"), std::pair(path("./out.csv"), "imu.0.port")})
    for (const std::string& option : file_options()) {
      const ProgramResult refused = run_program("imud", {"run", c, option, file});
      EXPECT_EQ(refused.exit_code, 2) << option << file;
      EXPECT_NE(refused.errors.find(file + ": is the file of " + use + "; give another file"), std::string::npos)
          << refused.errors;
    }
  EXPECT_EQ(run_program("imud", {"run", c, "--summary", path("a"), "--quality", path("a")}).exit_code, 2);
  EXPECT_EQ(read_file(path("truth.csv")), truth);
  EXPECT_EQ(read_file(c), configuration);
  EXPECT_FALSE(std::filesystem::exists(path("out.csv")));
}

// Neither an option nor a port writes over a file that the configuration or the command line names as an input.
TEST_F(RunFiles, AFileThatTheConfigurationNamesIsNotWrittenOver) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "1"}).exit_code, 0);
  const std::string c = config("fast", "file:" + path("truth.csv"), "csv", 100, "csv", "file:" + path("out.csv"));
  const std::string model = write("mine.toml",
                                  "# mine\n# no document\n[imu.gyro]\nmax_deg_per_s = 400\n[imu.accelerometer]\n"
                                  "max_g = 10\n");
  const std::string token = write("token", "0123456789abcdef\n"), scenario = write("scenario.toml", "fault = []\n");
  const std::vector<std::string> run = {"run",        c,
                                        "--set",      "imu.0.model=" + model,
                                        "--set",      "web.listen=127.0.0.1:0",
                                        "--set",      "web.token_file=" + token,
                                        "--scenario", scenario};
  for (const auto& [file, use] :
       {std::pair(model, "imu.0.model"), {token, "web.token_file"}, {scenario, "a scenario"}}) {
    const std::string content = read_file(file);
    std::vector<std::vector<std::string>> writers = {{"--set", "imu.0.port=file:" + file},
                                                     {"--set", fmt::format("imu.0.also=[\"file:{}\"]", file)}};
    for (const std::string& option : file_options()) writers.push_back({option, file});
    for (const std::vector<std::string>& writer : writers) {
      std::vector<std::string> arguments = run;
      arguments.insert(arguments.end(), writer.begin(), writer.end());
      const ProgramResult refused = run_program("imud", arguments);
      EXPECT_EQ(refused.exit_code, 2) << writer[0] << file;
      EXPECT_NE(refused.errors.find(fmt::format("is the file of {}; give another", use)), std::string::npos)
          << refused.errors;
      EXPECT_EQ(read_file(file), content) << writer[0];
    }
  }
}

TEST_F(RunFiles, AnEmptyNameIsNoFile) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "1"}).exit_code, 0);
  const std::string c = config("fast", "file:" + path("truth.csv"), "csv", 100, "csv", "file:" + path("out.csv"));
  std::vector<std::string> options = file_options();
  options.emplace_back("--npy");
  for (const std::string& option : options) {
    const ProgramResult refused = run_program("imud", {"replay", c, path("truth.csv"), "--fast", option, ""});
    EXPECT_EQ(refused.exit_code, 2) << option;
    EXPECT_NE(refused.errors.find(option + ": give a file"), std::string::npos) << refused.errors;
  }
  for (const char* command : {"replay", "check"}) {
    const ProgramResult refused = run_program("imud", {command, c, ""});
    EXPECT_EQ(refused.exit_code, 2) << command;
    EXPECT_NE(refused.errors.find("CAPTURE: give a file"), std::string::npos) << refused.errors;
  }
  EXPECT_FALSE(std::filesystem::exists(path("out.csv")));
}

// An option whose file nothing opens, or nothing writes, compiles.
TEST_F(RunFiles, EveryOptionThatNamesAFileWritesIt) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "1"}).exit_code, 0);
  std::vector<std::string> arguments = {
      "run", config("fast", "file:" + path("truth.csv"), "csv", 100, "csv", "file:" + path("out.csv"))};
  for (const std::string& option : file_options()) arguments.insert(arguments.end(), {option, path(option)});
  const ProgramResult result = run_program("imud", arguments);
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  for (const std::string& option : file_options()) {
    ASSERT_TRUE(std::filesystem::exists(path(option))) << option;
    EXPECT_GT(std::filesystem::file_size(path(option)), 0U) << option;
  }
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

class ReplayedFiles : public RunTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--for", "3"}).exit_code, 0);
    config_ = config("fast", "file:" + path("truth.csv"), "csv", 100, "csv", "file:" + path("out"));
    write("out", "old");
  }
  ProgramResult replay(const std::string& capture, const std::vector<std::string>& more = {},
                       std::optional<std::string> input = {}) const {
    std::vector<std::string> arguments = {"replay", config_, capture};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program("imud", arguments, std::move(input));
  }
  std::size_t samples() const { return rows(read_file(path("out"))).size(); }
  bool is_left_alone() const {
    return read_file(path("out")) == "old" && !std::filesystem::exists(path("out.incomplete"));
  }
  std::string config_;
};

TEST_F(ReplayedFiles, AReplayThatFailsLeavesTheOldOutput) {
  write("empty.csv", lines_of(read_file(path("truth.csv")))[0] + "\n");
  EXPECT_EQ(replay(path("empty.csv")).exit_code, 1);
  EXPECT_TRUE(is_left_alone()) << "no truth";
  EXPECT_EQ(replay(path("none.csv")).exit_code, 2);
  EXPECT_TRUE(is_left_alone()) << "no capture";
  std::ofstream(config_, std::ios::app) << "[[imu]]\nrate_hz = 100\nprotocol = \"csv\"\nport = \"file:/none/out\"\n"
                                        << "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\n";
  EXPECT_EQ(replay(path("truth.csv")).exit_code, 2);
  EXPECT_TRUE(is_left_alone()) << "another imu's port";
}

TEST_F(ReplayedFiles, AReplayThatHasEndedReplacesTheOldOutputEvenIfIncomplete) {
  EXPECT_EQ(replay(path("truth.csv")).exit_code, 0);
  EXPECT_EQ(samples(), 301U);
  EXPECT_EQ(replay(path("truth.csv"), {"--for", "1"}).exit_code, 3);
  EXPECT_EQ(samples(), 101U);
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("long.csv"), "--for", "1000"}).exit_code, 0);
  Program paced("imud");
  paced.start({"replay", config_, path("long.csv"), "--set", "clock=realtime"});
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(path("out.incomplete")); }));
  EXPECT_EQ(samples(), 101U);
  const ProgramResult second = replay(path("truth.csv"));
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_NE(second.errors.find("another process writes it, as " + path("out.incomplete")), std::string::npos)
      << second.errors;
  EXPECT_EQ(paced.stop(), 3);
  EXPECT_NE(samples(), 101U);
  EXPECT_FALSE(std::filesystem::exists(path("out.incomplete")));
}

TEST_F(ReplayedFiles, TheIncompleteFileIsNoInput) {
  std::filesystem::rename(path("truth.csv"), path("out.incomplete"));
  const ProgramResult refused = replay("file:" + path("out.incomplete"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.errors.find("imu.0.port: is written as another file first, which is the file of the truth"),
            std::string::npos)
      << refused.errors;
  EXPECT_EQ(run_program("imud", {"run", config_, "--set", "truth.port=file:" + path("out.incomplete")}).exit_code, 0);
}

// A dash is standard input or output everywhere.
TEST_F(ReplayedFiles, ACaptureFromStandardInput) {
  const std::string csv = read_file(path("truth.csv"));
  EXPECT_EQ(replay("-", {}, csv).exit_code, 0);
  EXPECT_EQ(samples(), 301U);
  const std::string flight = read_file(IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap");
  const std::vector<std::string> jsbsim = {"--set", "truth.format=jsbsim", "--set", "truth.port=udp:127.0.0.1:5140"};
  const ProgramResult pcap = replay("pcap:-", jsbsim, flight);
  EXPECT_EQ(pcap.exit_code, 0) << pcap.errors;
  EXPECT_EQ(samples(), 1001U);
  const ProgramResult cut = replay("pcap:-", jsbsim, flight.substr(0, flight.size() / 2));
  EXPECT_EQ(cut.exit_code, 3) << cut.errors;
  const ProgramResult binary = replay("-", {"--set", "truth.format=native"}, csv);
  EXPECT_EQ(binary.exit_code, 2);
  EXPECT_NE(binary.errors.find("pcap:-: "), std::string::npos) << binary.errors;

  EXPECT_EQ(run_program("imud", {"check", "-"}, read_file(config_)).exit_code, 0);
  const ProgramResult both = run_program("imud", {"replay", "-", "-"}, read_file(config_));
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_NE(both.errors.find("standard input is the configuration already"), std::string::npos) << both.errors;
}

TEST_F(ReplayedFiles, ASignalEndsTheWaitForStandardInput) {
  for (const std::string capture : {"file:-", "pcap:-"}) {
    int ends[2];
    ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    const FileDescriptor input(ends[0]), held(ends[1]);
    Program imud("/bin/sh");
    imud.start({"-c", fmt::format("exec {}/imud replay {} {} < /proc/{}/fd/{}", IMUD_BIN_DIR, config_, capture,
                                  ::getpid(), input.get())});
    ASSERT_TRUE(eventually([&] { return read_file(fmt::format("/proc/{}/comm", imud.pid())) == "imud\n"; }));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_NE(imud.stop(), 0) << capture;
  }
}

TEST_F(ReplayedFiles, ArraysAreNotWrittenOverAnotherResult) {
  for (const std::vector<std::string>& seeds : {std::vector<std::string>(), {"--seeds", "1..2"}})
    for (const std::string option : {"--summary", "--labels"})
      for (const std::string name : {"all.npy", "all.npy.incomplete", "all_truth.npy", "all_truth.npy.incomplete"}) {
        std::vector<std::string> more = {"--npy", path("all.npy"), option, path(name)};
        more.insert(more.end(), seeds.begin(), seeds.end());
        const ProgramResult refused = replay(path("truth.csv"), more);
        EXPECT_EQ(refused.exit_code, 2) << option << name;
        EXPECT_NE(refused.errors.find(path(name) + ": is the file of " + option + "; give another file"),
                  std::string::npos)
            << refused.errors;
      }
  EXPECT_FALSE(std::filesystem::exists(path("all.npy")));
}

TEST_F(ReplayedFiles, JsonOnStandardOutputIsJsonAlone) {
  const ProgramResult result = replay(path("truth.csv"), {"--summary", "-"});
  const auto json = nlohmann::json::parse(result.output, nullptr, false);
  ASSERT_FALSE(json.is_discarded()) << result.output;
  EXPECT_EQ(json["complete"], true);
  const ProgramResult quality = replay(path("truth.csv"), {"--quality", "-"});
  ASSERT_GE(lines_of(quality.output).size(), 1U);
  for (const std::string& line : lines_of(quality.output))
    EXPECT_FALSE(nlohmann::json::parse(line, nullptr, false).is_discarded()) << line;
  EXPECT_EQ(replay(path("truth.csv"), {"--quality", "-", "--summary", "-"}).exit_code, 2);
  EXPECT_EQ(replay(path("truth.csv"), {"--summary", "-", "--set", "imu.0.port=file:-"}).exit_code, 2);
  const ProgramResult decoded = run_program("imu-decode", {"csv", "-"}, read_file(path("out")));
  EXPECT_EQ(decoded.exit_code, 0) << decoded.errors;
  EXPECT_EQ(decoded.output, read_file(path("out")));
}

TEST_F(ReplayedFiles, AFullDiskIsAnError) {
  for (const std::string option : {"--summary", "--labels", "--junit"}) {
    const ProgramResult full = replay(path("truth.csv"), {option, "/dev/full", "-q"});
    EXPECT_EQ(full.exit_code, 1) << option;
    EXPECT_EQ(full.errors, "imud: /dev/full: cannot be written: No space left on device\n") << option;
    EXPECT_FALSE(read_file(path("out")).empty()) << option;
  }
  ASSERT_EQ(replay(path("truth.csv"), {"--labels", "/dev/full", "--summary", path("summary.json")}).exit_code, 1);
  EXPECT_EQ(summary()["complete"], false);

  // The other results are written.
  const ProgramResult others = replay(
      path("truth.csv"), {"--labels", "/dev/full", "--junit", path("junit.xml"), "--summary", path("summary.json")});
  EXPECT_EQ(others.exit_code, 1);
  EXPECT_EQ(summary()["exit_code"], 1);
  EXPECT_EQ(summary()["shortfalls"][0], "/dev/full: cannot be written: No space left on device");
  EXPECT_EQ(summary()["imus"][0]["samples"], 301);
  EXPECT_NE(read_file(path("junit.xml")).find("<testsuite"), std::string::npos);
  EXPECT_NE(others.output.find("ended    by failure, incomplete: /dev/full"), std::string::npos) << others.output;
  const ProgramResult seeds = replay(path("truth.csv"), {"--seeds", "1..2", "--npy", path("all.npy"), "--labels",
                                                         "/dev/full", "--summary", path("summary.json")});
  EXPECT_EQ(seeds.exit_code, 1);
  EXPECT_EQ(summary()["complete"], false);
  EXPECT_EQ(summary()["seeds"].size(), 2U);
  EXPECT_NE(seeds.output.find("ended    by end_of_capture, incomplete or failed"), std::string::npos) << seeds.output;

  const ProgramResult json = run_program("imu-decode", {"csv", "file:" + path("out"), "--json", "/dev/full"});
  EXPECT_EQ(json.exit_code, 1);
  EXPECT_NE(json.errors.find("imu-decode: /dev/full: No space left on device\n"), std::string::npos) << json.errors;
  const ProgramResult csv = run_program("imu-truth", {"spiral", "--for", "9", "--csv", "/dev/full"});
  EXPECT_EQ(csv.exit_code, 1);
  EXPECT_EQ(csv.errors, "imu-truth: /dev/full: No space left on device\n");
}

TEST_F(ReplayedFiles, TheSummaryHasTheExitCode) {
  const std::string command = fmt::format("{}/imud replay {} {} --summary {}", IMUD_BIN_DIR, config_,
                                          path("truth.csv"), path("summary.json"));
  for (const std::string& more : {std::string(), " --seeds 1..2 --npy " + path("all.npy")}) {
    const ProgramResult full = run_program("/bin/sh", {"-c", command + more + " > /dev/full"});
    EXPECT_EQ(full.exit_code, 1) << more << full.errors;
    EXPECT_EQ(summary()["exit_code"], 1) << more;
    EXPECT_EQ(summary()["complete"], false) << more;
    EXPECT_EQ(summary()["shortfalls"].back(), "standard output: cannot be written: No space left on device") << more;
  }
}

TEST_F(ReplayedFiles, SeedsThatFailLeaveASummaryThatSaysSo) {
  for (const std::string& before : {std::string(), std::string("{\"complete\": true}\n")}) {
    if (!before.empty()) write("summary.json", before);
    const ProgramResult none = replay(
        write("none.csv", ""), {"--seeds", "1..2", "--npy", path("none.npy"), "--summary", path("summary.json")});
    EXPECT_EQ(none.exit_code, 1) << none.errors;
    EXPECT_EQ(summary()["complete"], false);
    EXPECT_EQ(summary()["exit_code"], 1);
    EXPECT_EQ(summary()["ended_by"], "failure");
    ASSERT_EQ(summary()["shortfalls"].size(), 1U);
    EXPECT_NE(none.errors.find(summary()["shortfalls"][0].get<std::string>()), std::string::npos) << none.errors;
  }
}

TEST_F(ReplayedFiles, AFullStandardOutputIsAnError) {
  ASSERT_EQ(replay(path("truth.csv")).exit_code, 0);
  const std::string commands[] = {
      "imud list",
      "imud --version",
      "imud check " + config_,
      fmt::format("imud replay {} {}", config_, path("truth.csv")),
      fmt::format("imud replay {} {} --summary -", config_, path("truth.csv")),
      fmt::format("imud replay {} {} --set imu.0.port=file:-", config_, path("truth.csv")),
      "imu-decode csv file:" + path("out"),
      "imu-decode --version",
      "imu-truth list",
      "imu-truth spiral --for 1 --csv -"};
  for (const std::string& command : commands) {
    const auto with = [&](const std::string& output) {
      return run_program("/bin/sh", {"-c", fmt::format("{}/{} > {}", IMUD_BIN_DIR, command, output)});
    };
    const ProgramResult full = with("/dev/full");
    EXPECT_TRUE(full.exit_code == 1 || full.exit_code == 3) << command << full.exit_code;
    // CLI11 does not keep the cause of a failure.
    const std::string cause = command.ends_with("--version") ? "standard output: " : "No space left on device";
    EXPECT_NE(full.errors.find(cause), std::string::npos) << command << full.errors;
    EXPECT_EQ(with("/dev/null").exit_code, 0) << command;
  }
}

}  // namespace
}  // namespace imud
