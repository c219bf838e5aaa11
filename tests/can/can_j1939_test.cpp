// The J1939 unit and j1939acd of can-utils, which uses the kernel's J1939 stack, contend for an address. Runs in
// tools/with-vcan.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/can/can_node.hpp"
#include "tests/emulator/live_test.hpp"

namespace imud {
namespace {

constexpr std::uint64_t unit_name = 0x8000'8300'66E0'0001;  // that of the initial settings
constexpr std::uint64_t lower_name = 0x1122'3344'5566'7788, higher_name = 0xFF22'3344'5566'7788;

// The bus since the test began.
class Bus {
 public:
  struct Claim {
    unsigned source;
    std::uint64_t name;
    bool operator==(const Claim&) const = default;
  };
  // Receives frames until there is a claim of that NAME from that address, or a data frame (ARI) from it if the name
  // is 0. Returns false if there is none for a minute.
  bool wait_for(unsigned source, std::uint64_t name) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (std::chrono::steady_clock::now() < end) {
      const auto received = node_.receive();
      if (!received) continue;
      const canid_t id = received->frame.can_id & CAN_EFF_MASK;
      std::uint64_t content = 0;
      for (int i = 7; i >= 0; --i) content = content << 8 | received->frame.data[i];
      if ((id & 0x3FFFF00) == 0x0EEFF00) claims.push_back({id & 0xFFU, content});
      if ((id & 0x3FFFF00) == 0x0F02A00) data_sources.push_back(id & 0xFFU);
      if (name == 0 ? !data_sources.empty() && data_sources.back() == source
                    : !claims.empty() && claims.back() == Claim{source, name})
        return true;
    }
    return false;
  }

  std::vector<Claim> claims;
  std::vector<unsigned> data_sources;  // of each data frame

 private:
  Node node_{"vcan0"};
};

void PrintTo(const Bus::Claim& claim, std::ostream* out) {
  *out << fmt::format("{:02X}: {:016X}", claim.source, claim.name);
}

class CanJ1939Test : public LiveTest {
 protected:
  void start_unit() {
    start(imud_, write("config.toml", fmt::format(R"(seed = 1
clock = "realtime"
[truth]
port = "{}"
format = "native"
[[imu]]
protocol = "j1939"
port = "can:vcan0"
before_first = "rest"
)",
                                                  simulator_.port())));
  }
  // It prefers the address 0x80, and may use the two after it.
  void start_other(std::uint64_t name) {
    other_.start({"-r", "128-130", "-a", "128", fmt::format("{:016x}", name), "vcan0"});
  }
  // Returns the count of the unit's summary.
  std::uint64_t count(const std::string& key) {
    if (imud_.is_running()) {
      EXPECT_EQ(imud_.stop(), 0) << imud_.errors();
    }
    return summary()["imus"][0][key];
  }

  Bus bus_;
  Program imud_{"imud"}, other_{"/usr/bin/j1939acd"};
};

using Claims = std::vector<Bus::Claim>;

TEST_F(CanJ1939Test, TheUnitTakesTheAddressOfANodeWithAHigherName) {
  start_other(higher_name);
  ASSERT_TRUE(bus_.wait_for(0x80, higher_name)) << other_.errors();
  start_unit();
  ASSERT_TRUE(bus_.wait_for(0x81, higher_name)) << "the other node moves";
  ASSERT_TRUE(bus_.wait_for(0x80, 0)) << "the unit sends";
  EXPECT_EQ(bus_.claims, (Claims{{0x80, higher_name}, {0x80, unit_name}, {0x81, higher_name}}));
  EXPECT_EQ(count("address_changes"), 0U);
  EXPECT_EQ(count("address_conflicts"), 0U);
}

TEST_F(CanJ1939Test, TheUnitMovesIfTheNodeThatHasTheAddressHasALowerName) {
  start_other(lower_name);
  ASSERT_TRUE(bus_.wait_for(0x80, lower_name)) << other_.errors();
  start_unit();
  ASSERT_TRUE(bus_.wait_for(0x81, unit_name)) << "the unit moves";
  ASSERT_TRUE(bus_.wait_for(0x81, 0)) << "the unit sends";
  EXPECT_EQ(bus_.claims, (Claims{{0x80, lower_name}, {0x80, unit_name}, {0x80, lower_name}, {0x81, unit_name}}));
  EXPECT_EQ(bus_.data_sources, std::vector{0x81U}) << "nothing from the address that it lost";
  EXPECT_EQ(count("address_changes"), 1U);
  EXPECT_GE(count("address_conflicts"), 1U);
  EXPECT_NE(imud_.errors().find("has taken the unit's address"), std::string::npos) << imud_.errors();
}

TEST_F(CanJ1939Test, ARunningUnitMovesForANodeWithALowerName) {
  start_unit();
  ASSERT_TRUE(bus_.wait_for(0x80, 0));
  start_other(lower_name);
  ASSERT_TRUE(bus_.wait_for(0x80, lower_name)) << other_.errors();
  bus_.data_sources.clear();
  ASSERT_TRUE(bus_.wait_for(0x81, unit_name));
  ASSERT_TRUE(bus_.wait_for(0x81, 0));
  EXPECT_EQ(count("address_changes"), 1U);
}

TEST_F(CanJ1939Test, ANodeWithAHigherNameFindsTheAddressOfARunningUnitInUse) {
  start_unit();
  ASSERT_TRUE(bus_.wait_for(0x80, 0));
  start_other(higher_name);
  ASSERT_TRUE(bus_.wait_for(0x81, higher_name)) << other_.errors();
  // The unit has answered its request for claims.
  EXPECT_EQ(bus_.claims, (Claims{{0x80, unit_name}, {0x80, unit_name}, {0x81, higher_name}}));
  EXPECT_EQ(count("address_changes"), 0U);
}

}  // namespace
}  // namespace imud
