#include <fmt/format.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "tests/transports/capture_builder.hpp"
#include "tests/transports/port_error.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

using namespace capture;

constexpr unsigned ours = 9810;
constexpr unsigned type_ipv4 = 0x0800, type_ipv6 = 0x86DD;

constexpr Format all_formats[] = {
    {false, false, false}, {false, false, true}, {false, true, false}, {false, true, true},
    {true, false, false},  {true, false, true},  {true, true, false},  {true, true, true},
};

class Pcap : public ::testing::Test {
 protected:
  // Opens a capture of these packets for port `ours`.
  std::unique_ptr<Port> captured(unsigned link_type, const std::vector<Bytes>& packets) {
    Bytes content = file_header({}, link_type);
    for (const Bytes& packet : packets) content += file_record({}, {0, packet});
    write_file(path, content);
    return open_port(spec(), Role::listener);
  }
  std::string spec() const { return fmt::format("pcap:{}?port={}", path, ours); }

  static std::vector<std::string> payloads(Port& port) {
    std::vector<std::string> found;
    while (!port.at_end())  // receive() may return nothing earlier, if many packets are for other ports
      if (const auto received = port.receive())
        found.emplace_back(reinterpret_cast<const char*>(received->frame.bytes.data()), received->frame.bytes.size());
    EXPECT_EQ(port.counters().received, found.size());
    return found;
  }

  // The packet is delivered as "payload", and also when other bytes follow it, as Ethernet pads short frames.
  void expect_delivered(unsigned link_type, const Bytes& packet) {
    const auto port = captured(link_type, {packet, packet + Bytes(20, '\0')});
    EXPECT_EQ(payloads(*port), (std::vector<std::string>{"payload", "payload"}));
    EXPECT_EQ(port->counters().truncated + port->counters().not_ours, 0U);
    EXPECT_EQ(port->end_warning(), "");

    // However much the snap length removes, no incomplete datagram is delivered.
    Bytes content = file_header({}, link_type);
    for (std::size_t cut = 1; cut <= packet.size(); ++cut) content += file_record({}, {0, packet, cut});
    write_file(path, content);
    const auto short_port = open_port(spec(), Role::listener);
    EXPECT_EQ(payloads(*short_port).size(), 0U);
    EXPECT_EQ(short_port->counters().truncated, packet.size());
  }
  void expect_truncated(const Bytes& packet) { expect_refused(packet, 1, 0); }
  void expect_not_ours(const Bytes& packet) { expect_refused(packet, 0, 1); }
  void expect_refused(const Bytes& packet, std::uint64_t truncated, std::uint64_t not_ours) {
    const auto port = captured(1, {packet});
    EXPECT_TRUE(payloads(*port).empty());
    EXPECT_EQ(port->counters().truncated, truncated);
    EXPECT_EQ(port->counters().not_ours, not_ours);
  }

  ScratchFolder folder;
  const std::string path = folder / "capture";
  const Bytes v4 = ipv4(udp("payload", ours));
  const Bytes v6 = ipv6(udp("payload", ours));
};

TEST_F(Pcap, EveryLinkType) {
  for (const auto& [type, packet] : {std::pair{type_ipv4, v4}, std::pair{type_ipv6, v6}}) {
    SCOPED_TRACE(type);
    expect_delivered(1, ethernet(type, packet));
    expect_delivered(1, ethernet(type, packet, {0x8100}));
    expect_delivered(1, ethernet(type, packet, {0x88A8, 0x8100}));
    expect_delivered(1, ethernet(type, packet, {0x9100, 0x8100}));
    expect_delivered(113, cooked1(type, packet));
    expect_delivered(276, cooked2(type, packet));
    expect_delivered(101, packet);
    const unsigned family = type == type_ipv4 ? 2 : 10;
    expect_delivered(0, Order(false).u32(family) + packet);
    expect_delivered(0, Order(true).u32(family) + packet);
    expect_delivered(108, be32(family) + packet);
  }
  expect_delivered(228, v4);
  expect_delivered(229, v6);
}

TEST_F(Pcap, EveryFormatAndItsStamps) {
  const std::vector<std::int64_t> stamps = {0, 1'000, 1'234'567'890'123'456'789, 2'147'483'647'999'999'999};
  for (const Format& format : all_formats) {
    SCOPED_TRACE(fmt::format("ng {} big-endian {} ns {}", format.ng, format.big_endian, format.nanoseconds));
    Bytes content = file_header(format, 1);
    for (const std::int64_t ns : stamps) content += file_record(format, {ns, ethernet(type_ipv4, v4)});
    write_file(path, content);
    const auto port = open_port(spec(), Role::listener);
    double progress = 0;
    for (const std::int64_t ns : stamps) {
      EXPECT_GE(port->progress().value_or(-1), std::exchange(progress, port->progress().value_or(0)));
      EXPECT_LT(progress, 1);
      const auto received = port->receive();
      ASSERT_TRUE(received.has_value());
      EXPECT_EQ(received->time.ns, format.nanoseconds ? ns : ns / 1000 * 1000);
    }
    EXPECT_FALSE(port->at_end());
    EXPECT_EQ(port->receive(), std::nullopt);
    EXPECT_TRUE(port->at_end());
    EXPECT_EQ(port->progress(), 1.0);
    EXPECT_EQ(port->end_warning(), "");
  }
}

TEST_F(Pcap, CutAtEveryByteOfTheLastRecord) {
  for (const Format& format : all_formats) {
    const Bytes record = file_record(format, {5, ethernet(type_ipv4, v4)});
    const Bytes before = file_header(format, 1) + record + record + record;
    for (std::size_t kept = 0; kept <= record.size(); ++kept) {
      SCOPED_TRACE(fmt::format("ng {} big-endian {} kept {}", format.ng, format.big_endian, kept));
      write_file(path, before + record.substr(0, kept));
      const auto port = open_port(spec(), Role::listener);
      EXPECT_EQ(payloads(*port).size(), kept == record.size() ? 4U : 3U);
      const bool whole = kept == 0 || kept == record.size();
      EXPECT_EQ(port->end_warning(), whole ? "" : "cut short after record 3");
    }
  }
}

TEST_F(Pcap, RecordThatCannotBeEndsTheCapture) {
  const Bytes record = file_record({}, {5, ethernet(type_ipv4, v4)});
  write_file(path, file_header({}, 1) + record + Bytes(16, '\xFF') + record);
  const auto port = open_port(spec(), Role::listener);
  EXPECT_EQ(payloads(*port).size(), 1U);
  EXPECT_TRUE(port->end_warning().starts_with("unreadable after record 1: ")) << port->end_warning();
}

TEST_F(Pcap, Ipv4Options) { expect_delivered(1, ethernet(type_ipv4, ipv4(udp("payload", ours), {Bytes(40, '\1')}))); }

TEST_F(Pcap, Ipv6ExtensionHeaders) {
  const Bytes datagram = udp("payload", ours);
  for (const unsigned header : {0U, 43U, 60U, 135U, 139U, 140U})
    expect_delivered(1, ethernet(type_ipv6, ipv6(extension(17, 2) + datagram, header)));
  const Bytes authentication = u8(17) + u8(4) + Bytes(22, '\0');
  expect_delivered(1, ethernet(type_ipv6, ipv6(authentication + datagram, 51)));
  expect_delivered(
      1,
      ethernet(type_ipv6,
               ipv6(extension(60, 0) + extension(44, 1) + fragment(17, 0, false) + datagram).replace(6, 1, u8(0))));
}

TEST_F(Pcap, FragmentsAreCountedNotDelivered) {
  const Bytes datagram = udp("payload", ours), foreign = udp("payload", ours + 1);
  constexpr unsigned more = 0x2000;
  expect_truncated(ethernet(type_ipv4, ipv4(datagram, {{}, 17, more})));
  expect_truncated(ethernet(type_ipv4, ipv4("the rest", {{}, 17, 185})));
  expect_truncated(ethernet(type_ipv4, ipv4("the rest", {{}, 17, more | 185})));
  expect_not_ours(ethernet(type_ipv4, ipv4(foreign, {{}, 17, more})));
  expect_not_ours(ethernet(type_ipv4, ipv4("the rest", {{}, 6, 185})));
  expect_truncated(ethernet(type_ipv6, ipv6(fragment(17, 0, true) + datagram, 44)));
  expect_truncated(ethernet(type_ipv6, ipv6(fragment(17, 181, false) + "the rest", 44)));
  expect_not_ours(ethernet(type_ipv6, ipv6(fragment(17, 0, true) + foreign, 44)));
  expect_not_ours(ethernet(type_ipv6, ipv6(fragment(6, 181, false) + "the rest", 44)));
}

TEST_F(Pcap, DatagramThatItsPacketDoesNotHoldIsTruncated) {
  expect_truncated(ethernet(type_ipv4, ipv4(udp("payload", ours, 16))));
  expect_truncated(ethernet(type_ipv4, ipv4(udp("payload", ours, 16)) + Bytes(30, '\0')));
  expect_truncated(ethernet(type_ipv4, ipv4(udp("payload", ours, 7))));
  expect_truncated(ethernet(type_ipv6, ipv6(udp("payload", ours, 65535))));
  expect_truncated(ethernet(type_ipv4, ipv4("1234567")));
}

TEST_F(Pcap, OtherTraffic) {
  expect_not_ours(ethernet(0x0806, Bytes(28, '\0')));
  expect_not_ours(ethernet(type_ipv4, ipv4(udp("payload", ours + 1))));
  expect_not_ours(ethernet(type_ipv4, ipv4(udp("payload", ours), {{}, 47})));
  expect_not_ours(ethernet(type_ipv6, ipv6(udp("payload", ours), 58)));
  expect_not_ours(ethernet(type_ipv6, ipv6(extension(59, 0), 0)));
  expect_not_ours(ethernet(type_ipv4, v6));
  expect_not_ours(ethernet(type_ipv6, v4));
  expect_not_ours(ethernet(type_ipv4, u8(0x44) + v4.substr(1)));
}

TEST_F(Pcap, TheSenderIsNamedOrTheOnlyOne) {
  const std::vector<Bytes> packets = {ethernet(type_ipv4, v4), ethernet(type_ipv6, v6)};
  const auto port = captured(1, packets);
  std::vector<std::string> senders;
  while (const auto received = port->receive()) senders.emplace_back(EndpointText(received->from).whole());
  EXPECT_EQ(senders, (std::vector<std::string>{"127.0.0.1:40000", "[101:101:101:101:101:101:101:101]:40000"}));
  for (const std::string& sender : senders) {
    PortSettings settings = Role::listener;
    settings.from = Endpoint::parse(sender);
    const auto strict = open_port(spec(), settings);
    EXPECT_EQ(payloads(*strict).size(), 1U);
    EXPECT_EQ(strict->counters().foreign, 1U);
    EXPECT_NE(strict->counters().foreign_from, *settings.from);
    EXPECT_EQ(strict->other_content(), "");
  }
}

TEST_F(Pcap, OtherPortsAreNamedIfThereIsNothingForOurs) {
  const Bytes other = ethernet(type_ipv4, ipv4(udp("payload", 9811))), arp = ethernet(0x0806, Bytes(28, '\0'));
  const auto content = [this](const std::vector<Bytes>& packets) {
    const auto port = captured(1, packets);
    EXPECT_EQ(port->other_content(), "");
    payloads(*port);
    return std::string(port->other_content());
  };
  EXPECT_EQ(content({arp, other, other, other}), "3 datagrams to port 9811 and none to 9810");
  EXPECT_EQ(content({other, ethernet(type_ipv6, ipv6(udp("payload", 53))), other}),
            "2 datagrams to port 9811, 1 datagram to port 53 and none to 9810");
  EXPECT_EQ(content({other, ethernet(type_ipv4, v4)}), "");
  EXPECT_EQ(content({arp, arp}), "no UDP datagram and no TCP data in 2 packets");
  std::vector<Bytes> many;
  for (unsigned port = 1; port <= 1000; ++port) many.push_back(ethernet(type_ipv4, ipv4(udp("payload", port))));
  EXPECT_TRUE(content(many).ends_with("1 datagram to port 6 and none to 9810")) << content(many);
}

TEST_F(Pcap, EmptyDatagramIsNotNothing) {
  const auto port = captured(1, {ethernet(type_ipv4, ipv4(udp("", ours))), ethernet(type_ipv4, v4)});
  EXPECT_EQ(payloads(*port), (std::vector<std::string>{"", "payload"}));
}

TEST_F(Pcap, WithoutAPortAllDatagramsCome) {
  captured(1, {ethernet(type_ipv4, ipv4(udp("a", 1))), ethernet(0x0806, Bytes(28, '\0')),
               ethernet(type_ipv6, ipv6(udp("b", 65535)))});
  const auto port = open_port("pcap:" + path, Role::listener);
  EXPECT_EQ(payloads(*port), (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(port->counters().not_ours, 1U);
}

TEST_F(Pcap, AnyBytesAreHarmless) {
  std::uint32_t random = 1;
  const auto next = [&random] { return random = random * 1664525U + 1013904223U, random >> 8; };
  const Bytes models[] = {
      ethernet(type_ipv4, v4, {0x8100}),
      ethernet(type_ipv6, ipv6(extension(44, 1) + fragment(17, 0, false) + udp("payload", ours), 0)),
      cooked2(type_ipv6, v6), Order(false).u32(2) + v4};
  for (const unsigned link_type : {1U, 113U, 276U, 101U, 0U, 108U, 228U, 229U}) {
    std::vector<Bytes> packets;
    for (int i = 0; i < 5000; ++i) {
      Bytes packet = models[next() % std::size(models)];
      packet.resize(next() % (packet.size() + 1));
      for (std::uint32_t changes = next() % 4; changes > 0 && !packet.empty(); --changes)
        packet[next() % packet.size()] = static_cast<char>(next());
      packets.push_back(packet);
    }
    const auto port = captured(link_type, packets);
    const std::size_t found = payloads(*port).size();
    EXPECT_EQ(found + port->counters().truncated + port->counters().not_ours, packets.size());
  }
}

TEST_F(Pcap, NamesTheCauseIfItCannotBeOpened) {
  EXPECT_TRUE(mentions(error_of("pcap:" + folder / "none", Role::listener), "No such file"));
  write_file(path, "");
  EXPECT_TRUE(mentions(error_of(spec(), Role::listener), "pcapng"));
  write_file(path, "this is no capture, and long enough to hold a header");
  EXPECT_TRUE(mentions(error_of(spec(), Role::listener), "right would be a pcap or pcapng file"));
  write_file(path, file_header({}, 1).substr(0, 20));
  EXPECT_TRUE(mentions(error_of(spec(), Role::listener), "truncated"));
  write_file(path, file_header({}, 105));
  EXPECT_TRUE(mentions(error_of(spec(), Role::listener), "105"));
  EXPECT_TRUE(mentions(error_of(spec(), Role::listener), "right would be Ethernet"));
  write_file(path, file_header({}, 1));
  EXPECT_EQ(error_of(spec(), Role::listener), "");
  EXPECT_TRUE(mentions(error_of(spec(), Role::device), "only be read"));
  EXPECT_TRUE(mentions(error_of("pcap:" + path + "?port=0", Role::listener), "from 1 to 65535"));
}

}  // namespace
}  // namespace imud
