// How a run ends: its exit code, the line that names what is missing, and the JSON, for every way to be incomplete.
#include "emulator/report/outcome.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <csignal>
#include <thread>

#include "emulator/report/summary.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class OutcomeTest : public RunTest {
 protected:
  // 301 truths at 100 Hz as rows after the header row, and an imu at 100 Hz without errors.
  void SetUp() override {
    const ProgramResult made =
        run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "100", "--for", "3"});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
    truth_ = lines_of(read_file(path("truth.csv")));
    ASSERT_EQ(truth_.size(), 302U);
    config_ = config("fast", "file:" + path("truth.csv"), "csv", 100, "native", "file:" + path("out"));
  }

  std::string rows_from(std::size_t begin, std::size_t end) const {
    std::string text;
    for (std::size_t i = begin; i < end; ++i) text += truth_[i] + "\n";
    return text;
  }
  std::string capture(const std::string& text) const { return write("capture.csv", text); }

  // Replays the capture and expects the exit code, the phrase in the log, and the same in the JSON.
  void expect(int code, const std::string& phrase, const std::string& capture, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"replay", config_, capture, "--summary", path("summary.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = run_program("imud", arguments);
    EXPECT_EQ(result.exit_code, code) << result.errors;
    EXPECT_TRUE(contains(result.errors, phrase)) << phrase << "\n" << result.errors;
    const auto json = summary();
    EXPECT_EQ(json["exit_code"], code);
    EXPECT_EQ(json["complete"], json["shortfalls"].empty());
    std::string shortfalls;
    for (const auto& shortfall : json["shortfalls"]) shortfalls += shortfall.get<std::string>() + "; ";
    EXPECT_TRUE(contains(shortfalls, phrase)) << shortfalls;
  }

  std::vector<std::string> truth_;
  std::string config_;
};

TEST_F(OutcomeTest, AWholeCaptureIsComplete) {
  expect(0, "", path("truth.csv"));
  const auto json = summary();
  EXPECT_EQ(json["ended_by"], "end_of_capture");
  EXPECT_EQ(json["complete"], true);
  EXPECT_EQ(json["seed"], 1);
  EXPECT_EQ(json["simulated_s"], 3.0);
  EXPECT_FALSE(json["version"].get<std::string>().empty());
  const ProgramResult digest = run_program("/usr/bin/sha256sum", {config_});
  ASSERT_EQ(digest.exit_code, 0);
  EXPECT_EQ(json["config_sha256"], digest.output.substr(0, 64));
  expect(0, "", path("truth.csv"), {"--set", "seed=2"});
  EXPECT_NE(summary()["config_sha256"], digest.output.substr(0, 64)) << "an override changes the configuration";
}

TEST_F(OutcomeTest, WhatIsMissingOfTheTruth) {
  std::string damaged = rows_from(0, 2);
  for (std::size_t i = 2; i < 302; ++i) damaged += "x" + truth_[i] + "\n";
  expect(3, "300 truths refused (300 number)", capture(damaged));
  EXPECT_EQ(summary()["truth"]["accepted"], 1);

  std::string reversed = truth_[0] + "\n";
  for (std::size_t i = 301; i > 0; --i) reversed += truth_[i] + "\n";
  expect(3, "300 truths refused (100 reordered, 200 time_back)", capture(reversed));

  expect(3, "1 gap in the truth's time, of up to 0.510 s", capture(rows_from(0, 100) + rows_from(150, 302)));
  EXPECT_EQ(summary()["truth"]["gaps"], 1);
  EXPECT_EQ(summary()["truth"]["longest_gap_s"], 0.51);
  EXPECT_EQ(summary()["imus"][0]["samples"], 301) << "the gap is interpolated";

  expect(3, "the capture is cut short: 20 bytes after the last whole line",
         capture(rows_from(0, 301) + truth_[301].substr(0, 20)));
  expect(1, "there is no truth of the format csv", capture(truth_[0] + "\n"));
  EXPECT_EQ(summary()["ended_by"], "failure");
}

TEST_F(OutcomeTest, AGapBeyondTheLongestBeginsARunAndDiscardsNothing) {
  const std::string gap = capture(rows_from(0, 100) + rows_from(150, 302));
  expect(3, "1 gap in the truth's time", gap, {"--set", "truth.max_gap_ms=200"});
  EXPECT_EQ(summary()["truth"]["runs"], 2);
  EXPECT_EQ(summary()["truth"]["accepted"], 251);
  EXPECT_TRUE(summary()["truth"]["refused"].empty());
  EXPECT_EQ(summary()["imus"][0]["samples"], 251);
}

TEST_F(OutcomeTest, ADurationIsThatOfAllRunsTogether) {
  const std::string gap = capture(rows_from(0, 101) + rows_from(150, 302));  // 0.99 s, then 1.51 s
  expect(3, "--for ended it", gap, {"--set", "truth.max_gap_ms=200", "--for", "1.49"});
  EXPECT_EQ(summary()["imus"][0]["samples"], 100 + 51);
}

TEST_F(OutcomeTest, WhatIsMissingOfTheOutput) {
  expect(3, "imu1: 301 frames lost to errors of the file", path("truth.csv"), {"--set", "imu.0.port=file:/dev/full"});
  const ProgramResult full =
      run_program("imud", {"replay", config_, path("truth.csv"), "--set", "imu.0.port=file:/dev/full"});
  EXPECT_TRUE(contains(full.errors, "No space left on device")) << full.errors;

  expect(3, "imu1: 301 frames dropped", path("truth.csv"), {"--set", "imu.0.port=pty:" + path("pty")});
  expect(3, "/dev/full: cannot be written: No space left on device", path("truth.csv"), {"--quality", "/dev/full"});
  // At the recorded pace, what nobody reads is not missing, unless it is required.
  expect(0, "", path("truth.csv"), {"--set", "imu.0.port=pty:" + path("pty"), "--set", "clock=realtime"});
  EXPECT_EQ(summary()["imus"][0]["dropped"], 301);
}

// At the end the reader of a pty is waited for; what it has not read then is missing.
TEST_F(OutcomeTest, WhatAReaderHasNotReadIsMissing) {
  for (const bool reads : {true, false}) {
    Program run("imud");
    run.start({"replay", config_, path("truth.csv"), "--set", "imu.0.port=pty:" + path("pty"), "--wait-for-reader",
               "--set", "imu.0.rate_hz=20"});  // 61 frames of 124 bytes, more than a terminal holds
    ASSERT_TRUE(eventually([&] { return std::filesystem::exists(path("pty")); }));
    const FileDescriptor reader(::open(path("pty").c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    ASSERT_TRUE(reader);
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    std::string bytes(65536, '\0');
    std::size_t got = 0;
    for (ssize_t size = 1; reads && size > 0 && got < 61 * 124; got += static_cast<std::size_t>(size)) {
      size = std::max<ssize_t>(::read(reader.get(), bytes.data(), bytes.size()), 0);
    }
    EXPECT_EQ(run.wait(), reads ? 0 : 3) << run.errors();
    EXPECT_EQ(got, reads ? 61U * 124U : 0U);
  }
}

// The run waits for the reader of a copy, too, and after its end until it has read everything.
TEST_F(OutcomeTest, TheReaderOfACopyIsWaitedFor) {
  for (const bool reads : {true, false}) {
    Program run("imud");
    run.start({"replay", config_, path("truth.csv"), "--set", "imu.0.also=[\"pty:" + path("copy") + "\"]",
               "--wait-for-reader", "--set", "imu.0.rate_hz=20"});
    ASSERT_TRUE(run.wait_for_errors("waiting for a reader of pty:" + path("copy"))) << run.errors();
    const FileDescriptor reader(::open(path("copy").c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK));
    ASSERT_TRUE(reader);
    std::string bytes(65536, '\0');
    std::size_t got = 0;
    const auto has_all = [&] {
      got += static_cast<std::size_t>(std::max<ssize_t>(::read(reader.get(), bytes.data(), bytes.size()), 0));
      return got == 61U * 124U;
    };
    EXPECT_TRUE(!reads || eventually(has_all)) << got;
    EXPECT_EQ(run.wait(), reads ? 0 : 3) << run.errors();
  }
}

// A limit of the files' size is as a full disk.
TEST_F(OutcomeTest, ALimitOfTheFilesSizeIsAnErrorOfTheFile) {
  const ProgramResult limited = run_program(
      "/bin/sh", {"-c", "ulimit -f 8; exec " IMUD_BIN_DIR "/imud replay " + config_ + " " + path("truth.csv")});
  EXPECT_EQ(limited.exit_code, 3) << limited.errors;
  EXPECT_TRUE(contains(limited.errors, "lost to errors of the file")) << limited.errors;
}

TEST_F(OutcomeTest, EndedBeforeTheEnd) {
  expect(3, "--for ended it before the capture's end", path("truth.csv"), {"--for", "1"});
  EXPECT_EQ(summary()["ended_by"], "for");
  expect(0, "", path("truth.csv"), {"--for", "4"});

  Program run("imud");
  run.start({"replay", config_, path("truth.csv"), "--set", "clock=realtime", "--summary", path("summary.json"),
             "--log-every", "0.1"});
  ASSERT_TRUE(run.wait_for_errors("truth "));
  EXPECT_EQ(run.stop(SIGTERM), 3) << run.errors();
  EXPECT_TRUE(contains(run.errors(), "a signal ended it before the capture's end")) << run.errors();
  EXPECT_EQ(summary()["ended_by"], "signal");
}

TEST_F(OutcomeTest, Requirements) {
  const auto with = [&](const std::string& limits) {
    return run_program(
        "imud", {"replay", config_, path("truth.csv"), "--summary", path("summary.json"), "--require", limits});
  };
  EXPECT_EQ(with("imu1.samples=301,samples>=301,dropped=0,truth.refused<=0%,truth.refused.crc=0").exit_code, 0);
  const nlohmann::json kept = summary()["required"];
  ASSERT_EQ(kept.size(), 5U);
  for (const auto& limit : kept) EXPECT_EQ(limit["holds"], true) << limit;

  const ProgramResult violated = with("imu1.samples>=302,dropped=0");
  EXPECT_EQ(violated.exit_code, 3);
  EXPECT_TRUE(contains(violated.errors, "required imu1.samples>=302, but imu1.samples is 301")) << violated.errors;
  EXPECT_EQ(summary()["exit_code"], 3);
  EXPECT_EQ(summary()["complete"], true);
  EXPECT_EQ(summary()["required"][0],
            nlohmann::json::parse(R"({"limit": "imu1.samples>=302", "seen": 301, "holds": false})"));
  EXPECT_EQ(summary()["required"][1]["holds"], true);

  const ProgramResult share = with("truth.no_state<0.3%");  // 1 of 302 is 0.33 %
  EXPECT_EQ(share.exit_code, 3) << share.errors;
  EXPECT_EQ(with("truth.no_state<0.34%").exit_code, 0);

  EXPECT_EQ(run_program("imud", {"replay", "--require", "samples=301", config_, path("truth.csv")}).exit_code, 0)
      << "an option takes one value only";
  EXPECT_EQ(run_program("imud", {"replay", "--set", "seed=3", config_, path("truth.csv")}).exit_code, 0);

  for (const std::string unknown : {"imu2.samples>=1", "sample>=1", "truth.x=0", "truth.refused.x=0", "samples"}) {
    const ProgramResult refused = with(unknown);
    EXPECT_EQ(refused.exit_code, 2) << unknown;
    EXPECT_TRUE(contains(refused.errors, unknown)) << refused.errors;
  }
}

TEST_F(OutcomeTest, ALiveRunIsCompleteUnlessAFileFails) {
  const std::string live = config("realtime", Simulator().port(), "native", 100, "native", "file:" + path("out"));
  const auto run = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"run", live, "--for", "0.3", "--summary", path("summary.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program("imud", arguments);
  };
  const ProgramResult quiet = run({});
  EXPECT_EQ(quiet.exit_code, 0) << quiet.errors;
  EXPECT_TRUE(contains(quiet.errors, "no truth was accepted")) << quiet.errors;
  EXPECT_EQ(summary()["ended_by"], "for");
  EXPECT_EQ(summary()["complete"], true);
  EXPECT_EQ(summary()["truth"]["warning"], "no truth was accepted");

  EXPECT_EQ(run({"--require", "truth.accepted>=1"}).exit_code, 3);
  const ProgramResult full = run({"--set", "imu.0.port=file:/dev/full", "--set", "imu.0.before_first=rest"});
  EXPECT_EQ(full.exit_code, 3) << full.errors;
  EXPECT_TRUE(contains(full.errors, "lost to errors of the file")) << full.errors;
}

// The judgement of counters, without a run.
class Judge : public testing::Test {
 protected:
  Judge() {
    config_.clock = ClockMode::fast;
    config_.truth.port = "pcap:flight.pcap";
    config_.truth.format = find_truth_format("native");
    config_.imus.resize(2);
    config_.imus[0].name = "left";
    config_.imus[1].name = "right";
    truth_.received.count(200);
    truth_.accepted.count(100);
    imus_[0].samples.count(1000);
    imus_[1].samples.count(3000);
  }
  Outcome outcome(const std::string& limits = {}) const {
    const RunCounters counters{&truth_, &quality_, {{"left", &imus_[0]}, {"right", &imus_[1]}}};
    return judge(summarize(counters, 1, {0, 0}), config_, EndedBy::end_of_capture,
                 limits.empty() ? std::vector<Requirement>() : parse_requirements(limits));
  }

  Config config_;
  TruthCounters truth_;
  TruthQuality quality_;
  ImuCounters imus_[2];
};

TEST_F(Judge, ACaptureMustHaveEveryTruth) {
  EXPECT_EQ(outcome().exit_code(), 0);
  truth_.refused[static_cast<std::size_t>(Refusal::other_stream)].count(7);
  EXPECT_EQ(outcome().exit_code(), 0) << "another vehicle's";
  truth_.refused[static_cast<std::size_t>(Refusal::duplicate)].count(3);
  EXPECT_EQ(outcome().exit_code(), 3);
  truth_.repeated.count(3);
  EXPECT_EQ(outcome().exit_code(), 0) << "repeated by the network";
  truth_.lost.count(5);
  EXPECT_EQ(outcome().exit_code(), 3);
  EXPECT_EQ(outcome().shortfalls, std::vector<std::string>{"5 truths missing by the sequence numbers"});
  truth_.refused[static_cast<std::size_t>(Refusal::bad_checksum)].count(2);
  ASSERT_EQ(outcome().shortfalls.size(), 2U);
  EXPECT_EQ(outcome().shortfalls[0], "2 truths refused (2 crc)");
  config_.truth.port = "udp:127.0.0.1:9810";
  EXPECT_EQ(outcome().exit_code(), 0) << "live truth may be lost";
}

TEST_F(Judge, ALimitOfTheGapsReplacesTheRuleThatThereIsNone) {
  truth_.gaps.count(2);
  EXPECT_EQ(outcome().exit_code(), 3);
  EXPECT_EQ(outcome("truth.gaps<=2").exit_code(), 0);
  EXPECT_EQ(outcome("truth.gaps<=1").exit_code(), 3);
}

// At the recorded pace, frames that nobody reads from a pty are discarded; any other port must take them all.
TEST_F(Judge, FramesAreMissingUnlessAPtyHasNoReader) {
  config_.imus[0].port = "pty:left";
  config_.imus[1].port = "serial:/dev/ttyUSB0";
  config_.clock = ClockMode::realtime;
  imus_[0].dropped.count(5);
  EXPECT_EQ(outcome().exit_code(), 0);
  EXPECT_EQ(outcome("left.dropped=0").exit_code(), 3);
  imus_[1].dropped.count(2);
  EXPECT_EQ(outcome().shortfalls, std::vector<std::string>{"right: 2 frames dropped"});
  config_.imus[0].second_port = "file:out";
  ASSERT_EQ(outcome().shortfalls.size(), 2U);
  config_.clock = ClockMode::fast;
  EXPECT_EQ(outcome().shortfalls.size(), 2U);
}

TEST_F(Judge, PercentagesAreThoseOfTheTruthsReceivedOrOfTheImusSamples) {
  truth_.lost.count(3);
  imus_[0].missed.count(10);
  config_.truth.port = "udp:127.0.0.1:9810";
  for (const char* kept : {"truth.lost<=1.5%", "left.missed<=1%", "missed<=0.25%", "right.missed=0%"})
    EXPECT_EQ(outcome(kept).exit_code(), 0) << kept;
  for (const char* broken : {"truth.lost<=1.4%", "left.missed<=0.9%", "missed<=0.24%", "right.missed>0%"})
    EXPECT_EQ(outcome(broken).exit_code(), 3) << broken;
}

}  // namespace
}  // namespace imud
