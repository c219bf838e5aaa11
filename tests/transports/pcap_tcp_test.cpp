// TCP connections in captures.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/transports/capture_builder.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

using namespace capture;

class PcapTcp : public ::testing::Test {
 protected:
  static constexpr unsigned simulator = 10001, imud_end = 40000;
  static constexpr unsigned type_ipv4 = 0x0800, type_ipv6 = 0x86DD;

  static Bytes frame(const Bytes& segment) { return ethernet(type_ipv4, ipv4(segment, {{}, 6})); }
  // Return the packet of a segment that the simulator sends, and of one that is sent to it.
  static Bytes out(std::uint32_t sequence, const Bytes& payload, unsigned flags = ack) {
    return frame(tcp(payload, simulator, imud_end, sequence, flags));
  }
  static Bytes in(std::uint32_t sequence, const Bytes& payload, unsigned flags = ack) {
    return frame(tcp(payload, imud_end, simulator, sequence, flags));
  }
  std::unique_ptr<Port> captured(const std::vector<Record>& records, const std::string& options,
                                 const PortSettings& settings = Role::listener, unsigned link_type = 1) {
    Bytes content = file_header({}, link_type);
    for (const Record& record : records) content += file_record({}, record);
    write_file(path, content);
    return open_port("pcap:" + path + options, settings);
  }
  std::unique_ptr<Port> captured(const std::vector<Bytes>& packets, const std::string& options,
                                 const PortSettings& settings = Role::listener, unsigned link_type = 1) {
    std::vector<Record> records;
    for (const Bytes& packet : packets) records.push_back({static_cast<std::int64_t>(records.size()), packet});
    return captured(records, options, settings, link_type);
  }
  // Returns the bytes; a | stands before each stream but the first.
  static std::string text(Port& port) {
    std::string all;
    std::uint64_t streams = 0, pieces = 0;
    while (!port.at_end())
      if (const auto received = port.receive()) {
        EXPECT_TRUE(received->is_piece);
        ++pieces;
        if (std::exchange(streams, port.counters().lost_count) != port.counters().lost_count) all += '|';
        all.append(reinterpret_cast<const char*>(received->frame.bytes.data()), received->frame.bytes.size());
      }
    EXPECT_EQ(port.counters().received, pieces);
    return all;
  }

  const std::vector<Bytes> session = {in(99, "", syn),         out(499, "", syn | ack), in(100, ""),
                                      out(500, "TIME 1\n"),    in(100, "Ack"),          out(507, "TIM"),
                                      out(507, "TIM"),         out(513, "2\n"),         out(510, "E  "),
                                      out(515, "", fin | ack), in(103, "", fin | ack)};
  ScratchFolder folder;
  const std::string path = folder / "capture";
};

TEST_F(PcapTcp, TheSideThatSendsFirstIsReadByAPortAtEitherEnd) {
  for (const unsigned port : {simulator, imud_end}) {
    const auto capture = captured(session, fmt::format("?port={}", port));
    EXPECT_EQ(text(*capture), "TIME 1\nTIME  2\n");
    EXPECT_EQ(capture->counters().truncated, 0U);
    EXPECT_EQ(capture->counters().lost_count, 0U);
    EXPECT_EQ(capture->end_warning(), "");
    EXPECT_EQ(capture->other_content(), "");
  }
}

TEST_F(PcapTcp, EveryLinkTypeAndOptions) {
  const Bytes segment = tcp("payload", simulator, imud_end, 7, ack, Bytes(12, '\1'));
  const Bytes v4 = ipv4(segment, {Bytes(8, '\1'), 6}), v6 = ipv6(extension(6, 1) + segment, 60);
  const auto expect_read = [&](unsigned link_type, const Bytes& packet) {
    SCOPED_TRACE(link_type);
    // Ethernet pads short frames.
    EXPECT_EQ(text(*captured(std::vector{packet + Bytes(20, '\0')}, "?port=10001", Role::listener, link_type)),
              "payload");
    // However much the snap length removes, no incomplete segment is delivered.
    std::vector<Record> cut;
    for (std::size_t i = 1; i <= packet.size(); ++i) cut.push_back({0, packet, i});
    const auto short_port = captured(cut, "?port=10001", Role::listener, link_type);
    EXPECT_EQ(text(*short_port), "");
    EXPECT_GE(short_port->counters().truncated, 20 + 12 + 7 - 4U);
  };
  expect_read(1, ethernet(type_ipv4, v4));
  expect_read(1, ethernet(type_ipv6, v6, {0x8100}));
  expect_read(113, cooked1(type_ipv4, v4));
  expect_read(276, cooked2(type_ipv6, v6));
  expect_read(101, v4);
  expect_read(0, Order(false).u32(2) + v4);
}

TEST_F(PcapTcp, TheSenderSelectsTheDirection) {
  PortSettings settings = Role::listener;
  settings.from = Endpoint::parse("127.0.0.1:40000");
  const auto capture = captured(session, "?port=10001", settings);
  EXPECT_EQ(text(*capture), "Ack");
  EXPECT_EQ(capture->counters().foreign, 0U);
}

TEST_F(PcapTcp, AHoleIsCountedAndEndsTheStream) {
  const auto capture =
      captured({out(500, "TIME 1\nTI"), out(600, "E 2\nTIME 3\n"), out(611, "", fin)}, "?port=10001");
  EXPECT_EQ(text(*capture), "TIME 1\nTI|E 2\nTIME 3\n");
  EXPECT_EQ(capture->counters().truncated, 1U);
}

TEST_F(PcapTcp, ASegmentThatIsCutShortIsAHole) {
  const Bytes whole = out(503, "def");
  const auto capture =
      captured(std::vector<Record>{{0, out(500, "abc")}, {1, whole, 2}, {2, out(506, "ghi")}}, "?port=10001");
  EXPECT_EQ(text(*capture), "abc|ghi");
  EXPECT_EQ(capture->counters().truncated, 2U) << "the segment, and the hole";
}

TEST_F(PcapTcp, ConnectionsFollowOneAnother) {
  std::vector<Bytes> twice = session;
  twice.insert(twice.end(), {in(9, "", syn), out(7, "", syn | ack), out(8, "TIME 0\n"), out(15, "", rst)});
  const auto capture = captured(twice, "?port=10001");
  EXPECT_EQ(text(*capture), "TIME 1\nTIME  2\n|TIME 0\n");
  EXPECT_EQ(capture->counters().truncated, 0U);
}

TEST_F(PcapTcp, AKeptSegmentHasTheTimeOfTheOneThatItWaitedFor) {
  const auto capture = captured(
      std::vector<Record>{{1, out(499, "", syn)}, {2, out(503, "def")}, {3, out(500, "abc")}}, "?port=10001");
  for (int i = 0; i < 2; ++i) {
    const auto received = capture->receive();
    ASSERT_TRUE(received);
    EXPECT_EQ(received->time.ns, 3);
    EXPECT_EQ(EndpointText(received->from).whole(), "127.0.0.1:10001");
  }
}

TEST_F(PcapTcp, TheContentIsNamedIfThePortIsAnother) {
  const auto content = [&](const std::string& options) {
    const auto capture = captured(session, options);
    EXPECT_EQ(text(*capture), "");
    EXPECT_EQ(capture->counters().not_ours, session.size());
    return std::string(capture->other_content());
  };
  EXPECT_EQ(content("?port=9810"), "5 TCP segments to port 40000, 1 TCP segment to port 10001 and none to 9810");
  EXPECT_EQ(
      content(""),
      "5 TCP segments to port 40000, 1 TCP segment to port 10001; give the port of a TCP connection, at either end");
}

TEST_F(PcapTcp, DatagramsStayDatagrams) {
  std::vector<Bytes> both = session;
  both.insert(both.begin() + 5, ethernet(type_ipv4, ipv4(udp("datagram", simulator))));
  const auto capture = captured(both, "?port=10001");
  std::string datagrams, pieces;
  while (!capture->at_end())
    if (const auto received = capture->receive())
      (received->is_piece ? pieces : datagrams)
          .append(reinterpret_cast<const char*>(received->frame.bytes.data()), received->frame.bytes.size());
  EXPECT_EQ(datagrams, "datagram");
  EXPECT_EQ(pieces, "TIME 1\nTIME  2\n");
}

TEST_F(PcapTcp, AnyBytesAreHarmless) {
  std::uint32_t random = 1;
  const auto next = [&random] { return random = random * 1664525U + 1013904223U, random >> 8; };
  std::vector<Bytes> packets;
  for (std::uint32_t i = 0; i < 30'000; ++i) {
    const std::uint32_t first = i / 8 * 1000;  // of the connection
    const std::uint32_t flags = i % 8 == 0 ? syn : i % 8 == 7 ? fin : ack;
    Bytes packet = next() % 8 == 0 ? in(first, "Ack") : out(first + i % 8 * 4, flags == syn ? "" : "text", flags);
    packet.resize(packet.size() - next() % 4 / 3 * (next() % (packet.size() / 4)));
    for (std::uint32_t changes = next() % 4; changes > 0 && !packet.empty(); --changes)
      packet[next() % packet.size()] = static_cast<char>(next());
    packets.push_back(packet);
  }
  const auto capture = captured(packets, "?port=10001");
  while (!capture->at_end()) capture->receive();
  EXPECT_GT(capture->counters().received, 100U);
  EXPECT_LE(capture->counters().received, packets.size());
}

}  // namespace
}  // namespace imud
