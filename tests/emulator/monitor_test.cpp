// Monitor: what it writes to the log, and how often, from counters that only the test changes.
#include "emulator/report/monitor.hpp"

#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <thread>

#include "emulator/config/load_config.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

class MonitorTest : public RunTest {
 protected:
  MonitorTest() : before_(spdlog::default_logger()) {
    auto logger = std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log_));
    logger->set_pattern("%l %v");
    spdlog::set_default_logger(logger);
    config_ = load_config(config("realtime", "udp:127.0.0.1:9810", "native", 100, "native", "pty:" + path("imu")));
  }
  ~MonitorTest() override { spdlog::set_default_logger(before_); }

  Monitor monitor(const Monitor::Options& options = {
                      .log_every_s = 0, .quality_file = {}, .first_truth_s = 3600, .wrong_speed_s = 0}) const {
    return Monitor({&truth_, &quality_, {{"imu1", &imu_}}}, config_, options, TextFile(options.quality_file));
  }
  // Returns the lines logged since the last call.
  std::vector<std::string> logged() {
    std::vector<std::string> lines = lines_of(log_.str());
    log_.str({});
    return lines;
  }
  using Lines = std::vector<std::string>;

  TruthCounters truth_;
  TruthQuality quality_;
  ImuCounters imu_{find_protocol("vectornav")->counters};
  Config config_;

 private:
  std::shared_ptr<spdlog::logger> before_;
  std::ostringstream log_;
};

TEST_F(MonitorTest, ACauseOfRefusalIsReportedOnce) {
  Monitor monitor = this->monitor();
  monitor.update();
  EXPECT_EQ(logged(), Lines{});
  for (int i = 0; i < 3; ++i) {
    truth_.refused[static_cast<std::size_t>(Refusal::bad_checksum)].count(5);
    monitor.update();
  }
  EXPECT_EQ(logged(), Lines{"warning truth refused: crc: damaged on its way, or another CRC than CRC-32C (counted; "
                            "reported once)"});
  truth_.refused[static_cast<std::size_t>(Refusal::duplicate)].count();
  monitor.finish({});
  const Lines lines = logged();
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_TRUE(lines[0].starts_with("warning truth refused: duplicate: ")) << lines[0];
}

TEST_F(MonitorTest, ARemarkIsReportedOnceAndStandsInTheFigures) {
  const auto set = [](Remark& remark, std::string_view text) {
    remark.set([&](std::span<char> room) { return text.copy(room.data(), room.size()); });
  };
  Monitor monitor = this->monitor();
  set(truth_.remarks.columns, "columns that are not used: \"accel_x\"");
  set(truth_.remarks.columns, "another");
  monitor.update();
  monitor.update();
  EXPECT_EQ(logged(), Lines{"warning truth: columns that are not used: \"accel_x\" (reported once)"});
  constexpr auto range = static_cast<std::size_t>(Refusal::out_of_range);
  set(truth_.refused.first[range], "the column \"time_ns\" has \"1e19\"");
  truth_.refused[range].count(5);
  set(truth_.remarks.senders, "two senders");
  const Summary all = monitor.finish({});
  EXPECT_EQ(logged(),
            (Lines{"warning truth: two senders (reported once)",
                   "warning truth refused: range: beyond the motion of any vehicle: check units; the first: "
                   "the column \"time_ns\" has \"1e19\" (counted; reported once)"}));
  EXPECT_EQ(nlohmann::json::parse(json(all, JsonLayout::line))["truth"]["remarks"],
            (nlohmann::json::array({"columns that are not used: \"accel_x\"", "two senders",
                                    "refused: range: the column \"time_ns\" has \"1e19\""})));
}

TEST_F(MonitorTest, AnInterruptionIsReportedEachTime) {
  Monitor monitor = this->monitor();
  for (int i = 0; i < 2; ++i) {
    quality_.stops.count();
    monitor.update();
    EXPECT_EQ(logged(), Lines{"warning no truth for 100 ms: motion is held"});
    quality_.returns.count();
    monitor.update();
    monitor.update();
    EXPECT_EQ(logged(), Lines{"info truth has resumed"});
  }
  quality_.stops.count(3);
  quality_.returns.count(2);
  monitor.update();
  EXPECT_EQ(logged(),
            (Lines{"warning no truth for 100 ms: motion is held (3 times)", "info truth has resumed (2 times)"}));
}

TEST_F(MonitorTest, WhatWasDoneAboutAPauseIsOneLine) {
  Monitor monitor = this->monitor();
  quality_.last_missing_ns = 310'000'000;
  quality_.last_held_ns = 210'000'000;
  quality_.last_behind_ns = 300'000'000;
  quality_.pauses = 1;
  monitor.update();
  EXPECT_EQ(logged(), Lines{"warning no truth for 0.31 s: held 0.21 s, then went on 0.30 s behind"});
  quality_.returns.count();
  monitor.update();
  EXPECT_EQ(logged(), Lines{}) << "it is reported";
  quality_.last_behind_ns = 0;
  quality_.pauses = 3;
  quality_.returns.count(2);
  monitor.update();
  EXPECT_EQ(logged(), Lines{"warning no truth for 0.31 s: held 0.21 s, then caught up (2 times)"});
  quality_.last_leap_ns = 2'500'000'000;
  quality_.leaps.count();
  monitor.update();
  EXPECT_EQ(logged(),
            Lines{"warning the simulator's time has leapt ahead by 2.500 s: what lies between is passed over"});
}

TEST_F(MonitorTest, TheReactionToAnInterruptionIsTheConfiguredOne) {
  for (const auto& [reaction, words] : {std::pair{WhenStopped::flag, "motion is held and flagged as not valid"},
                                        std::pair{WhenStopped::silence, "the sensors are silent"}}) {
    config_.truth.when_stopped = reaction;
    quality_.stops.store(0);
    Monitor monitor = this->monitor();
    quality_.stops.count();
    monitor.update();
    EXPECT_EQ(logged(), Lines{std::string("warning no truth for 100 ms: ") + words});
  }
}

TEST_F(MonitorTest, TheFirstRunIsNoNews) {
  Monitor monitor = this->monitor();
  truth_.runs.count();
  monitor.update();
  EXPECT_EQ(logged(), Lines{});
  truth_.runs.count();
  monitor.update();
  monitor.update();
  EXPECT_EQ(logged(), Lines{"info a new run of simulation time begins: run 2"});
}

TEST_F(MonitorTest, TruthThatDoesNotComeIsReportedOnceAndSoIsTheFirst) {
  config_.imus.push_back(config_.imus[0]);
  config_.imus[1].name = "imu2";
  config_.imus[1].before_first = BeforeFirst::rest;
  Monitor monitor({&truth_, &quality_, {{"imu1", &imu_}, {"imu2", &imu_}}}, config_,
                  {.log_every_s = 0, .quality_file = {}, .first_truth_s = 0});
  monitor.update();
  monitor.update();
  EXPECT_EQ(logged(),
            Lines{"info no truth from udp:127.0.0.1:9810 yet; sampling a vehicle at rest: imu2; silent: imu1"});
  truth_.runs.count();
  monitor.update();
  monitor.update();
  EXPECT_EQ(logged(), Lines{"info the first truth has come"});
}

TEST_F(MonitorTest, RefusedEdgesAreReportedOnce) {
  Monitor monitor = this->monitor();
  for (int i = 0; i < 3; ++i) {
    imu_.edges_refused.count();
    monitor.update();
  }
  const Lines lines = logged();
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_TRUE(lines[0].starts_with("warning imu1: edges refused: ")) << lines[0];
}

TEST_F(MonitorTest, AnOutputToAUartThatIsNotConnectedIsReportedOnce) {
  Monitor monitor = this->monitor();
  monitor.update();
  EXPECT_EQ(logged(), Lines{});
  for (std::uint64_t i = 1; i <= 3; ++i) {
    imu_.device.store(std::array{i});
    monitor.update();
  }
  EXPECT_EQ(logged(), Lines{"warning imu1: the host has turned an output to the UART that is not connected; give "
                            "second_port, or device.uart for the UART at port (counted; reported once)"});
}

TEST_F(MonitorTest, AChangeOfTheSecondPortIsReported) {
  config_.imus[0].second_port = "pty:second";
  Monitor monitor = this->monitor();
  imu_.second_speeds = Port::Speeds{115'200, 9600};
  imu_.second_port_state = PortState::wrong_speed;
  monitor.update();
  imu_.second_port_state = PortState::ready;
  monitor.finish({});
  EXPECT_EQ(logged(),
            (Lines{"warning imu1: pty:second: the line has 115200 baud and the client 9600: both read garbage",
                   "info imu1: pty:second takes frames"}));
}

// A host that is told another bit rate, and then sets it, has the wrong one for a moment.
TEST_F(MonitorTest, ANegotiationOfABitRateIsNotReported) {
  Monitor monitor =
      this->monitor({.log_every_s = 0, .quality_file = {}, .first_truth_s = 3600, .wrong_speed_s = 3600});
  const std::string port = "pty:" + path("imu");
  imu_.speeds = Port::Speeds{921'600, 115'200};
  for (const PortState state : {PortState::no_reader, PortState::wrong_speed, PortState::ready,
                                PortState::wrong_speed, PortState::ready, PortState::wrong_speed}) {
    imu_.port_state = state;
    monitor.update();
  }
  monitor.finish({});
  EXPECT_EQ(logged(), (Lines{"info imu1: nobody has " + port + " open; frames are discarded",
                             "info imu1: " + port + " takes frames"}));
}

TEST(SpeedMismatch, LastsIfBothSpeedsStay) {
  SpeedMismatch mismatch;
  constexpr Nanoseconds least = std::chrono::seconds(2);
  const auto lasts = [&](double at_s, unsigned client) {
    return mismatch.lasts({921'600, client}, HostTime{} + nanoseconds(at_s), least);
  };
  EXPECT_FALSE(lasts(10, 9600));
  EXPECT_FALSE(lasts(11.9, 9600));
  EXPECT_TRUE(lasts(12, 9600));
  mismatch.end();
  EXPECT_FALSE(lasts(13, 9600)) << "it begins again";
  EXPECT_FALSE(lasts(14.9, 9600));
  EXPECT_TRUE(lasts(15, 9600));
}

// A host that searches has each speed for a short time; it is reported if it has not found the right one for long.
TEST(SpeedMismatch, LastsIfNoSpeedIsTheRightOne) {
  SpeedMismatch mismatch;
  for (int i = 0; i < 10; ++i)
    EXPECT_FALSE(mismatch.lasts({921'600, i % 2 == 0 ? 9600U : 115'200U}, HostTime{} + std::chrono::seconds(i),
                                std::chrono::seconds(2)))
        << i;
  EXPECT_TRUE(mismatch.lasts({921'600, 9600}, HostTime{} + std::chrono::seconds(10), std::chrono::seconds(2)));
}

TEST_F(MonitorTest, AChangeOfAPortIsReported) {
  Monitor monitor = this->monitor();
  const std::string port = "pty:" + path("imu");
  imu_.port_state = PortState::no_reader;
  monitor.update();
  monitor.update();
  imu_.port_state = PortState::ready;
  monitor.update();
  imu_.port_state = PortState::lost;
  monitor.finish({});
  EXPECT_EQ(logged(), (Lines{"info imu1: nobody has " + port + " open; frames are discarded",
                             "info imu1: " + port + " takes frames",
                             "warning imu1: " + port + " is lost; frames are dropped until it is back"}));
}

TEST_F(MonitorTest, AClientThatTriesSpeedsIsReportedTenTimes) {
  Monitor monitor = this->monitor();
  imu_.speeds = Port::Speeds{921'600, 9600};
  for (int i = 0; i < 20; ++i) {
    imu_.port_state = PortState::wrong_speed;
    monitor.update();
    imu_.port_state = PortState::ready;
    monitor.update();
  }
  std::size_t wrong = 0, last = 0;
  for (const std::string& line : logged()) {
    wrong += line.find("the line has 921600 baud and the client 9600") != line.npos;
    last += line.ends_with("(reported for the last time)");
  }
  EXPECT_EQ(wrong, 10U);
  EXPECT_EQ(last, 1U);
}

// By the host's clock, since the arrival of the newest truth; of a capture the arrivals are in the past.
TEST_F(MonitorTest, StatesHowLongTruthHasBeenMissing) {
  EXPECT_FALSE(monitor().now().truth.since_newest_s) << "none has come";
  truth_.newest_ns = host_now().ns - 2'000'000'000;
  EXPECT_FALSE(monitor().now().truth.since_newest_s) << "none was accepted";
  truth_.accepted.count();
  EXPECT_NEAR(monitor().now().truth.since_newest_s.value_or(0), 2, 1);
  config_.truth.port = "file:flight.pcap";
  EXPECT_FALSE(monitor().now().truth.since_newest_s);
}

TEST_F(MonitorTest, TheQualityFileEndsWithTheRun) {
  Monitor monitor = this->monitor({.log_every_s = 0, .quality_file = path("quality.jsonl")});
  truth_.received.count(3);
  imu_.samples.count(7);
  const Summary whole = monitor.finish("cut short after record 3");
  EXPECT_EQ(whole.imus.at(0).counters[&ImuCounters::samples], 7U);
  EXPECT_EQ(whole.truth.warning, "cut short after record 3");
  const Lines lines = lines_of(read_file(path("quality.jsonl")));
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(nlohmann::json::parse(lines[0])["truth"]["received"], 3);
  EXPECT_EQ(nlohmann::json::parse(lines[0])["truth"]["warning"], "cut short after record 3");
}

TEST_F(MonitorTest, AQualityFileThatCannotBeWrittenIsAnError) {
  EXPECT_THROW(monitor({.log_every_s = 0, .quality_file = path("no/such/folder")}), std::runtime_error);
}

// A write fails; the file is whole again, and rotated.
TEST_F(MonitorTest, AfterAFailedWriteTheQualityFileIsOpenedAgain) {
  std::filesystem::create_symlink("/dev/full", path("quality.jsonl"));
  Monitor monitor = this->monitor({.log_every_s = 0, .quality_file = path("quality.jsonl")});
  for (const HostTime begin = host_now(); monitor.quality_error().empty();) {
    ASSERT_LT(seconds(host_now() - begin), 60);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    monitor.update();
  }
  std::filesystem::remove(path("quality.jsonl"));
  monitor.reopen();
  monitor.finish({});
  EXPECT_EQ(lines_of(read_file(path("quality.jsonl"))).size(), 1U);
}

// As on a disk that is full for a while: a line is cut, and later lines are whole.
TEST_F(MonitorTest, AFullDiskCutsNoLineOfTheQualityFile) {
  const std::string file = path("quality.jsonl");
  Monitor monitor =
      this->monitor({.log_every_s = 0, .quality_file = file, .first_truth_s = 3600, .wrong_speed_s = 0});
  const auto update_until = [&](const auto& done) {
    for (const HostTime begin = host_now(); !done() && seconds(host_now() - begin) < 60;) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      monitor.update();
    }
  };
  update_until([&] { return std::filesystem::file_size(file) > 0; });
  const std::uintmax_t size = std::filesystem::file_size(file);
  ASSERT_GT(size, 200U);
  logged();

  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit full{size + 100, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &full), 0);
  update_until([&] { return !monitor.quality_error().empty(); });
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  const std::string error = file + ": cannot be written: File too large";
  EXPECT_EQ(monitor.quality_error(), error);
  EXPECT_EQ(logged(), Lines{"error " + error + "; tried again each second"});
  EXPECT_EQ(std::filesystem::file_size(file), size);

  monitor.reopen();
  update_until([&] { return std::filesystem::file_size(file) > size; });
  EXPECT_EQ(logged(), (Lines{"info SIGHUP: the file of the figures is opened again",
                             "info " + file + ": takes figures again"}));
  const Lines lines = lines_of(read_file(file));
  ASSERT_EQ(lines.size(), 2U);
  for (const std::string& line : lines)
    EXPECT_FALSE(nlohmann::json::parse(line, nullptr, false).is_discarded()) << line;
  EXPECT_EQ(monitor.quality_error(), error) << "lines are missing";
}

TEST_F(MonitorTest, TwoProcessesDoNotWriteOneFile) {
  std::optional<TextFile> one(path("figures"));
  const auto fault = [&] {
    try {
      TextFile another(path("figures"));
      return std::string();
    } catch (const OpenError& error) {
      return std::string(error.what());
    }
  };
  EXPECT_EQ(fault(), path("figures") + ": is written by another process; give another file");
  one->reopen();  // the same file
  EXPECT_NE(fault(), "");
  std::filesystem::rename(path("figures"), path("figures.1"));
  EXPECT_EQ(fault(), "") << "a new file of that name";
  {
    const TextFile another(path("figures"));
    EXPECT_THROW(one->reopen(), OpenError);
    EXPECT_THROW(TextFile old(path("figures.1")), OpenError) << "it is still written, and locked";
  }
  one.reset();
  EXPECT_EQ(fault(), "");
}

}  // namespace
}  // namespace imud
