// The CANopen unit on a bus; the test is its master. Runs in tools/with-vcan.
#include <set>

#include "tests/can/can_unit.hpp"

namespace imud {
namespace {

constexpr std::uint8_t unit_id = 10;

class CanCanopenTest : public CanUnitTest {
 protected:
  // An SDO request; returns the response, which is the next frame but for heartbeats and EMCYs.
  std::string sdo(std::initializer_list<std::uint8_t> request) {
    node_.send(0x600 + unit_id, request);
    auto got = node_.receive(60'000);
    while (got && (got->frame.can_id == 0x70A || got->frame.can_id == 0x08A)) got = node_.receive(60'000);
    if (!got) return "no response";
    EXPECT_EQ(got->frame.can_id, 0x580U + unit_id);
    return hex(got->frame);
  }
  // Returns the data of the next frame with that identifier.
  std::string next(canid_t id) {
    const auto frame = node_.receive_id(id);
    return frame ? hex(*frame) : "no frame";
  }
  static std::string hex(const canfd_frame& frame) {
    std::string text;
    for (std::size_t i = 0; i < frame.len; ++i) text += fmt::format("{:02X}", frame.data[i]);
    return text;
  }

  const Node node_{"vcan0"};
};

TEST_F(CanCanopenTest, WorksWithAMaster) {
  start_unit("canopen",
             "rate_hz = 1000\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n"
             "device.heartbeat_ms = 100\ndevice.tpdo1_type = 1\ndevice.tpdo2_enabled = false\n"
             "device.vendor_id = 0x77\ndevice.serial_number = 0x12345678");
  EXPECT_EQ(next(0x70A), "00") << "boot-up" << imud_.errors();
  EXPECT_EQ(next(0x70A), "7F") << "pre-operational";
  node_.send(0x080, {});
  EXPECT_EQ(sdo({0x40, 0x18, 0x10, 0, 0, 0, 0, 0}), "4F18100004000000");
  EXPECT_EQ(sdo({0x40, 0x18, 0x10, 1, 0, 0, 0, 0}), "4318100177000000") << "the SYNC before was not answered";
  EXPECT_EQ(sdo({0x40, 0x18, 0x10, 2, 0, 0, 0, 0}), "4318100201000000");
  EXPECT_EQ(sdo({0x40, 0x18, 0x10, 3, 0, 0, 0, 0}), "4318100300000100");
  EXPECT_EQ(sdo({0x40, 0x18, 0x10, 4, 0, 0, 0, 0}), "4318100478563412");
  EXPECT_EQ(sdo({0x40, 0x18, 0x10, 5, 0, 0, 0, 0}), "8018100511000906") << "there is no such subindex";

  node_.send(0x000, {1, unit_id});  // NMT: start
  for (std::string state; state != "05" && state != "no frame";) state = next(0x70A);
  // Each SYNC has one TPDO1, and nothing else has any: specific force 0, 0, -9.80665 m/s^2 in 2^-8, sample counter.
  std::set<std::string> counters;
  for (int i = 0; i < 50; ++i) {
    node_.send(0x080, {});
    const std::string data = next(0x18A);
    EXPECT_EQ(data.substr(0, 12), "0000000031F6");
    EXPECT_EQ(data.size(), 16U);
    counters.insert(data.substr(12));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(counters.size(), 50U) << "the newest sample";
  EXPECT_EQ(next(0x70A), "05") << "operational";
  for (int i = 0; i < 5;) {
    const auto frame = node_.receive();
    ASSERT_TRUE(frame.has_value());
    ASSERT_EQ(frame->frame.can_id, 0x70AU) << "no TPDO without SYNC";
    ++i;
  }

  // A heartbeat is lost: that of node 3, which is expected every 500 ms.
  EXPECT_EQ(sdo({0x23, 0x16, 0x10, 1, 0xF4, 0x01, 3, 0}), "6016100100000000");
  node_.send(0x703, {5});
  EXPECT_EQ(next(0x08A), "3081110303000000") << "8130, with the number of the node";
  EXPECT_EQ(next(0x70A), "7F") << "1029: a communication error makes it pre-operational";
  node_.send(0x703, {0x7F});
  EXPECT_EQ(next(0x08A), "0000000303000000") << "the node is back";
  EXPECT_EQ(sdo({0x23, 0x16, 0x10, 1, 0, 0, 0, 0}), "6016100100000000");

  // Node guarding, where there is no heartbeat.
  EXPECT_EQ(sdo({0x2B, 0x17, 0x10, 0, 0, 0, 0, 0}), "6017100000000000");
  canfd_frame guard{};
  guard.can_id = 0x70A | CAN_RTR_FLAG;
  for (const char* const state : {"7F", "FF", "7F"}) {
    node_.send(guard, false);
    EXPECT_EQ(next(0x70A), state);
  }
  node_.send(0x000, {0x81, unit_id});  // NMT: reset node
  EXPECT_EQ(next(0x70A), "00");
  const auto unit = end()[0];
  EXPECT_EQ(unit["dropped"], 0);
}

}  // namespace
}  // namespace imud
