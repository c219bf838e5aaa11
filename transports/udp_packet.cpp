// https://www.tcpdump.org/linktypes.html, RFC 791, RFC 8200 section 4, RFC 768, IEEE 802.1Q.
#include "transports/udp_packet.hpp"

#include <pcap/dlt.h>

#include <algorithm>

namespace imud {
namespace {

using Bytes = std::span<const std::byte>;
using Outcome = UdpPacket::Outcome;

const UdpPacket truncated{Outcome::truncated, {}, 0, {}};
const UdpPacket not_ours{Outcome::not_ours, {}, 0, {}};

constexpr std::uint8_t protocol_udp = 17;

std::uint8_t u8(Bytes bytes, std::size_t at) { return std::to_integer<std::uint8_t>(bytes[at]); }
std::uint16_t u16(Bytes bytes, std::size_t at) {
  return static_cast<std::uint16_t>(u8(bytes, at) << 8 | u8(bytes, at + 1));
}

// `from`: the sender's address; its port is in the datagram.
UdpPacket udp(Bytes bytes, std::uint16_t port, bool fragment, const Endpoint& from) {
  constexpr std::size_t header = 8;
  if (bytes.size() < header) return truncated;
  const std::uint16_t destination = u16(bytes, 2);
  if (port != 0 && destination != port) return {Outcome::not_ours, {}, destination, {}};
  const std::size_t length = u16(bytes, 4);
  if (fragment || length < header || length > bytes.size()) return truncated;
  UdpPacket packet{Outcome::whole, bytes.subspan(header, length - header), destination, from};
  packet.from.port = u16(bytes, 0);
  return packet;
}

UdpPacket ipv4(Bytes bytes, std::uint16_t port) {
  if (!bytes.empty() && u8(bytes, 0) >> 4 != 4) return not_ours;
  if (bytes.size() < 20) return truncated;
  const std::size_t header = (u8(bytes, 0) & 0x0FU) * 4;
  if (header < 20 || u8(bytes, 9) != protocol_udp) return not_ours;
  const std::size_t total = std::min<std::size_t>(u16(bytes, 2), bytes.size());
  const std::uint16_t fragmentation = u16(bytes, 6);
  constexpr std::uint16_t more = 0x2000, offset = 0x1FFF;
  if ((fragmentation & offset) != 0 || total < header) return truncated;
  constexpr std::size_t source = 12;
  return udp(bytes.subspan(header, total - header), port, (fragmentation & more) != 0,
             Endpoint::ipv4(&bytes[source], 0));
}

UdpPacket ipv6(Bytes bytes, std::uint16_t port) {
  if (!bytes.empty() && u8(bytes, 0) >> 4 != 6) return not_ours;
  if (bytes.size() < 40) return truncated;
  constexpr std::size_t source = 8;
  const Endpoint from = Endpoint::ipv6(&bytes[source], 0);
  std::uint8_t next = u8(bytes, 6);
  bytes = bytes.subspan(40, std::min<std::size_t>(u16(bytes, 4), bytes.size() - 40));
  bool fragment = false;
  while (next != protocol_udp) {
    constexpr std::uint8_t hop_by_hop = 0, routing = 43, fragmentation = 44, authentication = 51, options = 60,
                           mobility = 135, host_identity = 139, shim6 = 140;
    std::size_t header = 8;
    switch (next) {
      case hop_by_hop:
      case routing:
      case options:
      case mobility:
      case host_identity:
      case shim6:
        if (bytes.size() >= 2) header = (u8(bytes, 1) + 1U) * 8;
        break;
      case authentication:
        if (bytes.size() >= 2) header = (u8(bytes, 1) + 2U) * 4;
        break;
      case fragmentation:
        break;
      default:
        return not_ours;
    }
    if (bytes.size() < header) return truncated;
    const std::uint8_t current = next;
    next = u8(bytes, 0);
    if (current == fragmentation) {
      constexpr std::uint16_t offset = 0xFFF8, more = 1;
      const std::uint16_t field = u16(bytes, 2);
      if ((field & offset) != 0) return next == protocol_udp ? truncated : not_ours;
      fragment = (field & more) != 0;
    }
    bytes = bytes.subspan(header);
  }
  return udp(bytes, port, fragment, from);
}

UdpPacket ip(Bytes bytes, std::uint16_t port) {
  if (bytes.empty()) return truncated;
  return u8(bytes, 0) >> 4 == 6 ? ipv6(bytes, port) : ipv4(bytes, port);
}

UdpPacket ether_type(std::uint16_t type, Bytes bytes, std::uint16_t port) {
  constexpr std::uint16_t customer_tag = 0x8100, service_tag = 0x88A8, old_service_tag = 0x9100;
  while (type == customer_tag || type == service_tag || type == old_service_tag) {
    if (bytes.size() < 4) return truncated;
    type = u16(bytes, 2);
    bytes = bytes.subspan(4);
  }
  if (type == 0x0800) return ipv4(bytes, port);
  if (type == 0x86DD) return ipv6(bytes, port);
  return not_ours;
}

// A link type's header: the offset of its EtherType, or -1 if IP follows without one, and its length, both in bytes.
struct LinkLayer {
  int link_type;
  int type_at;
  std::size_t header;
};

// The address family in null and loop headers differs between systems, and so does its byte order: the IP version is
// used instead.
constexpr LinkLayer link_layers[] = {
    {DLT_EN10MB, 12, 14}, {DLT_LINUX_SLL, 14, 16}, {DLT_LINUX_SLL2, 0, 20}, {DLT_NULL, -1, 4},
    {DLT_LOOP, -1, 4},    {DLT_RAW, -1, 0},        {DLT_IPV4, -1, 0},       {DLT_IPV6, -1, 0},
};

const LinkLayer* find(int link_type) {
  const auto found = std::find_if(std::begin(link_layers), std::end(link_layers),
                                  [link_type](const LinkLayer& layer) { return layer.link_type == link_type; });
  return found == std::end(link_layers) ? nullptr : found;
}

}  // namespace

bool supports_link_type(int link_type) noexcept { return find(link_type) != nullptr; }

UdpPacket udp_packet(int link_type, Bytes captured, std::uint16_t port) noexcept {
  const LinkLayer* layer = find(link_type);
  if (layer == nullptr) return not_ours;
  if (captured.size() < layer->header) return truncated;
  const Bytes packet = captured.subspan(layer->header);
  if (layer->type_at < 0) return ip(packet, port);
  return ether_type(u16(captured, static_cast<std::size_t>(layer->type_at)), packet, port);
}

}  // namespace imud
