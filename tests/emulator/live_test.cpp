// imud run in real time, by the real clock: counts and states only, with wide margins. The logic's tests have a
// simulated clock: realtime_*_test.cpp.
#include "tests/emulator/live_test.hpp"

#include <fcntl.h>

#include <cmath>

namespace imud {
namespace {

TEST_F(LiveTest, RealtimeKeepsTheGrid) {
  const std::string c = config("realtime", simulator_.port(), "native", 500, "native", "pty:" + path("imu"));
  Program imud("imud");
  start(imud, c, {"--set", "truth.delay_ms=50"});
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  Program decode("imu-decode");
  decode.start({"native", "pty:" + path("imu")});
  ASSERT_TRUE(imud.wait_for_errors("takes frames"));
  ASSERT_EQ(run_program("imu-truth", {"coning", "--to", simulator_.port(), "--rate", "100", "--for", "2"}).exit_code,
            0);
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(decode.wait(), 0) << decode.errors();
  const auto s = summary();
  EXPECT_GE(s["truth"]["accepted"], 200);
  const auto all = rows(decode.output());
  EXPECT_EQ(s["imus"][0]["samples"], all.size());
  EXPECT_EQ(s["imus"][0]["dropped"], 0);
  // 2 s at 500 Hz less the delay, with a margin for a busy machine; no gap, each on its instant.
  EXPECT_GE(all.size(), 800U);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(all[k][0], std::to_string(k * 2'000'000));
    EXPECT_EQ(all[k][1], std::to_string(k));
  }
}

TEST_F(LiveTest, SigtermIsHeardThoughTheReaderStallsAndSamplesAreDue) {
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
    // A second leaves room for a loaded machine; without a look at `stop` it takes half an hour.
    EXPECT_EQ(imud.stop(SIGTERM, std::chrono::milliseconds(1000)), 0);
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
  ASSERT_GT(all.size(), 300U);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(all[k][1], std::to_string(k));
    // Coning of 0.02 rad at 10 Hz: the rate is 1.26 rad/s at most, whatever was lost; two lost in a row bend the
    // curve.
    EXPECT_LT(std::abs(std::stod(all[k][2])), 5.0);
  }
}

TEST_F(LiveTest, AHoldUpLosesNoTruthThatWaits) {
  const std::string c = config("realtime", simulator_.port(), "native", 200, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  Program truth("imu-truth");
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "500", "--for", "30"});
  ASSERT_TRUE(eventually([&] { return read_file(path("out")).size() > 100; }));
  imud.kill(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  imud.kill(SIGCONT);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
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
  const auto play = [&](int truths) {
    for (int i = 0; i < truths; ++i) {
      Truth t = find_motion("turntable")->at(TruthTime{std::int64_t{10'000'000} * sequence}, {});
      t.sequence = sequence++;
      simulator_.send(Simulator::encode(t));
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  };
  ASSERT_TRUE(eventually([&] {  // until it listens
    play(1);
    return read_file(path("out")).size() > 200;
  }));
  play(20);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  play(50);
  EXPECT_EQ(imud.stop(), 0);
  const auto s = summary();
  EXPECT_GT(s["imus"][0]["held"], 0);
  EXPECT_GE(s["truth"]["resumed"], 1);
  EXPECT_NE(imud.errors().find("paused"), std::string::npos);
  const auto all = rows(read_file(path("out")));
  EXPECT_EQ(std::stod(all[all.size() - 10][4]), 0.5);  // turning again
}

TEST_F(LiveTest, TheFiguresAreWrittenEachSecondAndLogged) {
  const std::string c =
      config("realtime", simulator_.port(), "native", 200, "native", "pty:" + path("imu") + "?baud=921600");
  Program imud("imud");
  start(imud, c, {"--quality", path("quality.jsonl"), "--log-every", "1"});
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  EXPECT_EQ(
      run_program("imu-truth", {"turntable", "--to", simulator_.port(), "--for", "3.5", "--drop", "5"}).exit_code, 0);
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

TEST_F(LiveTest, SigtermEndsRemovesTheLinkAndPrintsTheSummary) {
  for (const std::string clock : {"realtime", "lockstep"}) {
    for (const double rate_hz : {0.1, 1000.0}) {
      const std::string c = config(clock, simulator_.port(), "native", rate_hz, "native", "pty:" + path("imu"));
      Program imud("imud");
      start(imud, c);
      ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
      for (std::uint32_t i = 0; i < 10; ++i) simulator_.send(Simulator::encode(Simulator::truth(10 * i, i, false)));
      EXPECT_EQ(imud.stop(SIGTERM, std::chrono::milliseconds(1000)), 0);
      EXPECT_FALSE(std::filesystem::is_symlink(path("imu")));
      EXPECT_NE(imud.output().find("received"), std::string::npos);
      EXPECT_NE(imud.output().find("imu1"), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace imud
