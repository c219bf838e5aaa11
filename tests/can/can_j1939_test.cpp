// The J1939 unit and the kernel's J1939 stack: j1939acd of can-utils contends for the unit's address, and a socket
// exchanges long messages with it. Runs in tools/with-vcan.
#include <gtest/gtest.h>
#include <linux/can/j1939.h>

#include <string>
#include <vector>

#include "tests/can/can_unit.hpp"

namespace imud {
namespace {

constexpr std::uint64_t unit_name = 0x8000'8300'66E0'0001;  // that of the initial settings
constexpr std::uint64_t lower_name = 0x1122'3344'5566'7788, higher_name = 0xFF22'3344'5566'7788;

// The bus since the test began.
class Bus {
 public:
  Bus() { node_.last_time(); }
  struct Claim {
    unsigned source;
    std::uint64_t name;
    bool operator==(const Claim&) const = default;
  };
  // Receives frames until there is a claim of that NAME from that address, or a data frame (ARI) from it if the name
  // is 0. Returns false if there is none until the limit.
  bool wait_for(unsigned source, std::uint64_t name, std::chrono::seconds limit = std::chrono::minutes(1)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (std::chrono::steady_clock::now() < end) {
      const auto received = node_.receive();
      if (!received) continue;
      const canid_t id = received->frame.can_id & CAN_EFF_MASK;
      std::uint64_t content = 0;
      for (int i = 7; i >= 0; --i) content = content << 8 | received->frame.data[i];
      if ((id & 0x3FFFF00) == 0x0EEFF00) claims.push_back({id & 0xFFU, content});
      if ((id & 0x3FFFF00) == 0x0F02A00) {
        const auto time = node_.last_time();
        if (!data_sources.empty()) longest_silence = std::max(longest_silence, time - last_data_);
        last_data_ = time;
        data_sources.push_back(id & 0xFFU);
      }
      if (name == 0 ? !data_sources.empty() && data_sources.back() == source
                    : !claims.empty() && claims.back() == Claim{source, name})
        return true;
    }
    return false;
  }

  std::vector<Claim> claims;
  std::vector<unsigned> data_sources;           // of each data frame
  std::chrono::microseconds longest_silence{};  // between two data frames

 private:
  Node node_{"vcan0"};
  std::chrono::microseconds last_data_{};
};

void PrintTo(const Bus::Claim& claim, std::ostream* out) {
  *out << fmt::format("{:02X}: {:016X}", claim.source, claim.name);
}

// A node whose messages the kernel takes apart and puts together.
class KernelNode {
 public:
  explicit KernelNode(std::uint8_t address) : socket_(::socket(PF_CAN, SOCK_DGRAM | SOCK_CLOEXEC, CAN_J1939)) {
    const sockaddr_can own = node(address, J1939_NO_PGN);
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own), 0) << std::strerror(errno);
    const int on = 1;
    EXPECT_EQ(::setsockopt(socket_.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on), 0);
  }
  // Sends a message to a node, or to everyone (0xFF).
  void send(std::uint8_t to, std::uint32_t number, std::string_view data) const {
    // A transfer that was aborted leaves its error on the socket, which the next call would report as its own.
    int aborted = 0;
    socklen_t size = sizeof aborted;
    EXPECT_EQ(::getsockopt(socket_.get(), SOL_SOCKET, SO_ERROR, &aborted, &size), 0);
    const sockaddr_can other = node(to, number);
    EXPECT_EQ(
        ::sendto(socket_.get(), data.data(), data.size(), 0, reinterpret_cast<const sockaddr*>(&other), sizeof other),
        static_cast<ssize_t>(data.size()))
        << std::strerror(errno);
  }
  // Returns the next message with that number; empty if there is none until the limit.
  std::string receive(std::uint32_t number, std::chrono::seconds limit) const {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (std::chrono::steady_clock::now() < end) {
      pollfd ready{socket_.get(), POLLIN, 0};
      if (::poll(&ready, 1, 200) != 1) continue;
      char data[2000];
      sockaddr_can from{};
      socklen_t size = sizeof from;
      const ssize_t got = ::recvfrom(socket_.get(), data, sizeof data, 0, reinterpret_cast<sockaddr*>(&from), &size);
      if (got > 0 && from.can_addr.j1939.pgn == number) return {data, static_cast<std::size_t>(got)};
    }
    return {};
  }

 private:
  static sockaddr_can node(std::uint8_t address, std::uint32_t number) {
    sockaddr_can node{};
    node.can_family = AF_CAN;
    node.can_ifindex = static_cast<int>(::if_nametoindex("vcan0"));
    node.can_addr.j1939 = {.name = J1939_NO_NAME, .pgn = number, .addr = address};
    return node;
  }
  FileDescriptor socket_;
};

class CanJ1939Test : public CanUnitTest {
 protected:
  // It prefers the address 0x80, and may use the two after it.
  void start_other(std::uint64_t name) {
    other_.start({"-r", "128-130", "-a", "128", fmt::format("{:016x}", name), "vcan0"});
  }
  std::uint64_t count(const std::string& key) { return end()[0][key]; }

  Bus bus_;
  Program other_{"/usr/bin/j1939acd"};
};

using Claims = std::vector<Bus::Claim>;

TEST_F(CanJ1939Test, TheUnitTakesTheAddressOfANodeWithAHigherName) {
  start_other(higher_name);
  ASSERT_TRUE(bus_.wait_for(0x80, higher_name)) << other_.errors();
  start_unit("j1939");
  ASSERT_TRUE(bus_.wait_for(0x81, higher_name)) << "the other node moves";
  ASSERT_TRUE(bus_.wait_for(0x80, 0)) << "the unit sends";
  EXPECT_EQ(bus_.claims, (Claims{{0x80, higher_name}, {0x80, unit_name}, {0x81, higher_name}}));
  EXPECT_EQ(count("address_changes"), 0U);
  EXPECT_EQ(count("address_conflicts"), 0U);
}

TEST_F(CanJ1939Test, TheUnitMovesIfTheNodeThatHasTheAddressHasALowerName) {
  start_other(lower_name);
  ASSERT_TRUE(bus_.wait_for(0x80, lower_name)) << other_.errors();
  start_unit("j1939");
  ASSERT_TRUE(bus_.wait_for(0x81, unit_name)) << "the unit moves";
  ASSERT_TRUE(bus_.wait_for(0x81, 0)) << "the unit sends";
  EXPECT_EQ(bus_.claims, (Claims{{0x80, lower_name}, {0x80, unit_name}, {0x80, lower_name}, {0x81, unit_name}}));
  EXPECT_EQ(bus_.data_sources, std::vector{0x81U}) << "nothing from the address that it lost";
  EXPECT_EQ(count("address_changes"), 1U);
  EXPECT_GE(count("address_conflicts"), 1U);
  EXPECT_NE(imud_.errors().find("has taken the unit's address"), std::string::npos) << imud_.errors();
}

TEST_F(CanJ1939Test, ARunningUnitMovesForANodeWithALowerName) {
  start_unit("j1939");
  ASSERT_TRUE(bus_.wait_for(0x80, 0));
  start_other(lower_name);
  ASSERT_TRUE(bus_.wait_for(0x80, lower_name)) << other_.errors();
  bus_.data_sources.clear();
  ASSERT_TRUE(bus_.wait_for(0x81, unit_name));
  ASSERT_TRUE(bus_.wait_for(0x81, 0));
  EXPECT_EQ(count("address_changes"), 1U);
}

TEST_F(CanJ1939Test, ANodeWithAHigherNameFindsTheAddressOfARunningUnitInUse) {
  start_unit("j1939");
  ASSERT_TRUE(bus_.wait_for(0x80, 0));
  start_other(higher_name);
  ASSERT_TRUE(bus_.wait_for(0x81, higher_name)) << other_.errors();
  // The unit has answered its request for claims.
  EXPECT_EQ(bus_.claims, (Claims{{0x80, unit_name}, {0x80, unit_name}, {0x81, higher_name}}));
  EXPECT_EQ(count("address_changes"), 0U);
}

TEST_F(CanJ1939Test, TheKernelAndTheUnitExchangeLongMessages) {
  using namespace std::string_view_literals;
  start_unit("j1939", "device.identification = \"j1939\"\ndevice.packet_types = [\"ari\"]");
  ASSERT_TRUE(bus_.wait_for(0x80, 0));
  const KernelNode host(0x21);
  constexpr std::uint32_t request = 0xEA00, ecu = 0xFDC5, software = 0xFEDA, commanded_address = 0xFED8;
  // Where the guest stands still for 750 ms, as on a loaded machine, a transfer ends unfinished (SAE J1939-21, T1).
  // The host then sends its message again.
  unsigned repeated = 0;
  const auto until = [&](auto send, auto has_effect) {
    for (unsigned attempts = 1; attempts <= 6; ++attempts) {
      send();
      if (has_effect(std::chrono::seconds(10))) return true;
      ++repeated;
    }
    return false;
  };
  const auto has_identification = [&](auto limit) {
    return host.receive(ecu, limit) == "OpenIMU335RI*1**IMU*ACEINNA*";
  };
  EXPECT_TRUE(until([&] { host.send(0x80, request, "\xC5\xFD\0"sv); }, has_identification)) << "by RTS and CTS";
  EXPECT_TRUE(until(
      [&] {
        host.send(0xFF, request, "\xC5\xFD\0"sv);
        host.send(0xFF, request, "\xDA\xFE\0"sv);
      },
      [&](auto limit) {
        return has_identification(limit) && host.receive(software, limit) == "\1OpenIMU335RI 1.0.5*";
      }))
      << "broadcasts, one after the other";
  // Its NAME and an address, to it alone, and to everyone.
  const auto moves = [&](std::uint8_t to, std::string_view command, unsigned address) {
    return until([&] { host.send(to, commanded_address, command); },
                 [&](auto limit) { return bus_.wait_for(address, unit_name, limit); }) &&
           bus_.wait_for(address, 0);
  };
  EXPECT_TRUE(moves(0x80, "\x01\0\xE0\x66\0\x83\0\x80\x92"sv, 0x92));
  EXPECT_TRUE(moves(0xFF, "\x01\0\xE0\x66\0\x83\0\x80\x93"sv, 0x93));
  const auto counters = end()[0];
  // While the guest stands still the unit sends no data, either. Two packets of a broadcast are 50 ms apart anyway.
  if (repeated > 0 && bus_.longest_silence > std::chrono::milliseconds(600)) return;
  EXPECT_EQ(repeated, 0U);
  EXPECT_EQ(counters["transfers_aborted"], 0U);
  EXPECT_EQ(counters["transfers_timed_out"], 0U);
}

}  // namespace
}  // namespace imud
