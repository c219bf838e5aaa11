// All CAN products on one bus, from one imud. Runs in tools/with-vcan.
#include <algorithm>
#include <map>
#include <set>

#include "protocols/protocol.hpp"
#include "tests/can/can_unit.hpp"

namespace imud {
namespace {

constexpr canid_t ext = CAN_EFF_FLAG;
struct Member {
  const char* protocol;
  const char* keys;
  std::set<canid_t> identifiers;
};
// Only units whose identifiers would collide are moved. CANopen needs a master, and NOS3's unit a computer.
const std::vector<Member> members = {
    {"native-can",
     "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\ndevice.can_id = 0x300",
     {0x300, 0x301, 0x302, 0x303, 0x304, 0x305, 0x306}},
    {"dronecan",
     "device.start_up_ms = 0\ndevice.static_temperature_hz = 10",
     {ext | 0x1003EB2A, ext | 0x1004052A, ext | 0x1801552A}},  // RawIMU, StaticTemperature, NodeStatus of node 42
    {"j1939", "", {ext | 0x18EEFF80, ext | 0x0CF02980, ext | 0x0CF02A80, ext | 0x08F02D80}},
    {"canopen", "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100", {0x70A, 0x18A, 0x28A}},
    {"sbg-can", "", {0x120, 0x121, 0x122}},
    {"xsens-can", "", {0x05, 0x06, 0x07, 0x11, 0x21, 0x32, 0x34, 0x51}},
    {"bosch-mm7", "", {0x174, 0x178, 0x17C}},
    {"bosch-mm5", "device.id_offset = 0x100", {0x274, 0x278, 0x27C}},
    {"nos3-imu", "device.reply_id = 0x010", {0x010}},
    {"dbc", "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100", {0x200, 0x201}},
};

using CanProductsTest = CanUnitTest;

TEST_F(CanProductsTest, ShareABus) {
  for (const Protocol* protocol : protocols())
    EXPECT_TRUE(protocol->link != Link::can ||
                std::ranges::any_of(members, [&](const Member& one) { return one.protocol == protocol->name; }))
        << "give " << protocol->name << " a row of `members`";
  std::string units;
  for (const Member& member : members) units += unit(member.protocol, member.keys);
  const std::string config = write_config("lockstep", units);
  const ProgramResult check = run_program("imud", {"check", "--json", config});
  ASSERT_EQ(check.exit_code, 0) << check.errors;
  const auto checked = nlohmann::json::parse(check.output);
  EXPECT_EQ(checked["warnings"].size(), 0U) << check.errors;
  EXPECT_EQ(checked["buses"][0]["imus"].size(), members.size());

  const Node node("vcan0");
  start(imud_, config);
  std::map<canid_t, std::uint64_t> received;
  constexpr std::uint64_t steps = 25;  // 0.5 s: each frame costs the guest much on a loaded machine
  for (std::uint64_t i = 0; i < steps; ++i) {
    ASSERT_TRUE(pass_20_ms()) << imud_.errors();
    node.send(0x00F, {0x80, static_cast<std::uint8_t>(2 + i % 3)});  // the axes in turn
    if (received[0x70A] == 1 && received[0x18A] == 0) node.send(0x000, {1, 10});
    while (const auto got = node.receive(0)) ++received[got->frame.can_id];
  }
  // A request may be answered after the truth that follows it; and so it is before the end.
  ASSERT_TRUE(pass_20_ms()) << imud_.errors();
  while (received[0x010] < steps) {
    const auto got = node.receive(60'000);
    ASSERT_TRUE(got.has_value()) << received[0x010] << " replies";
    ++received[got->frame.can_id];
  }
  const auto imus = end();
  for (const Node::Received& got : node.receive_all()) ++received[got.frame.can_id];

  ASSERT_EQ(imus.size(), members.size());
  for (std::size_t i = 0; i < members.size(); ++i) {
    std::uint64_t sum = 0;
    for (const canid_t id : members[i].identifiers) {
      EXPECT_GT(received[id], 0U) << fmt::format("{} {:X}", members[i].protocol, id);
      sum += received[id];
      received.erase(id);
    }
    const bool is_asked = members[i].protocol == std::string("nos3-imu");
    EXPECT_EQ(imus[i]["frames"], is_asked ? 0 : sum) << members[i].protocol;
    EXPECT_EQ(imus[i]["replies"], is_asked ? steps : 0) << members[i].protocol;
    EXPECT_EQ(imus[i]["dropped"], 0) << members[i].protocol;
    EXPECT_GE(sum, steps) << members[i].protocol;
  }
  EXPECT_TRUE(received.empty()) << fmt::format("nobody has {:X}", received.begin()->first);
}

}  // namespace
}  // namespace imud
