// The writer's and the reader's blocks, and any other bytes.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstring>
#include <random>
#include <string>

#include "transports/capture/pcapng_merge.hpp"
#include "transports/capture/pcapng_reader.hpp"
#include "transports/capture/record_packet.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

std::span<const std::byte> pcapng_bytes(std::string_view text) { return std::as_bytes(std::span(text)); }

// A file in memory.
class PcapngMemory {
 public:
  explicit PcapngMemory(std::span<const std::byte> bytes) : file_(::memfd_create("pcapng", MFD_CLOEXEC)) {
    EXPECT_EQ(::write(file_.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  std::string path() const { return "/proc/self/fd/" + std::to_string(file_.get()); }
  PortSpec spec() const { return PortSpec::parse("record:" + path()); }

 private:
  FileDescriptor file_;
};

std::vector<std::byte> small_record() {
  std::vector<std::byte> out;
  append_section(out, "test");
  append_interface(out, {link_type::event, "imud"});
  append_interface(out, {link_type::raw_ip, "truth"});
  append_interface(out, {link_type::can_socketcan, "bus"});
  append_interface(out, {link_type::bytes, "imu1"});
  append_packet(out, {.interface = 0, .time_ns = 1, .bytes = encode_record_event({.a = -5, .b = 1, .c = 1})});
  std::vector<std::byte> packet;
  append_udp_packet(packet, pcapng_bytes("truth"), Endpoint::parse("10.0.0.1:5000"),
                    Endpoint::parse("10.0.0.2:9810"));
  append_packet(out, {1, 1'700'000'000'123'456'789, PacketDirection::inbound, packet});
  packet.clear();
  append_udp_packet(packet, pcapng_bytes("six"), Endpoint::parse("[::1]:5000"), Endpoint());
  append_packet(out, {1, 1'700'000'000'123'456'790, PacketDirection::inbound, packet});
  packet.clear();
  append_can_packet(packet, {pcapng_bytes("12345678"), {.id = 0x18FF0102, .extended = true}});
  append_packet(out, {2, 2, PacketDirection::outbound, packet});
  append_packet(out, {3, 3, PacketDirection::outbound, pcapng_bytes("odd")});
  return out;
}

TEST(Pcapng, ReadsWhatItWrites) {
  const std::vector<std::byte> written = small_record();
  const PcapngMemory file(written);
  PcapngReader reader(file.spec());
  auto packet = reader.next();
  ASSERT_TRUE(packet);
  ASSERT_EQ(reader.interfaces().size(), 4U);
  EXPECT_EQ(reader.interfaces()[3].name, "imu1");
  EXPECT_EQ(reader.interfaces()[3].link_type, 147);
  EXPECT_EQ(decode_record_event(packet->bytes).value().a, -5);
  packet = reader.next();
  EXPECT_EQ(packet.value().time_ns, 1'700'000'000'123'456'789);
  EXPECT_EQ(packet->direction, PacketDirection::inbound);
  UdpPacket datagram = decode_udp_packet(packet->bytes);
  EXPECT_EQ(datagram.outcome, UdpPacket::Outcome::whole);
  EXPECT_EQ(EndpointText(datagram.from).whole(), "10.0.0.1:5000");
  EXPECT_EQ(datagram.port, 9810);
  EXPECT_EQ(datagram.payload.size(), 5U);
  packet = reader.next();
  datagram = decode_udp_packet(packet.value().bytes);
  EXPECT_EQ(EndpointText(datagram.from).whole(), "[::1]:5000");
  packet = reader.next();
  const auto frame = decode_can_packet(packet.value().bytes);
  EXPECT_EQ(frame.value().can, (CanHeader{.id = 0x18FF0102, .extended = true}));
  EXPECT_EQ(frame->bytes.size(), 8U);
  packet = reader.next();
  EXPECT_EQ(packet.value().bytes.size(), 3U);
  EXPECT_FALSE(reader.next());
  EXPECT_TRUE(reader.at_end());
  EXPECT_EQ(reader.end_warning(), "");
}

// The header of LINKTYPE_CAN_SOCKETCAN: the identifier with its flags, the length, the flags of CAN FD, two zeros.
TEST(Pcapng, ACanPacketHasTheHeaderOfSocketCan) {
  const struct {
    CanHeader can;
    std::size_t size;
    std::array<unsigned, 6> header;
  } cases[] = {
      {{.id = 0x123}, 3, {0x00, 0x00, 0x01, 0x23, 3, 0x00}},
      {{.id = 0x7FF}, 0, {0x00, 0x00, 0x07, 0xFF, 0, 0x00}},
      {{.id = 0x18FF0102, .extended = true}, 8, {0x98, 0xFF, 0x01, 0x02, 8, 0x00}},
      {{.id = 0x7, .remote = true}, 2, {0x40, 0x00, 0x00, 0x07, 2, 0x00}},
      {{.id = 0x80, .error = true}, 8, {0x20, 0x00, 0x00, 0x80, 8, 0x00}},
      {{.id = 0x123, .fd = true}, 8, {0x00, 0x00, 0x01, 0x23, 8, 0x04}},
      {{.id = 0x1FFFFFFF, .extended = true, .fd = true, .bit_rate_switch = true},
       64,
       {0x9F, 0xFF, 0xFF, 0xFF, 64, 0x05}},
  };
  const std::vector<std::byte> data(64, std::byte{0x5A});
  for (const auto& c : cases) {
    std::vector<std::byte> packet, expected;
    append_can_packet(packet, {std::span(data).first(c.size), c.can});
    for (const unsigned byte : c.header) expected.push_back(static_cast<std::byte>(byte));
    expected.resize(8);
    expected.insert(expected.end(), data.begin(), data.begin() + static_cast<std::ptrdiff_t>(c.size));
    EXPECT_EQ(packet, expected) << c.can.id;
    const auto frame = decode_can_packet(packet);
    ASSERT_TRUE(frame) << c.can.id;
    EXPECT_EQ(frame->can, c.can);
    EXPECT_EQ(frame->bytes.size(), c.size);
  }
}

// RFC 1071: the sum over a header or datagram with its checksum is 0xFFFF.
TEST(Pcapng, ChecksumsOfDatagramsAreRight) {
  std::vector<std::byte> packet;
  append_udp_packet(packet, pcapng_bytes("truth"), Endpoint::parse("10.0.0.1:5000"),
                    Endpoint::parse("10.0.0.2:9810"));
  const auto sum = [&](std::size_t begin, std::size_t end, std::uint32_t total) {
    for (std::size_t i = begin; i < end; ++i)
      total += std::to_integer<std::uint32_t>(packet[i]) << ((i - begin) % 2 == 0 ? 8 : 0);
    return (total & 0xFFFF) + (total >> 16);
  };
  EXPECT_EQ(sum(0, 20, 0), 0xFFFFU);
  EXPECT_EQ(sum(12, packet.size(), 17 + 13), 0xFFFFU);
}

// The section is big-endian; its times are in microseconds, or in 2^-10 s from an offset.
TEST(Pcapng, ReadsOtherByteOrdersAndClocks) {
  std::string text;
  const auto u32 = [&](std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(value >> shift & 0xFF);
  };
  const auto words = [&](std::initializer_list<std::uint32_t> all) {
    for (const std::uint32_t word : all) u32(word);
  };
  words({0x0A0D0D0A, 28, 0x1A2B3C4D, 0x00010000, 0xFFFFFFFF, 0xFFFFFFFF, 28});
  words({1, 20, 147U << 16, 0, 20});
  words({1, 44, 147U << 16, 0, 9U << 16 | 1, 0x8A000000, 14U << 16 | 8, 0, 100, 0, 44});
  words({5, 12, 12});                                // another block
  words({6, 36, 0, 1, 5, 4, 4, 0x61626364, 36});     // (2^32 + 5) us
  words({6, 36, 1, 0, 1536, 1, 1, 0x61000000, 36});  // 101.5 s
  words({6, 32, 7, 0, 0, 0, 0, 32});                 // of no interface
  const PcapngMemory file(pcapng_bytes(text));
  PcapngReader reader(file.spec());
  EXPECT_EQ(reader.next().value().time_ns, 4'294'967'301'000);
  EXPECT_EQ(reader.next().value().time_ns, 101'500'000'000);
  EXPECT_FALSE(reader.next());
  EXPECT_EQ(reader.skipped(), 1U);
  EXPECT_EQ(reader.end_warning(), "");
}

TEST(Pcapng, ReadsUpToATornBlock) {
  const std::vector<std::byte> whole = small_record();
  std::size_t warned = 0;
  for (std::size_t size = 28; size < whole.size(); ++size) {
    const PcapngMemory file{std::span(whole).first(size)};
    PcapngReader reader(file.spec());
    std::size_t packets = 0;
    while (reader.next()) ++packets;
    EXPECT_TRUE(reader.at_end());
    EXPECT_LT(packets, 5U);
    warned += reader.end_warning().starts_with("cut short") ? 1 : 0;
  }
  EXPECT_GT(warned, whole.size() - 28 - 12);
}

// The interfaces of a section are numbered from 0 again, and those of the section before are gone.
TEST(Pcapng, ASectionHasItsOwnInterfaces) {
  std::vector<std::byte> two = small_record();
  append_section(two, "test");
  append_interface(two, {link_type::bytes, "other"});
  append_packet(two, {0, 7, PacketDirection::outbound, pcapng_bytes("other")});
  append_packet(two, {3, 8, PacketDirection::outbound, pcapng_bytes("of no interface")});
  const PcapngMemory file(two);
  PcapngReader reader(file.spec());
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(reader.next());
  const auto packet = reader.next();
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->time_ns, 7);
  ASSERT_EQ(reader.interfaces().size(), 1U);
  EXPECT_EQ(reader.interfaces()[packet->interface].name, "other");
  EXPECT_FALSE(reader.next());
  EXPECT_EQ(reader.skipped(), 1U);
  EXPECT_EQ(reader.end_warning(), "");
}

TEST(Pcapng, PacketsThatAreTooLongAreSkippedAndCounted) {
  const std::string longest(PcapngReader::longest_block - 32, 'x'), longer(PcapngReader::longest_block - 31, 'x');
  std::vector<std::byte> bytes;
  append_section(bytes, "test");
  append_interface(bytes, {link_type::bytes, "imu1"});
  for (const std::string& content : {longer, longest, longer})
    append_packet(bytes, {.interface = 0, .time_ns = 1, .bytes = pcapng_bytes(content)});
  append_packet(bytes, {.interface = 0, .time_ns = 2, .bytes = pcapng_bytes("end")});
  const PcapngMemory file(bytes);
  PcapngReader reader(file.spec());
  EXPECT_EQ(reader.next().value().bytes.size(), longest.size());
  EXPECT_EQ(reader.next().value().bytes.size(), 3U);
  EXPECT_FALSE(reader.next());
  EXPECT_EQ(reader.skipped(), 2U);
}

// The second section of the first file, as of a record in several files, has one interface more.
TEST(Pcapng, MergesFilesByTime) {
  std::vector<std::byte> first, second;
  const auto append = [](std::vector<std::byte>& file, std::uint32_t interface, std::int64_t time_ns,
                         PacketDirection direction, std::string_view content) {
    append_packet(file, {interface, time_ns, direction, pcapng_bytes(std::string(content))});
  };
  const auto begin = [](std::vector<std::byte>& file, std::initializer_list<const char*> imus) {
    append_section(file, "test");
    append_interface(file, {link_type::event, "imud"});
    for (const char* imu : imus) append_interface(file, {link_type::bytes, imu});
  };
  begin(first, {"imu1"});
  append(first, 1, 10, PacketDirection::outbound, "a");
  append(first, 0, 30, PacketDirection::unknown, "b");
  begin(first, {"imu1", "imu2"});
  append(first, 0, 25, PacketDirection::unknown, "c");
  append(first, 2, 40, PacketDirection::inbound, "d");
  begin(second, {});
  append(second, 0, 10, PacketDirection::unknown, "e");
  append(second, 0, 26, PacketDirection::unknown, "f");
  append(second, 0, 40, PacketDirection::unknown, "g");
  second.resize(second.size() - 4);
  const PcapngMemory one(first), other(second), merged({});
  std::vector<MergedCapture> captures = {{one.path(), "x/", 0, {}}, {other.path(), "y/", 0, {}}};
  const FileDescriptor out(::open(merged.path().c_str(), O_RDWR | O_CLOEXEC));
  const std::atomic<bool> stop = false;
  ASSERT_EQ(merge_pcapng(captures, out.get(), "test", stop), 0);
  PcapngReader reader(merged.spec());
  std::string all;
  while (const auto packet = reader.next()) {
    const PcapngInterface& interface = reader.interfaces()[packet->interface];
    all += interface.name + ' ' + std::to_string(packet->time_ns) + ' ' +
           std::string(reinterpret_cast<const char*>(packet->bytes.data()), packet->bytes.size()) + '\n';
    EXPECT_EQ(interface.link_type, interface.name.ends_with("imud") ? link_type::event : link_type::bytes);
    EXPECT_EQ(packet->direction == PacketDirection::inbound, packet->bytes[0] == std::byte{'d'});
  }
  // Packets of equal times are in the order of the files. The packets of a file stay in their order.
  EXPECT_EQ(all, "x/imu1 10 a\ny/imud 10 e\ny/imud 26 f\nx/imud 30 b\nx/imud 25 c\nx/imu2 40 d\n");
  EXPECT_EQ(captures[0].packets, 4U);
  EXPECT_EQ(captures[0].end_warning, "");
  EXPECT_EQ(captures[1].packets, 2U);
  EXPECT_NE(captures[1].end_warning, "") << "its last block is cut short";
  EXPECT_EQ(merge_pcapng(captures, -1, "test", stop), EBADF);
}

TEST(Pcapng, RefusesWhatIsNone) {
  const PcapngMemory text(pcapng_bytes("time_ns,r_BN_N_x,r_BN_N_y"));
  EXPECT_THROW(PcapngReader(text.spec()), PortError);
  const PcapngMemory empty(pcapng_bytes(""));
  EXPECT_THROW(PcapngReader(empty.spec()), PortError);
}

TEST(Pcapng, TheTransportReadsOneInterface) {
  const PcapngMemory file(small_record());
  EXPECT_EQ(capture_port(file.path()), "record:" + file.path());
  const auto truth = open_port("record:" + file.path(), Role::listener);
  EXPECT_EQ(truth->keeps_datagrams(), true);
  EXPECT_EQ(truth->receive().value().frame.bytes.size(), 5U);
  EXPECT_EQ(truth->receive().value().frame.bytes.size(), 3U);
  EXPECT_FALSE(truth->receive());
  EXPECT_TRUE(truth->at_end());
  const auto bus = open_port("record:" + file.path() + "?interface=bus", Role::listener);
  EXPECT_EQ(bus->receive().value().frame.can.id, 0x18FF0102U);
  try {
    open_port("record:" + file.path() + "?interface=imu2", Role::listener);
    ADD_FAILURE();
  } catch (const PortError& error) {
    EXPECT_NE(std::string(error.what()).find("no interface \"imu2\"; right would be one of truth, bus, imu1"),
              std::string::npos)
        << error.what();
  }
}

// Damaged and random files; every packet's bytes are looked at.
TEST(Pcapng, AnyBytesAreHarmless) {
  const std::vector<std::byte> whole = small_record();
  std::mt19937 random(3);
  std::size_t packets = 0, sum = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::vector<std::byte> bytes = whole;
    const std::size_t from = i % 4 == 0 ? 12 : 28;
    for (unsigned n = 1 + random() % 4; n > 0; --n) {
      const std::size_t at = from + random() % (bytes.size() - from);
      constexpr std::uint8_t special[] = {0, 1, 4, 0x7F, 0x80, 0xFF};
      bytes[at] = static_cast<std::byte>(random() % 2 == 0 ? special[random() % 6] : random() % 256);
    }
    if (i % 7 == 0) bytes.resize(from + random() % (bytes.size() - from));
    if (i % 11 == 0)
      for (std::size_t k = 28; k < bytes.size(); ++k) bytes[k] = static_cast<std::byte>(random() % 256);
    const PcapngMemory file(bytes);
    try {
      PcapngReader reader(file.spec());
      while (const auto packet = reader.next()) {
        ++packets;
        for (const std::byte byte : packet->bytes) sum += std::to_integer<std::size_t>(byte);
        static_cast<void>(decode_record_event(packet->bytes));
        if (const auto frame = decode_can_packet(packet->bytes)) sum += frame->bytes.size();
        sum += decode_udp_packet(packet->bytes).payload.size();
        ASSERT_LT(packet->interface, reader.interfaces().size());
      }
      EXPECT_TRUE(reader.at_end());
    } catch (const PortError&) {
      EXPECT_LT(from, 28U);
    }
  }
  EXPECT_GT(packets, 20'000U);
  EXPECT_GT(sum, 0U);
}

}  // namespace
}  // namespace imud
