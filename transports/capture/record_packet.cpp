// LINKTYPE_CAN_SOCKETCAN (https://www.tcpdump.org/linktypes/LINKTYPE_CAN_SOCKETCAN.html), RFC 791, RFC 8200, RFC 768,
// RFC 1071.
#include "transports/capture/record_packet.hpp"

#include <linux/can.h>
#include <pcap/dlt.h>

#include <algorithm>
#include <cstring>

#include "transports/can/can_dlc.hpp"

namespace imud {
namespace {

using ByteSpan = std::span<const std::byte>;

void put(std::byte* at, std::uint64_t value, std::size_t size) noexcept {
  for (std::size_t i = 0; i < size; ++i) at[i] = static_cast<std::byte>(value >> (8 * i) & 0xFFU);
}

std::uint64_t get(ByteSpan bytes, std::size_t at, std::size_t size) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = size; i-- > 0;) value = value << 8 | std::to_integer<std::uint64_t>(bytes[at + i]);
  return value;
}

void append_big_endian(std::vector<std::byte>& out, std::uint64_t value, std::size_t size) {
  for (std::size_t i = size; i-- > 0;) out.push_back(static_cast<std::byte>(value >> (8 * i) & 0xFFU));
}

// The sum of RFC 1071 over `bytes`, an odd one padded with 0.
std::uint64_t sum16(ByteSpan bytes) noexcept {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i)
    sum += std::to_integer<std::uint64_t>(bytes[i]) << (i % 2 == 0 ? 8 : 0);
  return sum;
}

std::uint16_t checksum(std::uint64_t sum) noexcept {
  while (sum >> 16 != 0) sum = (sum & 0xFFFFU) + (sum >> 16);
  return static_cast<std::uint16_t>(~sum);
}

void replace(std::vector<std::byte>& out, std::size_t at, std::uint16_t value) noexcept {
  out[at] = static_cast<std::byte>(value >> 8);
  out[at + 1] = static_cast<std::byte>(value & 0xFFU);
}

// Returns the 16 bytes of the address.
std::array<std::byte, 16> address_of(const Endpoint& endpoint) noexcept {
  std::array<std::byte, 16> bytes;
  std::memcpy(bytes.data(), endpoint.address.data(), bytes.size());
  return bytes;
}

// An address that is not known, all zero, may be of either version.
bool may_be_ipv4(const Endpoint& endpoint) noexcept {
  constexpr std::array<std::byte, 12> mapped = {
      {{}, {}, {}, {}, {}, {}, {}, {}, {}, {}, std::byte{0xFF}, std::byte{0xFF}}};
  const auto bytes = address_of(endpoint);
  return std::equal(mapped.begin(), mapped.end(), bytes.begin()) || (endpoint.address[0] | endpoint.address[1]) == 0;
}

}  // namespace

RecordEventBytes encode_record_event(const RecordEvent& event) noexcept {
  RecordEventBytes bytes{};
  put(&bytes[0], static_cast<std::uint8_t>(event.type), 1);
  put(&bytes[1], event.flags, 1);
  put(&bytes[2], event.interface, 2);
  put(&bytes[8], static_cast<std::uint64_t>(event.a), 8);
  put(&bytes[16], static_cast<std::uint64_t>(event.b), 8);
  put(&bytes[24], static_cast<std::uint64_t>(event.c), 8);
  return bytes;
}

std::optional<RecordEvent> decode_record_event(ByteSpan bytes) noexcept {
  if (bytes.size() != RecordEvent::size) return std::nullopt;
  RecordEvent event;
  event.type = static_cast<RecordEvent::Type>(get(bytes, 0, 1));
  if (event.type < RecordEvent::Type::begin || event.type > RecordEvent::Type::mark) return std::nullopt;
  event.flags = static_cast<std::uint8_t>(get(bytes, 1, 1));
  event.interface = static_cast<std::uint16_t>(get(bytes, 2, 2));
  event.a = static_cast<std::int64_t>(get(bytes, 8, 8));
  event.b = static_cast<std::int64_t>(get(bytes, 16, 8));
  event.c = static_cast<std::int64_t>(get(bytes, 24, 8));
  return event;
}

void append_can_packet(std::vector<std::byte>& out, const Frame& frame) {
  constexpr std::uint8_t bit_rate_switch = 0x01, fd = 0x04;
  const CanHeader& can = frame.can;
  append_big_endian(out,
                    can.id | (can.extended ? CAN_EFF_FLAG : 0U) | (can.remote ? CAN_RTR_FLAG : 0U) |
                        (can.error ? CAN_ERR_FLAG : 0U),
                    4);
  append_big_endian(out, frame.bytes.size(), 1);
  append_big_endian(out, (can.fd ? fd : 0U) | (can.bit_rate_switch ? bit_rate_switch : 0U), 1);
  append_big_endian(out, 0, 2);
  out.insert(out.end(), frame.bytes.begin(), frame.bytes.end());
}

std::optional<Frame> decode_can_packet(ByteSpan packet) noexcept {
  constexpr std::size_t header = 8;
  constexpr std::uint64_t bit_rate_switch = 0x01, fd = 0x04;
  if (packet.size() < header) return std::nullopt;
  std::uint32_t id = 0;
  for (std::size_t i = 0; i < 4; ++i) id = id << 8 | std::to_integer<std::uint32_t>(packet[i]);
  const std::size_t size = get(packet, 4, 1);
  Frame frame;
  frame.can.extended = (id & CAN_EFF_FLAG) != 0;
  frame.can.remote = (id & CAN_RTR_FLAG) != 0;
  frame.can.error = (id & CAN_ERR_FLAG) != 0;
  frame.can.id = id & (frame.can.extended || frame.can.error ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.can.fd = (get(packet, 5, 1) & fd) != 0 || size > CAN_MAX_DLEN;
  frame.can.bit_rate_switch = frame.can.fd && (get(packet, 5, 1) & bit_rate_switch) != 0;
  // A remote frame has a length, but may have no data.
  if (size > packet.size() - header && !frame.can.remote) return std::nullopt;
  if (size > CANFD_MAX_DLEN || (frame.can.fd && (frame.can.remote || fd_length(size) != size))) return std::nullopt;
  frame.bytes = packet.subspan(header, std::min(size, packet.size() - header));
  return frame;
}

UdpPacket decode_udp_packet(ByteSpan packet) noexcept { return udp_packet(DLT_RAW, packet, 0); }

void append_udp_packet(std::vector<std::byte>& out, ByteSpan payload, const Endpoint& from, const Endpoint& to) {
  constexpr std::size_t udp_header = 8, longest = 65'535;
  constexpr std::uint8_t protocol_udp = 17, hops = 64;
  const bool is_ipv4 = may_be_ipv4(from) && may_be_ipv4(to);
  const std::size_t ip_header = is_ipv4 ? 20 : 40, address = is_ipv4 ? 4 : 16;
  payload = payload.first(std::min(payload.size(), longest - udp_header - (is_ipv4 ? ip_header : 0)));
  const std::size_t udp_size = udp_header + payload.size(), begin = out.size();
  if (is_ipv4) {
    append_big_endian(out, 0x4500, 2);
    append_big_endian(out, ip_header + udp_size, 2);
    append_big_endian(out, 0, 4);  // identification, fragmentation
    append_big_endian(out, hops, 1);
    append_big_endian(out, protocol_udp, 1);
    append_big_endian(out, 0, 2);
  } else {
    append_big_endian(out, 0x6000'0000, 4);
    append_big_endian(out, udp_size, 2);
    append_big_endian(out, protocol_udp, 1);
    append_big_endian(out, hops, 1);
  }
  for (const Endpoint* endpoint : {&from, &to}) {
    const auto bytes = address_of(*endpoint);
    out.insert(out.end(), bytes.end() - static_cast<std::ptrdiff_t>(address), bytes.end());
  }
  constexpr std::size_t ipv4_checksum = 10, udp_checksum = 6;
  if (is_ipv4) replace(out, begin + ipv4_checksum, checksum(sum16(ByteSpan(out).subspan(begin, ip_header))));
  append_big_endian(out, from.port, 2);
  append_big_endian(out, to.port, 2);
  append_big_endian(out, udp_size, 2);
  append_big_endian(out, 0, 2);
  out.insert(out.end(), payload.begin(), payload.end());
  const std::uint64_t pseudo_header = protocol_udp + udp_size;
  const std::uint16_t sum = checksum(pseudo_header + sum16(ByteSpan(out).subspan(begin + ip_header - 2 * address)));
  replace(out, begin + ip_header + udp_checksum, sum == 0 ? 0xFFFF : sum);
}

}  // namespace imud
