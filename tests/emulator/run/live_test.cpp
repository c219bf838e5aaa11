// imud run in real time on the real clock: counts and states only, with wide margins. The logic is tested on a
// simulated clock in realtime_*_test.cpp.
#include "tests/emulator/run/live_test.hpp"

#include <fcntl.h>

#include <cmath>

#include "core/sample.hpp"

namespace imud {
namespace {

// The reader is a process behind a pty of 4 kB: data that it does not read in time on a busy machine are dropped.
TEST_F(LiveTest, RealtimeKeepsTheGrid) {
  const std::string c = config("realtime", simulator_.port(), "native", 500, "native", "pty:" + path("imu"));
  Program imud("imud");
  start(imud, c, {"--set", "truth.delay_ms=50"});
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  constexpr std::size_t samples = 800;
  Program decode("imu-decode");
  decode.start({"native", "pty:" + path("imu"), "--count", std::to_string(samples)});
  ASSERT_TRUE(imud.wait_for_errors("takes frames"));
  Program truth("imu-truth");
  truth.start({"coning", "--to", simulator_.port(), "--rate", "100", "--for", "120"});
  EXPECT_EQ(decode.wait(), 0) << decode.errors();
  EXPECT_EQ(imud.stop(), 0);
  truth.kill();
  const auto s = summary();
  EXPECT_GE(s["imus"][0]["samples"], samples);
  const auto all = rows(decode.output());
  ASSERT_EQ(all.size(), samples);
  // Each sample is at its instant.
  std::uint64_t next = 0, missing = 0;
  for (const auto& row : all) {
    const std::uint64_t k = std::stoul(row[1]);
    EXPECT_EQ(row[0], std::to_string(k * 2'000'000));
    ASSERT_GE(k, next);
    missing += k - next;
    next = k + 1;
  }
  EXPECT_LE(missing, s["imus"][0]["dropped"]);
}

TEST_F(LiveTest, SigtermIsHandledThoughTheReaderStallsAndSamplesAreDue) {
  for (const std::string clock : {"lockstep", "realtime"}) {
    const std::string c = config(clock, simulator_.port(), "native", 10'000, "native", "pty:" + path("imu"));
    Program imud("imud");
    start(imud, c);
    ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
    const FileDescriptor stalled(::open(path("imu").c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    for (std::uint32_t i = 0; i < 5; ++i) {
      simulator_.send(Simulator::encode(Simulator::truth(50'000 * i, i, false)));  // half a million samples each
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    EXPECT_EQ(imud.stop(), 0);  // a loop that ignores the stop request takes half an hour
    EXPECT_FALSE(std::filesystem::is_symlink(path("imu")));
  }
}

TEST_F(LiveTest, ADisturbedNetworkMakesNoGapInRealtime) {
  const std::string c = config("realtime", simulator_.port(), "native", 200, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c, {"--set", "truth.delay_ms=100"});
  const ProgramResult sent =
      run_program("imu-truth", {"coning", "--to", simulator_.port(), "--rate", "100", "--for", "2", "--drop", "5",
                                "--duplicate", "5", "--reorder", "5", "--corrupt", "5", "--seed", "7"});
  EXPECT_EQ(sent.exit_code, 0) << sent.errors;
  EXPECT_EQ(imud.stop(), 0);
  const auto s = summary();
  EXPECT_EQ(s["truth"]["runs"], 1);
  EXPECT_GT(s["truth"]["refused"]["duplicate"], 0);
  const auto all = rows(read_file(path("out")));
  std::size_t known = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(all[k][1], std::to_string(k));
    if ((std::stoul(all[k].back()) & status::truth_extrapolated) != 0) continue;  // on a loaded machine
    ++known;
    // Coning of 0.02 rad at 10 Hz: the rate is 1.26 rad/s at most, whatever was lost. Two truths lost in a row
    // distort the curve.
    EXPECT_LT(std::abs(std::stod(all[k][2])), 5.0);
  }
  EXPECT_GT(known, 100U);
}

// Motion is held half a second after the newest truth, a pause that the simulator may make on a loaded machine.
TEST_F(LiveTest, AHoldUpLosesNoTruthThatWaits) {
  const std::string c = config("realtime", simulator_.port(), "native", 200, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c, {"--set", "truth.extrapolate_ms=500"});
  Program truth("imu-truth");
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "200", "--for", "120"});
  const auto written = [&] { return read_file(path("out")).size(); };
  ASSERT_TRUE(eventually([&] { return written() > 100; }));
  imud.kill(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  const std::size_t before = written();
  imud.kill(SIGCONT);
  ASSERT_TRUE(eventually([&] { return written() > before + 300 * 100; }));  // the 300 samples of the hold-up
  EXPECT_EQ(imud.stop(), 0);
  truth.kill();
  EXPECT_EQ(summary()["imus"][0]["held"], 0);
  EXPECT_EQ(summary()["truth"]["resumed"], 0);
}

TEST_F(LiveTest, AfterAPauseOfTheSimulatorTheSensorMovesAgain) {
  const std::string c = config("realtime", simulator_.port(), "native", 200, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  std::uint32_t sequence = 0;
  const auto play = [&] {
    Truth t = find_motion("turntable")->at(TruthTime{std::int64_t{10'000'000} * sequence}, {});
    t.sequence = sequence++;
    simulator_.send(Simulator::encode(t));
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  };
  // The rate in the last whole row: 0.5 rad/s, or 0 when motion is held.
  const auto turns = [&](double rate) {
    const std::string out = read_file(path("out"));
    const auto all = rows(out.substr(0, out.rfind('\n') + 1));
    return !all.empty() && all.back().size() > 4 && std::abs(std::stod(all.back()[4]) - rate) < 1e-6;
  };
  ASSERT_TRUE(eventually([&] {
    play();
    return turns(0.5);
  }));
  ASSERT_TRUE(eventually([&] { return turns(0); }));
  ASSERT_TRUE(eventually([&] {
    play();
    return turns(0.5) && imud.errors().find(" then went on ") != std::string::npos;
  }));
  EXPECT_EQ(imud.stop(), 0);
  const auto s = summary();
  EXPECT_GT(s["imus"][0]["held"], 0);
  EXPECT_GE(s["truth"]["resumed"], 1);
}

TEST_F(LiveTest, TheFiguresAreWrittenEachSecondAndLogged) {
  const std::string c =
      config("realtime", simulator_.port(), "native", 200, "native", "pty:" + path("imu") + "?baud=921600");
  Program imud("imud");
  start(imud, c, {"--quality", path("quality.jsonl"), "--log-every", "1"});
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  EXPECT_EQ(
      run_program("imu-truth", {"turntable", "--to", simulator_.port(), "--for", "3.5", "--drop", "5"}).exit_code, 0);
  ASSERT_TRUE(eventually([&] { return lines_of(read_file(path("quality.jsonl"))).size() >= 3; }));
  EXPECT_EQ(imud.stop(), 0);
  const nlohmann::json whole = summary();
  std::uint64_t samples = 0, accepted = 0;
  const std::vector<std::string> lines = lines_of(read_file(path("quality.jsonl")));
  ASSERT_GE(lines.size(), 3U);
  for (const std::string& text : lines) {
    const nlohmann::json line = nlohmann::json::parse(text);
    const nlohmann::json &truth = line["truth"], &imu = line["imus"][0];
    samples += imu["samples"].get<std::uint64_t>();
    accepted += truth["accepted"].get<std::uint64_t>();
    for (const char* key : {"rate_hz", "lost", "inserted", "runs", "resumed", "refused"})
      EXPECT_TRUE(truth.contains(key)) << key;
    for (const char* key : {"frames", "dropped", "extrapolated", "held", "silent", "missed", "line_load_percent"})
      EXPECT_TRUE(imu.contains(key)) << key;
    for (const char* histogram : {"lateness_us", "write_us"})
      for (const char* key : {"p50", "p99", "p999", "max"}) EXPECT_TRUE(imu[histogram].contains(key)) << key;
  }
  EXPECT_EQ(whole["imus"][0]["samples"], samples);
  EXPECT_EQ(whole["truth"]["accepted"], accepted);
  EXPECT_GT(whole["truth"]["lost"], 0);
  EXPECT_NEAR(whole["truth"]["rate_hz"].get<double>(), 95, 20);
  EXPECT_NEAR(whole["truth"]["clock_rate"].get<double>(), 1, 0.1);
  for (const char* key : {"offset_us", "delay_us", "jitter_us", "age_us", "stops", "returns"})
    EXPECT_TRUE(whole["truth"].contains(key)) << key;
  EXPECT_NE(imud.errors().find(" Hz, lost "), std::string::npos) << imud.errors();
  EXPECT_NE(imud.errors().find("late p50 "), std::string::npos) << imud.errors();
}

TEST_F(LiveTest, ASignalEndsItRemovesTheLinkAndPrintsTheSummary) {
  for (const std::string clock : {"realtime", "lockstep"}) {
    for (const int signal : {SIGTERM, SIGINT}) {
      const double rate_hz = signal == SIGTERM ? 0.1 : 1000.0;
      const std::string c = config(clock, simulator_.port(), "native", rate_hz, "native", "pty:" + path("imu"));
      Program imud("imud");
      start(imud, c);
      ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
      for (std::uint32_t i = 0; i < 10; ++i) simulator_.send(Simulator::encode(Simulator::truth(10 * i, i, false)));
      EXPECT_EQ(imud.stop(signal), 0);
      EXPECT_FALSE(std::filesystem::is_symlink(path("imu")));
      EXPECT_NE(imud.output().find("received"), std::string::npos);
      EXPECT_NE(imud.output().find("imu1"), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace imud
