// Builds packets, and the capture files that hold them, byte by byte from the specifications:
// https://www.tcpdump.org/linktypes.html, draft-ietf-opsawg-pcap, draft-ietf-opsawg-pcapng.
#pragma once

#include <cstdint>
#include <fstream>
#include <initializer_list>
#include <optional>
#include <string>

namespace imud::capture {

using Bytes = std::string;

inline Bytes be16(unsigned value) { return {static_cast<char>(value >> 8 & 0xFF), static_cast<char>(value & 0xFF)}; }
inline Bytes be32(std::uint32_t value) { return be16(value >> 16) + be16(value & 0xFFFF); }
inline Bytes u8(unsigned value) { return {static_cast<char>(value)}; }

inline Bytes udp(const Bytes& payload, unsigned port, std::optional<unsigned> length = {}) {
  return be16(40000) + be16(port) + be16(length.value_or(static_cast<unsigned>(8 + payload.size()))) + be16(0) +
         payload;
}

// The flags of a TCP segment.
inline constexpr unsigned fin = 1, syn = 2, rst = 4, ack = 16;

inline Bytes tcp(const Bytes& payload, unsigned from, unsigned to, std::uint32_t sequence, unsigned flags = ack,
                 const Bytes& options = {}) {
  return be16(from) + be16(to) + be32(sequence) + be32(0) + u8(static_cast<unsigned>(20 + options.size()) / 4 << 4) +
         u8(flags) + be16(65535) + be16(0) + be16(0) + options + payload;
}

struct Ipv4 {
  Bytes options = {};
  unsigned protocol = 17;
  unsigned fragmentation = 0x4000;  // flags and offset; don't fragment
};
inline Bytes ipv4(const Bytes& content, const Ipv4& ip = {}) {
  const auto header = static_cast<unsigned>(20 + ip.options.size());
  return u8(0x40 | header / 4) + u8(0) + be16(static_cast<unsigned>(header + content.size())) + be16(1) +
         be16(ip.fragmentation) + u8(64) + u8(ip.protocol) + be16(0) + be32(0x7F000001) + be32(0x7F000001) +
         ip.options + content;
}

// `content` begins with the extension headers, if `next` is one.
inline Bytes ipv6(const Bytes& content, unsigned next = 17) {
  return be32(0x60000000) + be16(static_cast<unsigned>(content.size())) + u8(next) + u8(64) + Bytes(32, '\1') +
         content;
}
inline Bytes extension(unsigned next, unsigned extra_octets) {
  return u8(next) + u8(extra_octets) + Bytes(6 + 8 * extra_octets, '\0');
}
inline Bytes fragment(unsigned next, unsigned offset, bool more) {
  return u8(next) + u8(0) + be16(offset << 3 | (more ? 1U : 0U)) + be32(7);
}

inline Bytes ethernet(unsigned type, const Bytes& packet, std::initializer_list<unsigned> tags = {}) {
  Bytes frame(12, '\2');
  for (const unsigned tag : tags) frame += be16(tag) + be16(0x0064);
  return frame + be16(type) + packet;
}
inline Bytes cooked1(unsigned type, const Bytes& packet) {
  return be16(4) + be16(1) + be16(6) + Bytes(8, '\3') + be16(type) + packet;
}
inline Bytes cooked2(unsigned type, const Bytes& packet) {
  return be16(type) + be16(0) + be32(1) + be16(1) + u8(4) + u8(6) + Bytes(8, '\3') + packet;
}

// Writes numbers in the byte order of the capturing machine.
class Order {
 public:
  explicit Order(bool big) : big_(big) {}
  Bytes u16(unsigned value) const { return big_ ? be16(value) : reversed(be16(value)); }
  Bytes u32(std::uint32_t value) const { return big_ ? be32(value) : reversed(be32(value)); }

 private:
  static Bytes reversed(const Bytes& bytes) { return {bytes.rbegin(), bytes.rend()}; }
  bool big_;
};

struct Record {
  std::int64_t ns;
  Bytes packet;
  std::size_t cut = 0;  // bytes that the snap length removed from the end
};

struct Format {
  bool ng = false;
  bool big_endian = false;
  bool nanoseconds = true;
};

inline Bytes file_header(const Format& format, unsigned link_type) {
  const Order order(format.big_endian);
  if (!format.ng)
    return order.u32(format.nanoseconds ? 0xA1B23C4D : 0xA1B2C3D4) + order.u16(2) + order.u16(4) + order.u32(0) +
           order.u32(0) + order.u32(262144) + order.u32(link_type);
  const Bytes section = order.u32(0x0A0D0D0A) + order.u32(28) + order.u32(0x1A2B3C4D) + order.u16(1) + order.u16(0) +
                        Bytes(8, '\xFF') + order.u32(28);
  const Bytes resolution = format.nanoseconds ? order.u16(9) + order.u16(1) + u8(9) + Bytes(3, '\0') : Bytes();
  const Bytes end_of_options = format.nanoseconds ? order.u16(0) + order.u16(0) : Bytes();
  const auto size = static_cast<std::uint32_t>(20 + resolution.size() + end_of_options.size());
  return section + order.u32(1) + order.u32(size) + order.u16(link_type) + order.u16(0) + order.u32(262144) +
         resolution + end_of_options + order.u32(size);
}

inline Bytes file_record(const Format& format, const Record& record) {
  const Order order(format.big_endian);
  const Bytes captured = record.packet.substr(0, record.packet.size() - record.cut);
  const Bytes lengths = order.u32(static_cast<std::uint32_t>(captured.size())) +
                        order.u32(static_cast<std::uint32_t>(record.packet.size()));
  if (!format.ng)
    return order.u32(static_cast<std::uint32_t>(record.ns / 1'000'000'000)) +
           order.u32(static_cast<std::uint32_t>(record.ns % 1'000'000'000 / (format.nanoseconds ? 1 : 1000))) +
           lengths + captured;
  const auto stamp = static_cast<std::uint64_t>(record.ns / (format.nanoseconds ? 1 : 1000));
  const Bytes padding((4 - captured.size() % 4) % 4, '\0');
  const auto size = static_cast<std::uint32_t>(32 + captured.size() + padding.size());
  return order.u32(6) + order.u32(size) + order.u32(0) + order.u32(static_cast<std::uint32_t>(stamp >> 32)) +
         order.u32(static_cast<std::uint32_t>(stamp)) + lengths + captured + padding + order.u32(size);
}

inline void write_file(const std::string& path, const Bytes& content) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
}

}  // namespace imud::capture
