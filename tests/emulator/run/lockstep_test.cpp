// imud run in lockstep: which truths are refused and answered, and that nothing else changes a byte.
#include <fcntl.h>
#include <sys/stat.h>

#include <cstring>
#include <limits>
#include <numeric>

#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

// Patches a field and corrects the checksum, so that only the patched field is wrong.
Simulator::Datagram patched(Simulator::Datagram d, std::size_t offset, double value) {
  std::memcpy(d.data() + offset, &value, sizeof value);
  std::uint32_t crc = ~0U;  // CRC-32C, bit by bit: independent of the library under test
  for (std::size_t i = 0; i < 196; ++i) {
    crc ^= std::to_integer<std::uint32_t>(d[i]);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ (crc & 1U ? 0x82F63B78U : 0U);
  }
  crc = ~crc;
  std::memcpy(d.data() + 196, &crc, sizeof crc);
  return d;
}

TEST_F(LiveTest, EveryBadTruthIsCountedByCauseAndNeverReachesTheModel) {
  const std::string c = config("lockstep", simulator_.port(), "native", 100, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  std::uint32_t sequence = 0;
  std::int64_t ms = 0;
  const auto good = [&] {
    const auto a = simulator_.exchange(Simulator::truth(ms, sequence++, true));
    ASSERT_TRUE(a.has_value());
    EXPECT_EQ(a->time.ns, ms * 1'000'000);
    EXPECT_EQ(a->samples, static_cast<std::uint64_t>(ms / 10 + 1));
    ms += 10;
  };
  for (int i = 0; i < 10; ++i) good();

  const auto next = Simulator::encode(Simulator::truth(ms, sequence, false));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  simulator_.send(std::span(next).first(207));
  simulator_.send(std::span(next).first(0));
  std::vector<std::byte> longer(next.begin(), next.end());
  longer.resize(209);
  simulator_.send(longer);
  for (std::size_t offset = 24; offset < 192; offset += 24) simulator_.send(patched(next, offset, nan));
  simulator_.send(patched(next, 72, inf));
  simulator_.send(patched(next, 112, -inf));
  simulator_.send(patched(next, 96, 1e300));
  auto wrong = next;
  wrong[4] = std::byte{3};
  simulator_.send(patched(wrong, 24, 0.0));  // version 3, checksum right
  wrong = next;
  wrong[100] ^= std::byte{1};
  simulator_.send(wrong);
  wrong = next;
  wrong[0] = std::byte{'X'};
  simulator_.send(wrong);
  good();

  // Order: a duplicate, a reordered truth, a time step back, another vehicle.
  simulator_.send(Simulator::encode(Simulator::truth(ms - 10, sequence - 1, false)));
  simulator_.send(Simulator::encode(Simulator::truth(ms - 15, sequence - 2, false)));
  simulator_.send(Simulator::encode(Simulator::truth(ms - 15, sequence + 5, false)));
  simulator_.send(Simulator::encode(Simulator::truth(1'000'000'000, sequence + 6, false)));
  Truth other = Simulator::truth(ms, sequence, false);
  other.stream = 9;
  simulator_.send(Simulator::encode(other));
  for (int i = 0; i < 10; ++i) good();

  EXPECT_EQ(imud.stop(), 0);
  const auto refused = summary()["truth"]["refused"];
  EXPECT_EQ(refused["short"], 2);
  EXPECT_EQ(refused["long"], 1);
  EXPECT_EQ(refused["not_finite"], 9);
  EXPECT_EQ(refused["range"], 1);
  EXPECT_EQ(refused["version"], 1);
  EXPECT_EQ(refused["crc"], 1);
  EXPECT_EQ(refused["magic"], 1);
  EXPECT_EQ(refused["duplicate"], 1);
  EXPECT_EQ(refused["reordered"], 1);
  EXPECT_EQ(refused["time_back"], 1);
  EXPECT_EQ(refused["time_jump"], 1);
  EXPECT_EQ(refused["stream"], 1);
  EXPECT_EQ(summary()["truth"]["accepted"], 21);
  EXPECT_EQ(summary()["truth"]["runs"], 1);
  EXPECT_NE(imud.errors().find("truth refused: crc"), std::string::npos);

  // The same as from the good truths alone.
  const std::string disturbed = read_file(path("out"));
  Program again("imud");
  start(again, c);
  for (std::uint32_t i = 0; i < 21; ++i)
    ASSERT_TRUE(simulator_.exchange(Simulator::truth(10 * i, i, true)).has_value());
  EXPECT_EQ(again.stop(), 0);
  EXPECT_EQ(rows(disturbed).size(), 21U);
  EXPECT_TRUE(disturbed == read_file(path("out")));
}

// Everything that differs between imus: rates, phases, clock errors, noise.
std::string noisy_imus(int imus, const std::string& folder) {
  std::string text;
  for (int i = 0; i < imus; ++i)
    text += fmt::format(R"([[imu]]
name = "i{0}"
rate_hz = {1}
clock_error_ppm = {2}
phase_us = {3}
protocol = "native"
port = "file:{4}/lockstep{0}"
gyro.max_rad_per_s = 100
gyro.walk_sqrt_cov = [0.01, 0.01, 0.01]
accelerometer.max_m_per_s2 = 1000
accelerometer.walk_transition = [0, 0, 0]
accelerometer.walk_sqrt_cov = [0.1, 0.1, 0.1]
)",
                        i, 100 + 77 * i, i % 3 == 0 ? 0 : 100 * (i - 8), i % 2 == 0 ? 0 : 250 * i, folder);
  return text;
}

TEST_F(LiveTest, LockstepAndFastGiveTheSameBytesUnderLoadToo) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "50", "--for", "4"}).exit_code,
            0);
  for (const int imus : {1, 16}) {
    const std::string c = write("config.toml", "seed = 3\nclock = \"lockstep\"\ntruth.port = \"" + simulator_.port() +
                                                   "\"\n" + noisy_imus(imus, folder_));
    std::vector<std::string> fast = {"replay", c, path("truth.csv"), "--fast", "--set", "truth.format=csv"};
    for (int i = 0; i < imus; ++i) {
      fast.emplace_back("--set");
      fast.push_back(fmt::format("imu.{0}.port=file:{1}/fast{0}", i, folder_));
    }
    ASSERT_EQ(run_program("imud", fast).exit_code, 0);
    for (const int burning : {0, 4}) {  // busy threads
      std::vector<std::jthread> load;
      for (int i = 0; i < burning; ++i)
        load.emplace_back([](const std::stop_token& stop) {
          for (volatile int n = 0; !stop.stop_requested();) n = n + 1;
        });
      Program imud("imud");
      start(imud, c);
      const ProgramResult sent = run_program(
          "imu-truth", {"spiral", "--to", simulator_.port(), "--rate", "50", "--for", "4", "--lockstep", "--fast"});
      EXPECT_EQ(sent.exit_code, 0) << sent.errors;
      EXPECT_EQ(imud.stop(), 0) << imud.errors();
      for (int i = 0; i < imus; ++i) {
        const std::string lockstep = read_file(path(fmt::format("lockstep{}", i)));
        EXPECT_NEAR(static_cast<double>(lockstep.size()), 124.0 * (4 * (100 + 77 * i) + 1), 6 * 124.0);
        EXPECT_TRUE(lockstep == read_file(path(fmt::format("fast{}", i)))) << i << " of " << imus;
      }
    }
  }
}

// When the answer has arrived, the samples are in the file.
TEST_F(LiveTest, WhatIsAnsweredIsWritten) {
  const std::string c = config("lockstep", simulator_.port(), "native", 100, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  for (std::uint32_t i = 0; i < 20; ++i) {
    ASSERT_TRUE(simulator_.exchange(Simulator::truth(10 * i, i, true)));
    ASSERT_EQ(rows(read_file(path("out"))).size(), i + 1);
  }
  EXPECT_EQ(imud.stop(), 0);
}

// Frames for a pipe are gathered, but never beyond the answer, even if they are more than the pipe holds.
TEST_F(LiveTest, WhatIsAnsweredIsInThePipe) {
  constexpr std::size_t frame = 124;
  ASSERT_EQ(::mkfifo(path("fifo").c_str(), 0600), 0);
  const FileDescriptor fifo(::open(path("fifo").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  const std::string c = config("lockstep", simulator_.port(), "native", 1000, "native", "file:" + path("fifo"));
  Program imud("imud");
  start(imud, c);
  std::size_t size = 0;
  const auto read_some = [&] {
    std::array<std::byte, 10'000> bytes;
    const ssize_t got = ::read(fifo.get(), bytes.data(), bytes.size());
    if (got > 0) size += static_cast<std::size_t>(got);
    return got > 0;
  };
  for (std::uint32_t i = 0; i < 8; ++i) {
    std::jthread reader([&](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (i > 3) read_some();  // slowly
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    });
    const std::int64_t ms = i <= 3 ? 400 * i : 1200 + 1000 * (i - 3);  // one per ms: 49,600 bytes, then 124,000
    ASSERT_TRUE(simulator_.exchange(Simulator::truth(ms, i, true)));
    reader.request_stop();
    reader.join();
    while (read_some()) {
    }
    ASSERT_EQ(size, frame * static_cast<std::size_t>(ms + 1)) << i;
  }
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(summary()["imus"][0]["dropped"], 0);
}

TEST_F(LiveTest, ASlowReaderOfALockstepRunMissesNothing) {
  const std::string c = config("lockstep", simulator_.port(), "native", 1000, "native", "pty:" + path("imu"));
  Program imud("imud");
  start(imud, c);
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  Program decode("imu-decode");
  decode.start({"native", "pty:" + path("imu"), "--count", "2001"});
  ASSERT_TRUE(imud.wait_for_errors("takes frames"));
  // 2001 samples of 124 bytes: twelve times what a pty holds.
  const ProgramResult sent = run_program(
      "imu-truth", {"spiral", "--to", simulator_.port(), "--rate", "10", "--for", "2", "--lockstep", "--fast"});
  EXPECT_EQ(sent.exit_code, 0) << sent.errors;
  EXPECT_EQ(decode.wait(), 0);
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(summary()["imus"][0]["dropped"], 0);
  EXPECT_EQ(rows(decode.output()).size(), 2001U);
}

TEST_F(LiveTest, ALostAnswerIsRepeatedAndNothingIsEmittedTwice) {
  const std::string c = config("lockstep", simulator_.port(), "native", 100, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  for (std::uint32_t i = 0; i < 20; ++i) {
    const auto first = simulator_.exchange(Simulator::truth(10 * i, i, true));
    const auto second = simulator_.exchange(Simulator::truth(10 * i, i, true));  // as if the answer was lost
    ASSERT_TRUE(first && second);
    EXPECT_EQ(second->sequence, i);
    EXPECT_EQ(second->time.ns, first->time.ns);
    EXPECT_EQ(second->samples, first->samples);
    while (simulator_.answer(0)) {
    }
  }
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(rows(read_file(path("out"))).size(), 20U);
}

TEST_F(LiveTest, ARestartedSimulatorBeginsANewRun) {
  const std::string c = config("lockstep", simulator_.port(), "native", 100, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  Truth first = Simulator::truth(0, 0, true);
  first.new_run = true;
  for (int run = 0; run < 2; ++run) {
    ASSERT_TRUE(simulator_.exchange(first));
    for (std::uint32_t i = 1; i < 10; ++i) ASSERT_TRUE(simulator_.exchange(Simulator::truth(200 * i, i, true)));
  }
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(summary()["truth"]["runs"], 2);
  const auto all = rows(read_file(path("out")));
  ASSERT_EQ(all.size(), 362U);
  EXPECT_EQ(all[181][0], "0");
  EXPECT_EQ(all[181][1], "181");  // the device's counter continues
  for (std::size_t field = 8; field < 14; ++field) EXPECT_EQ(all[181][field], "0");
}

TEST_F(LiveTest, ARepeatedFirstTruthIsADuplicate) {
  const std::string c = config("lockstep", simulator_.port(), "native", 100, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  Truth first = Simulator::truth(0, 0, true);
  first.new_run = true;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulator_.exchange(first));
  for (std::uint32_t i = 1; i < 10; ++i) ASSERT_TRUE(simulator_.exchange(Simulator::truth(10 * i, i, true)));
  ASSERT_TRUE(simulator_.exchange(first));
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(summary()["truth"]["runs"], 1);
  EXPECT_GE(summary()["truth"]["refused"]["duplicate"], 3);
  EXPECT_EQ(rows(read_file(path("out"))).size(), 10U);
}

TEST_F(LiveTest, ADisturbedNetworkChangesNoByteOfALockstepRun) {
  const std::string c = config("lockstep", simulator_.port(), "native", 100, "csv", "file:" + path("out"));
  const auto run = [&](std::vector<std::string> faults) {
    Program imud("imud");
    start(imud, c);
    std::vector<std::string> arguments = {"spiral", "--to", simulator_.port(), "--rate", "100",
                                          "--for",  "3",    "--lockstep",      "--fast"};
    arguments.insert(arguments.end(), faults.begin(), faults.end());
    const ProgramResult sent = run_program("imu-truth", arguments);
    EXPECT_EQ(sent.exit_code, 0) << sent.errors;
    EXPECT_EQ(imud.stop(), 0);
    return read_file(path("out"));
  };
  const std::string clean = run({});
  EXPECT_EQ(rows(clean).size(), 301U);
  EXPECT_TRUE(clean == run({"--drop", "2", "--duplicate", "10", "--corrupt", "2", "--seed", "4"}));
  EXPECT_GT(summary()["truth"]["refused"]["duplicate"], 0);
  EXPECT_GT(summary()["truth"]["refused"].size(), 1U);
}

}  // namespace
}  // namespace imud
