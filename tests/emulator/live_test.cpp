// imud run with truth by UDP: what is refused, the clocks, the ports' misfortunes, the end.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/motion.hpp"
#include "protocols/native_truth.hpp"
#include "tests/emulator/run_test.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {
namespace {

// A simulator of our own.
class Simulator {
 public:
  Simulator() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    // A port that is free now; imud binds it a moment later.
    const FileDescriptor probe(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address_;
    if (::bind(probe.get(), reinterpret_cast<const sockaddr*>(&address_), size) != 0 ||
        ::getsockname(probe.get(), reinterpret_cast<sockaddr*>(&address_), &size) != 0)
      throw std::runtime_error("no UDP port");
  }
  std::string port() const { return fmt::format("udp:127.0.0.1:{}", ntohs(address_.sin_port)); }

  using Datagram = std::array<std::byte, 208>;
  // A truth of the spiral with angular acceleration, specific force and accumulated velocity.
  static Truth truth(std::int64_t ms, std::uint32_t sequence, bool acknowledge) {
    Truth t = find_motion("spiral")->at(TruthTime{ms * 1'000'000}, {});
    t.sequence = sequence;
    t.acknowledge = acknowledge;
    return t;
  }
  static Datagram encode(const Truth& t) {
    Datagram d{};
    encode_native_truth(t, d);
    return d;
  }
  void send(std::span<const std::byte> bytes) {
    ::sendto(socket_.get(), bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&address_),
             sizeof address_);
  }
  // The answer; nullopt if none comes within `timeout_ms`.
  std::optional<NativeAcknowledgement> answer(int timeout_ms) {
    pollfd ready{socket_.get(), POLLIN, 0};
    if (::poll(&ready, 1, timeout_ms) <= 0) return std::nullopt;
    std::array<std::byte, 64> bytes{};
    const ssize_t size = ::recv(socket_.get(), bytes.data(), bytes.size(), 0);
    NativeAcknowledgement acknowledgement{};
    if (size < 0 || !decode_native_acknowledgement(std::span(bytes).first(static_cast<std::size_t>(size)), acknowledgement))
      return std::nullopt;
    return acknowledgement;
  }
  // Sends until the answer comes: imud may not be there yet.
  std::optional<NativeAcknowledgement> exchange(const Truth& t) {
    const Datagram d = encode(t);
    for (int i = 0; i < 100; ++i) {
      send(d);
      if (const auto acknowledgement = answer(200)) return acknowledgement;
    }
    return std::nullopt;
  }

 private:
  FileDescriptor socket_;
  sockaddr_in address_{};
};

class LiveTest : public RunTest {
 protected:
  void start(Program& imud, const std::string& config, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"run", config, "--summary", path("summary.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    imud.start(arguments);
  }
  Simulator simulator_;
};

// Patches a field and mends the checksum, so that only the patched field is wrong.
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
  wrong[4] = std::byte{2};
  simulator_.send(patched(wrong, 24, 0.0));  // version 2, checksum right
  wrong = next;
  wrong[100] ^= std::byte{1};
  simulator_.send(wrong);
  wrong = next;
  wrong[0] = std::byte{'X'};
  simulator_.send(wrong);
  good();

  // Order: a duplicate, an overtaken one, a clock that ran back, another vehicle.
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

TEST_F(LiveTest, LockstepAndFastGiveTheSameBytes) {
  ASSERT_EQ(run_program("imu-truth", {"spiral", "--csv", path("truth.csv"), "--rate", "50", "--for", "4"}).exit_code, 0);
  const std::string noisy = R"(seed = 3
clock = "lockstep"
[truth]
port = ")" + simulator_.port() + R"("
)";
  std::string imus;
  for (int i = 0; i < 4; ++i)
    imus += fmt::format(R"([[imu]]
name = "i{0}"
rate_hz = {1}
protocol = "native"
port = "file:{2}/lockstep{0}"
gyro.max_rad_per_s = 100
gyro.walk_sqrt_cov = [0.01, 0.01, 0.01]
accelerometer.max_m_per_s2 = 1000
accelerometer.walk_transition = [0, 0, 0]
accelerometer.walk_sqrt_cov = [0.1, 0.1, 0.1]
)",
                        i, 100 + 77 * i, folder_);
  const std::string c = write("config.toml", noisy + imus);
  Program imud("imud");
  start(imud, c);
  const ProgramResult sent = run_program(
      "imu-truth", {"spiral", "--to", simulator_.port(), "--rate", "50", "--for", "4", "--lockstep", "--fast"});
  EXPECT_EQ(sent.exit_code, 0) << sent.errors;
  EXPECT_EQ(imud.stop(), 0) << imud.errors();
  std::vector<std::string> fast = {"replay", c, path("truth.csv"), "--fast", "--set", "truth.format=csv"};
  for (int i = 0; i < 4; ++i) {
    fast.emplace_back("--set");
    fast.push_back(fmt::format("imu.{0}.port=file:{1}/fast{0}", i, folder_));
  }
  ASSERT_EQ(run_program("imud", fast).exit_code, 0);
  for (int i = 0; i < 4; ++i) {
    const std::string lockstep = read_file(path(fmt::format("lockstep{}", i)));
    EXPECT_EQ(lockstep.size(), 124U * static_cast<std::size_t>(4 * (100 + 77 * i) + 1));
    EXPECT_TRUE(lockstep == read_file(path(fmt::format("fast{}", i)))) << i;
  }
}

TEST_F(LiveTest, ASlowReaderOfALockstepRunMissesNothing) {
  const std::string c = config("lockstep", simulator_.port(), "native", 1000, "native", "pty:" + path("imu"));
  Program imud("imud");
  start(imud, c);
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  Program decode("imu-decode");
  decode.start({"native", "pty:" + path("imu")});
  ASSERT_TRUE(imud.wait_for_errors("takes frames"));
  // 2001 samples of 124 bytes: twelve times what a pty holds.
  const ProgramResult sent = run_program(
      "imu-truth", {"spiral", "--to", simulator_.port(), "--rate", "10", "--for", "2", "--lockstep", "--fast"});
  EXPECT_EQ(sent.exit_code, 0) << sent.errors;
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(decode.wait(), 0);
  EXPECT_EQ(summary()["imus"][0]["dropped"], 0);
  EXPECT_EQ(rows(decode.output()).size(), 2001U);
}

TEST_F(LiveTest, ALostAnswerIsRepeatedAndNothingIsEmittedTwice) {
  const std::string c = config("lockstep", simulator_.port(), "native", 100, "csv", "file:" + path("out"));
  Program imud("imud");
  start(imud, c);
  for (std::uint32_t i = 0; i < 20; ++i) {
    const auto first = simulator_.exchange(Simulator::truth(10 * i, i, true));
    const auto second = simulator_.exchange(Simulator::truth(10 * i, i, true));  // the answer was lost: sent again
    ASSERT_TRUE(first && second);
    EXPECT_EQ(second->sequence, i);
    EXPECT_EQ(second->time.ns, first->time.ns);
    EXPECT_EQ(second->samples, first->samples);
    while (simulator_.answer(0)) {}
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
  EXPECT_EQ(all[181][1], "181");  // the device counts on
  for (std::size_t field = 8; field < 14; ++field) EXPECT_EQ(all[181][field], "0");
}

TEST_F(LiveTest, RealtimeKeepsTheGrid) {
  const std::string c = config("realtime", simulator_.port(), "native", 500, "native", "pty:" + path("imu"));
  Program imud("imud");
  start(imud, c, {"--set", "truth.delay_ms=50"});
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  Program decode("imu-decode");
  decode.start({"native", "pty:" + path("imu")});
  ASSERT_TRUE(imud.wait_for_errors("takes frames"));
  ASSERT_EQ(run_program("imu-truth", {"coning", "--to", simulator_.port(), "--rate", "100", "--for", "2"}).exit_code, 0);
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
    std::vector<std::string> arguments = {"spiral", "--to",  simulator_.port(), "--rate", "100",
                                          "--for",  "3", "--lockstep",       "--fast"};
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
    // Coning of 0.02 rad at 10 Hz: the rate is 1.26 rad/s at most, whatever was lost; two lost in a row bend the curve.
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

// Reads a tty until `stop` returns true; all bytes.
std::string read_until(int descriptor, const std::function<bool()>& stop) {
  std::string bytes;
  std::array<char, 4096> buffer;
  while (!stop()) {
    pollfd ready{descriptor, POLLIN, 0};
    if (::poll(&ready, 1, 10) <= 0) continue;
    const ssize_t size = ::read(descriptor, buffer.data(), buffer.size());
    if (size > 0) bytes.append(buffer.data(), static_cast<std::size_t>(size));
    if (size <= 0) break;
  }
  return bytes;
}

FileDescriptor open_raw(const std::string& path) {
  FileDescriptor tty(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios settings{};
  ::tcgetattr(tty.get(), &settings);
  ::cfmakeraw(&settings);
  ::tcsetattr(tty.get(), TCSANOW, &settings);
  return tty;
}

TEST_F(LiveTest, AReaderThatComesLateStopsAndReturnsSeesWholeFrames) {
  const std::string c = config("realtime", simulator_.port(), "native", 1000, "native", "pty:" + path("imu"));
  Program imud("imud");
  start(imud, c);
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  Program truth("imu-truth");
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "50", "--for", "60"});
  std::this_thread::sleep_for(std::chrono::milliseconds(300));  // nobody reads

  std::string bytes;
  std::uint64_t frames = 0;
  {
    const FileDescriptor reader = open_raw(path("imu"));
    bytes = read_until(reader.get(), [&, n = 0]() mutable { return ++n > 100; });
    std::this_thread::sleep_for(std::chrono::milliseconds(500));  // the reader is busy: 62 kB do not fit
    bytes += read_until(reader.get(), [&, n = 0]() mutable { return ++n > 300; });
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(imud.stop(), 0);
  truth.kill();
  write("bytes", bytes);
  const ProgramResult decoded = run_program("imu-decode", {"native", "file:" + path("bytes")});
  EXPECT_EQ(decoded.exit_code, 0);
  EXPECT_NE(decoded.errors.find("checksum   0 failures, 0 malformed"), std::string::npos) << decoded.errors;
  const auto all = rows(decoded.output);
  frames = all.size();
  ASSERT_GT(frames, 0U);
  // Nothing stale from before the reader came, frames lost while it was busy, and every frame sent or dropped.
  EXPECT_GT(std::stoul(all[0][1]), 100U);
  const auto s = summary();
  EXPECT_EQ(s["imus"][0]["frames"].get<std::uint64_t>() + s["imus"][0]["dropped"].get<std::uint64_t>(),
            s["imus"][0]["samples"].get<std::uint64_t>());
  std::uint64_t missing = 0;
  for (std::size_t i = 1; i < all.size(); ++i) {
    const auto step = std::stoul(all[i][1]) - std::stoul(all[i - 1][1]);
    ASSERT_GE(step, 1U);
    missing += step - 1;
  }
  EXPECT_GT(missing, 0U);
}

// A serial device made of a pty behind a link, so that it can be unplugged and come back.
class SerialDevice {
 public:
  explicit SerialDevice(std::string link) : link_(std::move(link)) {
    master_ = FileDescriptor(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (::grantpt(master_.get()) != 0 || ::unlockpt(master_.get()) != 0) throw std::runtime_error("no pty");
    std::array<char, 64> name{};
    ::ptsname_r(master_.get(), name.data(), name.size());
    std::filesystem::create_symlink(name.data(), link_);
  }
  ~SerialDevice() { std::filesystem::remove(link_); }
  int get() const { return master_.get(); }

 private:
  std::string link_;
  FileDescriptor master_;
};

TEST_F(LiveTest, ASerialDeviceThatIsUnpluggedAndReturns) {
  auto device = std::make_unique<SerialDevice>(path("tty"));
  const std::string c =
      config("realtime", simulator_.port(), "native", 200, "native", "serial:" + path("tty") + "?baud=921600");
  Program imud("imud");
  start(imud, c);
  Program truth("imu-truth");
  ASSERT_TRUE(eventually([&] {  // until it listens
    simulator_.send(Simulator::encode(Simulator::truth(0, 0, false)));
    return !read_until(device->get(), [n = 0]() mutable { return ++n > 5; }).empty();
  }));
  truth.start({"turntable", "--to", simulator_.port(), "--rate", "50", "--for", "60"});
  EXPECT_FALSE(read_until(device->get(), [n = 0]() mutable { return ++n > 50; }).empty());
  device.reset();
  ASSERT_TRUE(imud.wait_for_errors("is lost"));
  device = std::make_unique<SerialDevice>(path("tty"));
  ASSERT_TRUE(imud.wait_for_errors("takes frames"));
  const std::string bytes = read_until(device->get(), [n = 0]() mutable { return ++n > 100; });
  EXPECT_EQ(imud.stop(), 0);
  truth.kill();
  write("bytes", bytes.substr(0, bytes.size() / 124 * 124));
  const ProgramResult decoded = run_program("imu-decode", {"native", "file:" + path("bytes")});
  EXPECT_NE(decoded.errors.find("checksum   0 failures, 0 malformed"), std::string::npos) << decoded.errors;
  EXPECT_NE(decoded.errors.find("0 bytes skipped"), std::string::npos) << decoded.errors;  // begins with a whole frame
  const auto s = summary();
  EXPECT_GT(s["imus"][0]["dropped"], 0);
  EXPECT_EQ(s["imus"][0]["frames"].get<std::uint64_t>() + s["imus"][0]["dropped"].get<std::uint64_t>(),
            s["imus"][0]["samples"].get<std::uint64_t>());
}

}  // namespace
}  // namespace imud
