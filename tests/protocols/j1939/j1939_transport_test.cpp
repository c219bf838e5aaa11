// Long messages of the J1939 unit: SAE J1939-21, 5.10.
#include "protocols/j1939/transport.hpp"
#include "tests/protocols/j1939/j1939_unit.hpp"

namespace imud::j1939_test {
namespace {

using j1939::everyone;
using j1939::Transport;

std::string hex_of(std::string_view text) {
  std::string hex;
  for (const char c : text) {
    char digits[3];
    std::snprintf(digits, sizeof digits, "%02X", static_cast<unsigned char>(c));
    hex += digits;
  }
  return hex;
}

// The TP.DT frames of a text.
Texts packets_of(const std::string& id, std::string_view text) {
  Texts all;
  for (std::size_t begin = 0; begin < text.size(); begin += 7) {
    const std::string number = hex_of(std::string(1, static_cast<char>(begin / 7 + 1)));
    std::string packet = id + "#" + number + hex_of(text.substr(begin, 7));
    packet.resize(id.size() + 17, 'F');
    all.push_back(packet);
  }
  return all;
}

constexpr std::string_view ecu = "OpenIMU335RI*1**IMU*ACEINNA*";
constexpr std::string_view software = "\1OpenIMU335RI 1.0.5*";
constexpr std::string_view texts = "identification=j1939";

TEST(J1939TransportTest, BroadcastsWhatAllNodesAreAskedFor) {
  Claimed unit(texts);
  EXPECT_EQ(unit.give("18EAFF00#C5FD00"), Texts{"1CECFF80#201C0004FFC5FD00"});
  EXPECT_TRUE(unit.give("18EAFF00#DAFE00 18EAFF00#C5FD00").empty()) << "later, and once";
  for (const std::string& packet : packets_of("1CEBFF80", ecu)) {
    EXPECT_TRUE(unit.pass(49ms).empty());
    EXPECT_EQ(unit.pass(1ms).at(0), packet);
  }
  const Texts rest = unit.pass(1s);
  Texts wanted = packets_of("1CEBFF80", software);
  EXPECT_EQ(rest, wanted) << "its announcement came with the last packet before it";
  EXPECT_FALSE(unit.device->deadline());
}

TEST(J1939TransportTest, SendsToOneNodeByRequestToSend) {
  Claimed unit(texts);
  const Texts packets = packets_of("1CEB2180", ecu);
  EXPECT_EQ(unit.give("18EA8021#C5FD00"), Texts{"1CEC2180#101C0004FFC5FD00"});
  EXPECT_EQ(unit.give("1CEC8021#110201FFFFC5FD00"), (Texts{packets[0], packets[1]}));
  EXPECT_TRUE(unit.give("1CEC8021#110003FFFFC5FD00").empty()) << "holds";
  EXPECT_TRUE(unit.pass(1s).empty());
  EXPECT_EQ(unit.give("1CEC8021#110203FFFFC5FD00"), (Texts{packets[2], packets[3]}));
  EXPECT_EQ(unit.give("1CEC8021#110204FFFFC5FD00"), Texts{packets[3]}) << "again";
  EXPECT_TRUE(unit.give("1CEC8021#131C0004FFC5FD00").empty());
  EXPECT_FALSE(unit.device->deadline());
  EXPECT_EQ(unit.count("transfers_aborted") + unit.count("transfers_timed_out"), 0U);
}

TEST(J1939TransportTest, SendsToSeveralNodesAtOnce) {
  Claimed unit(texts);
  for (const char* node : {"21", "22", "23", "24", "25", "26"})
    EXPECT_EQ(count_of(unit.give("18EA80" + std::string(node) + "#C5FD00"), "1CEC" + std::string(node) + "80#10"),
              1U);
  // It cannot respond: too many, and a second one to the same node.
  EXPECT_EQ(unit.give("18EA8027#C5FD00"), Texts{"18E8FF80#03FFFFFF27C5FD00"});
  unit.give("1CEC8021#131C0004FFC5FD00");
  EXPECT_EQ(unit.give("18EA8022#DAFE00"), Texts{"18E8FF80#03FFFFFF22DAFE00"});
  EXPECT_EQ(count_of(unit.give("18EA8021#DAFE00"), "1CEC2180#10"), 1U);
  EXPECT_EQ(unit.count("requests_refused"), 2U);
}

TEST(J1939TransportTest, EndsTransfersThatAreNotAnswered) {
  Claimed unit(texts);
  unit.give("18EA8021#C5FD00");
  EXPECT_TRUE(unit.pass(1249ms).empty());
  EXPECT_EQ(unit.pass(1ms), Texts{"1CEC2180#FF03FFFFFFC5FD00"}) << "T3 after RTS";
  unit.give("18EA8021#C5FD00");
  unit.give("1CEC8021#110001FFFFC5FD00");
  EXPECT_TRUE(unit.pass(1049ms).empty());
  EXPECT_EQ(unit.pass(1ms), Texts{"1CEC2180#FF03FFFFFFC5FD00"}) << "T4 after a CTS that holds";
  unit.give("18EA8021#C5FD00");
  unit.give("1CEC8021#110401FFFFC5FD00");
  EXPECT_EQ(unit.pass(1250ms), Texts{"1CEC2180#FF03FFFFFFC5FD00"}) << "T3 after the last packet";
  EXPECT_EQ(unit.count("transfers_timed_out"), 3U);
  EXPECT_FALSE(unit.device->deadline());
}

TEST(J1939TransportTest, AbortsWhatCannotBe) {
  Claimed unit(texts);
  const auto begin = [&] { EXPECT_EQ(unit.give("18EA8021#C5FD00").size(), 1U); };
  begin();
  EXPECT_EQ(unit.give("1CEC8021#110105FFFFC5FD00"), Texts{"1CEC2180#FF07FFFFFFC5FD00"})
      << "a packet that there is not";
  begin();
  unit.give("1CEC8021#110401FFFFC5FD00 1CEC8021#110401FFFFC5FD00 1CEC8021#110401FFFFC5FD00");
  EXPECT_EQ(unit.give("1CEC8021#110401FFFFC5FD00"), Texts{"1CEC2180#FF05FFFFFFC5FD00"}) << "requested too often";
  begin();
  EXPECT_TRUE(unit.give("1CEC8021#FF01FFFFFFC5FD00").empty());
  EXPECT_EQ(unit.count("transfers_aborted"), 3U);
  EXPECT_FALSE(unit.device->deadline());
}

TEST(J1939TransportTest, ReceivesFromOneNode) {
  Claimed unit;
  EXPECT_EQ(unit.give("1CEC8021#10090002FFD8FE00"), Texts{"1CEC2180#110201FFFFD8FE00"});
  EXPECT_TRUE(unit.give("1CEB8021#010100E066008300").empty());
  EXPECT_EQ(unit.give("1CEB8021#028093FFFFFFFFFF"), (Texts{"1CEC2180#13090002FFD8FE00", "18EEFF93#" + own_name}));
}

// The last byte of RTS before the number: the packets that the sender can send for one CTS.
TEST(J1939TransportTest, RequestsNoMorePacketsThanTheSenderCanSend) {
  Claimed unit;
  EXPECT_EQ(unit.give("1CEC8021#1009000201D8FE00"), Texts{"1CEC2180#110101FFFFD8FE00"});
  EXPECT_EQ(unit.give("1CEB8021#010100E066008300"), Texts{"1CEC2180#110102FFFFD8FE00"});
  EXPECT_TRUE(unit.pass(1249ms).empty()) << "T2";
  EXPECT_EQ(unit.give("1CEB8021#028093FFFFFFFFFF"), (Texts{"1CEC2180#13090002FFD8FE00", "18EEFF93#" + own_name}));
  unit.pass(250ms);
  EXPECT_EQ(unit.give("1CEC9321#1009000200D8FE00"), Texts{"1CEC2193#FF02FFFFFFD8FE00"}) << "none at all";
}

TEST(J1939TransportTest, RefusesWhatItDoesNotReceive) {
  Claimed unit;
  EXPECT_EQ(unit.give("1CEC8021#10140003FFDAFE00"), Texts{"1CEC2180#FF02FFFFFFDAFE00"}) << "another message";
  EXPECT_EQ(unit.give("1CEC8021#10090003FFD8FE00"), Texts{"1CEC2180#FF02FFFFFFD8FE00"}) << "9 bytes are 2 packets";
  EXPECT_EQ(unit.give("1CEC8021#1000FFFFFFD8FE00"), Texts{"1CEC2180#FF02FFFFFFD8FE00"}) << "too long";
  EXPECT_TRUE(unit.give("1CEC8121#10090002FFD8FE00 1CECFF21#20140003FFDAFE00 1CEB8021#010100E066008300").empty())
      << "for another node, a broadcast, data of no transfer";
  EXPECT_EQ(unit.count("transfers_aborted"), 3U);
  unit.give("1CEC8021#10090002FFD8FE00");
  EXPECT_EQ(unit.give("1CEB8021#028093FFFFFFFFFF"), Texts{"1CEC2180#FF07FFFFFFD8FE00"}) << "the second packet first";
}

TEST(J1939TransportTest, EndsReceptionsThatStall) {
  Claimed unit;
  unit.give("1CEC8021#10090002FFD8FE00");
  EXPECT_TRUE(unit.pass(1249ms).empty());
  EXPECT_EQ(unit.pass(1ms), Texts{"1CEC2180#FF03FFFFFFD8FE00"}) << "T2";
  unit.give("1CEC8021#10090002FFD8FE00 1CEB8021#010100E066008300");
  EXPECT_EQ(unit.pass(750ms), Texts{"1CEC2180#FF03FFFFFFD8FE00"}) << "T1";
  unit.give("1CECFF21#20090002FFD8FE00 1CEBFF21#010100E066008300");
  EXPECT_TRUE(unit.pass(750ms).empty()) << "a broadcast ends without a word";
  EXPECT_TRUE(unit.give("1CEBFF21#028093FFFFFFFFFF").empty());
  EXPECT_EQ(unit.count("transfers_timed_out"), 3U);
}

TEST(J1939TransportTest, EndsAllTransfersWithItsAddress) {
  Claimed unit(texts);
  unit.give("18EA8021#C5FD00 18EAFF00#C5FD00");
  ASSERT_TRUE(unit.device->deadline());
  unit.give("18EEFF80#0000E06600830080");
  EXPECT_FALSE(unit.device->deadline());
}

TEST(J1939TransportTest, BroadcastsThatWaitFollowOneAnother) {
  std::uint64_t aborted = 0, timed_out = 0;
  Transport transport(0, aborted, timed_out);
  const auto frames = std::make_unique<FrameBuffer>();
  const std::vector<std::byte> data(14);
  DeviceTime now;
  const auto sent = [&] {
    std::string text;
    for (const Frame& frame : frames->frames()) text += can_text(frame).substr(9, 2) + ' ';
    frames->clear();
    return text;
  };
  for (const std::uint32_t pgn : {0xFE01U, 0xFE02U, 0xFE03U, 0xFE04U})
    EXPECT_TRUE(transport.send(pgn, everyone, data, 0x80, now, *frames));
  EXPECT_EQ(sent(), "20 ");
  std::string all;
  for (int k = 0; k < 20; ++k) {
    now = now + 50ms;
    transport.poll(0x80, now, *frames);
    all += sent();
  }
  EXPECT_EQ(all, "01 02 20 01 02 20 01 02 20 01 02 ") << "no announcement before the broadcast before it has ended";
  EXPECT_FALSE(transport.deadline());
}

}  // namespace
}  // namespace imud::j1939_test
