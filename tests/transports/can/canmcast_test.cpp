// canmcast: a CAN bus of multicast datagrams, on the loopback interface. Each test has a bus of its own.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "tests/transports/port_error.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/host_clock.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

std::string local_bus(int number) { return "canmcast:" + std::to_string(number) + "?interface=lo"; }

std::optional<Port::Received> next(Port& port) {
  for (int i = 0; i < 20; ++i) {
    pollfd ready{port.descriptor(), POLLIN, 0};
    if (::poll(&ready, 1, 100) == 1)
      if (const auto received = port.receive()) return received;
  }
  return std::nullopt;
}

std::vector<std::byte> bytes_of(std::string_view hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
  return bytes;
}

// A program that knows datagrams only, as ArduPilot and pydronecan have them: a socket that has joined the group, and
// another one that sends.
class Datagrams {
 public:
  explicit Datagrams(int bus) {
    group_.sin_family = AF_INET;
    group_.sin_port = htons(57732);
    group_.sin_addr.s_addr = inet_addr(("239.65.82." + std::to_string(bus)).c_str());
    const int on = 1;
    ip_mreqn request{group_.sin_addr, {htonl(INADDR_LOOPBACK)}, 0};
    EXPECT_EQ(::setsockopt(in_.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on), 0);
    EXPECT_EQ(::bind(in_.get(), reinterpret_cast<const sockaddr*>(&group_), sizeof group_), 0);
    EXPECT_EQ(::setsockopt(in_.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request), 0);
    EXPECT_EQ(::setsockopt(out_.get(), IPPROTO_IP, IP_MULTICAST_IF, &request, sizeof request), 0);
  }
  void send(std::string_view hex) const {
    const auto bytes = bytes_of(hex);
    EXPECT_EQ(::sendto(out_.get(), bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&group_),
                       sizeof group_),
              static_cast<ssize_t>(bytes.size()));
  }
  std::vector<std::byte> receive() const {
    std::vector<std::byte> bytes(2000);
    pollfd ready{in_.get(), POLLIN, 0};
    const ssize_t size = ::poll(&ready, 1, 2000) == 1 ? ::recv(in_.get(), bytes.data(), bytes.size(), 0) : 0;
    bytes.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    return bytes;
  }

 private:
  FileDescriptor in_{::socket(AF_INET, SOCK_DGRAM, 0)}, out_{::socket(AF_INET, SOCK_DGRAM, 0)};
  sockaddr_in group_{};
};

// The datagrams that pydronecan's dronecan/driver/mcast.py makes of these frames (at 08cda37).
struct Known {
  std::string_view datagram;
  CanHeader can;
  std::string_view data;
};
constexpr Known known[] = {
    {"34292C1000002AE8039472FD15CD5B070080", {.id = 0x1403E82A, .extended = true}, "72FD15CD5B070080"},
    {"3429B547010023010000000102030405060708090A0B", {.id = 0x123, .fd = true}, "000102030405060708090A0B"},
};

TEST(CanMulticast, SendsTheDatagramsOfPydronecan) {
  const Datagrams reader(1);
  const auto port = open_port(local_bus(1), Role::device);
  for (const Known& one : known) {
    const auto data = bytes_of(one.data);
    const Frame frame{data, one.can};
    port->send({&frame, 1});
    EXPECT_EQ(reader.receive(), bytes_of(one.datagram));
  }
  EXPECT_EQ(port->counters().sent, 2U);
  EXPECT_EQ(port->receive(), std::nullopt) << "own frames are not received";
}

TEST(CanMulticast, ReceivesTheDatagramsOfPydronecan) {
  const Datagrams writer(2);
  const auto port = open_port(local_bus(2), Role::device);
  for (const Known& one : known) {
    writer.send(one.datagram);
    const auto received = next(*port);
    ASSERT_TRUE(received.has_value());
    EXPECT_EQ(received->frame.can, one.can);
    const auto data = bytes_of(one.data);
    EXPECT_TRUE(std::ranges::equal(received->frame.bytes, data));
    EXPECT_LE(received->time, host_now());
  }
  EXPECT_EQ(port->counters().received, 2U);
}

TEST(CanMulticast, RefusesWhatIsNoFrame) {
  const Datagrams writer(3);
  const auto port = open_port(local_bus(3), Role::device);
  const std::string good(known[0].datagram);
  std::string other_magic = good, damaged = good, other_crc = good;
  other_magic[1] = '5';
  damaged.back() = '1';
  other_crc[5] = '2';
  for (const std::string& bad : {std::string(), good.substr(0, 18), other_magic, damaged, other_crc, good + "00",
                                 good + std::string(200, '0')})
    writer.send(bad);
  writer.send(good);
  const auto received = next(*port);
  ASSERT_TRUE(received.has_value());
  EXPECT_EQ(received->frame.can, known[0].can);
  EXPECT_EQ(port->counters().received, 1U);
  EXPECT_EQ(port->counters().not_ours, 7U);
}

TEST(CanMulticast, EveryPortOnTheBusReceivesEveryFrameOfTheOthers) {
  const auto one = open_port(local_bus(4), Role::device), two = open_port(local_bus(4), Role::device),
             listener = open_port(local_bus(4), Role::listener), elsewhere = open_port(local_bus(5), Role::listener);
  const CanFilter filters[] = {{.id = 0x20, .mask = 0x7F0}};
  two->set_filters(filters);
  constexpr unsigned count = 64;
  FrameBuffer sample;
  for (unsigned i = 0; i < count; ++i) {
    sample.room(1)[0] = static_cast<std::byte>(i);
    sample.push(1, {.id = i});
  }
  one->send(sample.frames());
  EXPECT_EQ(one->counters().sent, count);
  for (unsigned i = 0; i < count; ++i) {
    const auto received = next(*listener);
    ASSERT_TRUE(received.has_value()) << i;
    EXPECT_EQ(received->frame.can.id, i);
    EXPECT_EQ(received->frame.bytes[0], static_cast<std::byte>(i));
  }
  for (unsigned i = 0x20; i < 0x30; ++i) {
    const auto received = next(*two);
    ASSERT_TRUE(received.has_value()) << i;
    EXPECT_EQ(received->frame.can.id, i);
  }
  EXPECT_EQ(two->receive(), std::nullopt) << "filtered";
  EXPECT_EQ(elsewhere->receive(), std::nullopt) << "another bus";
}

// Where nothing may be lost, frames leave no faster than a bus carries them.
TEST(CanMulticast, IsPacedWhereNothingMayBeLost) {
  PortSettings settings = Role::device;
  settings.delivery = Delivery::complete;
  const auto port = open_port(local_bus(6) + "&frames_per_s=1000", settings);
  FrameBuffer sample;
  for (unsigned i = 0; i < 40; ++i) {
    sample.room(8);
    sample.push(8, {.id = i});
  }
  const HostTime begin = host_now();
  port->send(sample.frames());
  EXPECT_LT(port->counters().sent, 40U);
  while (!port->is_drained()) std::this_thread::sleep_for(1ms);
  EXPECT_EQ(port->counters().sent, 40U);
  EXPECT_GE(host_now() - begin, 30ms) << "40 frames at 1000 a second, less a burst of 5 ms";
}

TEST(CanMulticast, RefusesWhatIsNoBus) {
  for (const std::string bad : {"canmcast:10", "canmcast:x", "canmcast:/dev/ttyUSB0"})
    EXPECT_NE(error_of(bad, Role::device).find("from 0 to 9"), std::string::npos) << bad;
  EXPECT_NE(error_of("canmcast:0?interface=nosuch0", Role::device).find("no such network interface"),
            std::string::npos);
}

}  // namespace
}  // namespace imud
