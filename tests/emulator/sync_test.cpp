// Edges by UDP: when devices receive them, and which pulses are sent.
#include "emulator/imu/sync.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <boost/endian/conversion.hpp>
#include <cstring>
#include <deque>
#include <limits>
#include <map>

#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::byte>;

struct FakePort final : Port {
  void send(std::span<const Frame> frames) noexcept override {
    for (const Frame& frame : frames) sent.emplace_back(frame.bytes.begin(), frame.bytes.end());
  }
  std::optional<Received> receive() noexcept override {
    if (waiting.empty()) return std::nullopt;
    held = waiting.front();
    waiting.pop_front();
    return Received{{held}, {}};
  }
  std::deque<Bytes> waiting;
  std::vector<Bytes> sent;
  Bytes held;
};

struct FakeDevice final : Device {
  void sample(const Sample&, FrameBuffer&) noexcept override {}
  void trigger(DeviceTime time) noexcept override { triggers.push_back(time.ns); }
  void pps(DeviceTime time) noexcept override { seconds.push_back(time.ns); }
  std::optional<Pulse> pulse() const noexcept override { return out; }
  std::vector<std::int64_t> triggers, seconds;
  std::optional<Pulse> out;
};

Bytes number(std::int64_t ns) {
  Bytes bytes(8);
  boost::endian::store_little_s64(reinterpret_cast<unsigned char*>(bytes.data()), ns);
  return bytes;
}

struct Pins {
  std::map<std::string, FakePort*, std::less<>> ports;
  FakeDevice device;
  Sync sync{{"trigger", "pps", "tov"}, [this](const PortUse& use) {
              EXPECT_EQ(use.settings.role, use.of == PortUse::Of::pulse ? Role::device : Role::listener);
              auto port = std::make_unique<FakePort>();
              ports[std::string(use.text)] = port.get();
              return port;
            }};
  void sample(std::int64_t ns) { sync.deliver_edges(device, TruthTime{ns}, DeviceTime{ns + 7'000}); }
};

TEST(Sync, DeliversAnEdgeBeforeTheSampleAfterIt) {
  Pins pins;
  pins.sample(1000);
  pins.ports["trigger"]->waiting = {number(1500), number(2500), Bytes(), number(1)};
  pins.ports["pps"]->waiting = {number(2000)};
  pins.sample(2000);
  EXPECT_EQ(pins.device.triggers, std::vector<std::int64_t>{8500}) << "in the device's time";
  EXPECT_EQ(pins.device.seconds, std::vector<std::int64_t>{9000});
  pins.sample(3000);
  EXPECT_EQ(pins.device.triggers, (std::vector<std::int64_t>{8500, 9500, 9000, 9000}))
      << "in order; that without a time came by 2000, that of long ago counts as of the last sample";
}

// The device's clock counts its own seconds; a second of a slow simulator takes several of them.
TEST(Sync, AnEdgeIsStampedAtTheSimulatorsRate) {
  for (const std::int64_t rate : {1, 4}) {
    Pins pins;
    pins.sync.deliver_edges(pins.device, TruthTime{1000}, DeviceTime{50'000});
    pins.ports["trigger"]->waiting = {number(1750)};
    pins.ports["pps"]->waiting = {number(1250)};
    pins.sync.deliver_edges(pins.device, TruthTime{2000}, DeviceTime{50'000 + 1000 * rate});
    EXPECT_EQ(pins.device.triggers, std::vector<std::int64_t>{50'000 + 750 * rate});
    EXPECT_EQ(pins.device.seconds, std::vector<std::int64_t>{50'000 + 250 * rate});
  }
}

TEST(Sync, BearsAnyTimeAndAnyNumber) {
  Pins pins;
  constexpr auto most = std::numeric_limits<std::int64_t>::max(), least = std::numeric_limits<std::int64_t>::min();
  pins.ports["trigger"]->waiting = {number(least), number(most)};
  pins.sample(5'000);
  EXPECT_EQ(pins.device.triggers, std::vector<std::int64_t>{12'000}) << "the other one never comes";
  for (int i = 0; i < 1000; ++i) pins.ports["trigger"]->waiting.push_back(number(1'000'000 + i));
  for (int i = 0; i < 100; ++i) pins.sample(6'000 + i);
  EXPECT_TRUE(pins.ports["trigger"]->waiting.empty());
  pins.sample(2'000'000);
  EXPECT_EQ(pins.device.triggers.size(), 65U);
  pins.ports["trigger"]->waiting = {number(3'000'000)};
  pins.sample(2'500'000);
  pins.sync.begin_run();
  pins.sample(4'000'000);
  EXPECT_EQ(pins.device.triggers.size(), 66U) << "a pause: time goes on";
  pins.ports["trigger"]->waiting = {number(5'000'000)};
  pins.sample(4'500'000);
  pins.sync.begin_run();
  pins.sample(1'000'000);
  pins.sample(6'000'000);
  EXPECT_EQ(pins.device.triggers.size(), 66U) << "time restarted: without edges of the old run";
  EXPECT_EQ(pins.sync.refused(), 1U + 1000 - 64);
}

// A live engine may begin a run between the preparation of a sample and its delivery.
TEST(Sync, ASampleOfTheOldRunMayFollowTheBeginOfANewOne) {
  Pins pins;
  pins.sample(1'000'000'000);
  pins.sync.begin_run();
  pins.sample(1'001'000'000);
  pins.ports["trigger"]->waiting = {number(-2'000)};
  pins.sample(0);
  EXPECT_EQ(pins.device.triggers, std::vector<std::int64_t>{7'000}) << "as of the first sample of the new run";
}

TEST(Sync, DiscardsEdgesWhileTheSensorIsSilent) {
  Pins pins;
  pins.sample(1'000'000);
  pins.ports["trigger"]->waiting = {number(1'500'000), number(9'000'000)};
  pins.sync.discard_edges();
  EXPECT_TRUE(pins.ports["trigger"]->waiting.empty());
  pins.sample(10'000'000);
  EXPECT_TRUE(pins.device.triggers.empty());
}

TEST(Sync, SendsThePulseInTheSimulationsTime) {
  Pins pins;
  pins.sample(1'000'000);
  pins.sync.send_pulse(pins.device);
  EXPECT_TRUE(pins.ports["tov"]->sent.empty());
  pins.device.out = Device::Pulse{DeviceTime{1'008'000}, DeviceTime{1'009'500}};
  pins.sync.send_pulse(pins.device);
  Bytes wanted = number(1'001'000);
  const Bytes end = number(1'002'500);
  wanted.insert(wanted.end(), end.begin(), end.end());
  EXPECT_EQ(pins.ports["tov"]->sent, std::vector<Bytes>{wanted});
}

// The STIM300 in lockstep: an edge in each truth interval, and a datagram for each edge.
TEST_F(LiveTest, TriggersByUdpMakeTheSensorSend) {
  Simulator edges;
  const std::string c = write("config.toml", fmt::format(R"(clock = "lockstep"
truth.port = "{}"
[[imu]]
protocol = "stim300"
port = "file:{}"
device.sample_rate = 0
device.start_up = false
sync.trigger_port = "{}"
)",
                                                         simulator_.port(), path("out"), edges.port()));
  Program imud("imud");
  start(imud, c);
  for (std::int64_t ms = 0; ms < 100; ms += 10) {
    if (ms > 0) edges.send(number(1'000'000 * ms - 4'800'000));
    ASSERT_TRUE(simulator_.exchange(Simulator::truth(ms, static_cast<std::uint32_t>(ms), true)));
  }
  EXPECT_EQ(imud.stop(), 0);
  const std::string sent = read_file(path("out"));
  ASSERT_EQ(sent.size(), 9 * 59U);
  for (std::size_t i = 0; i < 9; ++i) {
    const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(sent[59 * i + at]); };
    EXPECT_EQ(byte(0), 0xA7);
    EXPECT_EQ(byte(52), 20 * i + 9) << "the sample of 4.5 ms: that of 5 ms is not compensated yet";
    EXPECT_EQ(byte(53) << 8 | byte(54), 700) << "us from it to the edge";
  }
}

// The pulse of each sample is sent by UDP, in simulation time.
TEST_F(LiveTest, ThePulseOfEachSampleLeavesByUdp) {
  const FileDescriptor listener(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), size), 0);
  ASSERT_EQ(::getsockname(listener.get(), reinterpret_cast<sockaddr*>(&address), &size), 0);
  Program imud("imud");
  start(imud, write("config.toml", fmt::format(R"(clock = "lockstep"
truth.port = "{}"
[[imu]]
protocol = "stim300"
port = "file:{}"
device.sample_rate = 125
device.start_up = false
sync.tov_port = "udp:127.0.0.1:{}"
)",
                                               simulator_.port(), path("out"), ntohs(address.sin_port))));
  for (std::int64_t ms = 0; ms <= 80; ms += 8)
    ASSERT_TRUE(simulator_.exchange(Simulator::truth(ms, static_cast<std::uint32_t>(ms), true)));
  EXPECT_EQ(imud.stop(), 0);
  for (std::int64_t k = 0; k <= 10; ++k) {
    std::array<std::int64_t, 2> pulse{};  // on a little-endian host
    pollfd ready{listener.get(), POLLIN, 0};
    ASSERT_EQ(::poll(&ready, 1, 1000), 1) << k;
    ASSERT_EQ(::recv(listener.get(), pulse.data(), sizeof pulse, 0), 16);
    EXPECT_GE(pulse[0], 8'000'000 * k);
    EXPECT_LT(pulse[0], 8'000'000 * k + 1'000'000);
    EXPECT_GT(pulse[1] - pulse[0], 59 * 10 * 1'000'000 / 922) << "as long as the datagram is on the line";
    EXPECT_LT(pulse[1] - pulse[0], 1'000'000);
  }
}

// A VectorNav whose host sets SyncIn to mode 5: a message for each edge, and none without.
TEST_F(LiveTest, SyncInMakesAVectorNavSend) {
  Simulator edges;
  Program imud("imud");
  start(imud, write("config.toml", fmt::format(R"(clock = "lockstep"
truth.port = "{}"
[[imu]]
protocol = "vectornav"
port = "pty:{}"
sync.trigger_port = "{}"
)",
                                               simulator_.port(), path("imu"), edges.port())));
  std::int64_t ms = 0;
  const auto step = [&] {
    ms += 10;
    return simulator_.exchange(Simulator::truth(ms, static_cast<std::uint32_t>(ms), true)).has_value();
  };
  ASSERT_TRUE(eventually([&] { return std::filesystem::is_symlink(path("imu")); }));
  ASSERT_TRUE(step());
  const FileDescriptor host(::open(path("imu").c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios raw{};
  ::tcgetattr(host.get(), &raw);
  ::cfmakeraw(&raw);
  ::tcsetattr(host.get(), TCSANOW, &raw);
  const std::string command = "$VNWRG,32,5,0,0,0,0,0,0,0,0*XX\r\n$VNWRG,30,1,0,0,0,1,0,1*XX\r\n";
  ASSERT_EQ(::write(host.get(), command.data(), command.size()), static_cast<ssize_t>(command.size()));
  std::string received;
  const auto receive = [&] {
    std::array<char, 4096> buffer;
    for (ssize_t size = 1; size > 0;) {
      size = ::read(host.get(), buffer.data(), buffer.size());
      if (size > 0) received.append(buffer.data(), static_cast<std::size_t>(size));
    }
  };
  for (int i = 0; i < 30; ++i) {
    ASSERT_TRUE(step());
    receive();
  }
  EXPECT_NE(received.find("$VNWRG,30,1"), received.npos);
  received.clear();
  constexpr int events = 12;
  for (int i = 0; i < events; ++i) {
    edges.send(number(1'000'000 * ms + 4'800'000));
    ASSERT_TRUE(step());
    receive();
    ASSERT_TRUE(step());
    receive();
  }
  EXPECT_EQ(imud.stop(), 0);
  receive();
  std::vector<std::string> counts;
  for (const std::string& line : lines_of(received)) {
    EXPECT_TRUE(line.starts_with("$VNYMR,")) << line;
    counts.push_back(line.substr(line.rfind(',') + 1, line.find('*') - line.rfind(',') - 1));
  }
  ASSERT_EQ(counts.size(), static_cast<std::size_t>(events));
  for (int i = 0; i < events; ++i) EXPECT_EQ(counts[static_cast<std::size_t>(i)], fmt::format("T{}", i + 1));
}

}  // namespace
}  // namespace imud
