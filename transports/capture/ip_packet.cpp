// https://www.tcpdump.org/linktypes.html, RFC 791, RFC 8200 section 4, IEEE 802.1Q.
#include "transports/capture/ip_packet.hpp"

#include <pcap/dlt.h>

#include <algorithm>
#include <iterator>

namespace imud {
namespace {

using Bytes = std::span<const std::byte>;
using Outcome = IpPacket::Outcome;

constexpr auto u8 = network_u8;
constexpr auto u16 = network_u16;

const IpPacket truncated{Outcome::truncated};
const IpPacket other{Outcome::other};

bool is_carried(std::uint8_t protocol) { return protocol == IpPacket::udp || protocol == IpPacket::tcp; }

// A later fragment may belong to a datagram for the port. TCP is not fragmented in practice.
IpPacket later_fragment(std::uint8_t protocol) { return protocol == IpPacket::udp ? truncated : other; }

IpPacket ipv4(Bytes bytes) {
  if (!bytes.empty() && u8(bytes, 0) >> 4 != 4) return other;
  if (bytes.size() < 20) return truncated;
  const std::size_t header = (u8(bytes, 0) & 0x0FU) * 4;
  const std::uint8_t protocol = u8(bytes, 9);
  if (header < 20 || !is_carried(protocol)) return other;
  const std::size_t total = std::min<std::size_t>(u16(bytes, 2), bytes.size());
  const std::uint16_t fragmentation = u16(bytes, 6);
  constexpr std::uint16_t more = 0x2000, offset = 0x1FFF;
  if ((fragmentation & offset) != 0) return later_fragment(protocol);
  if (total < header) return truncated;
  constexpr std::size_t source = 12, destination = 16;
  return {Outcome::found,
          protocol,
          (fragmentation & more) != 0,
          u16(bytes, 2) > bytes.size(),
          bytes.subspan(header, total - header),
          Endpoint::ipv4(&bytes[source], 0),
          Endpoint::ipv4(&bytes[destination], 0)};
}

IpPacket ipv6(Bytes bytes) {
  if (!bytes.empty() && u8(bytes, 0) >> 4 != 6) return other;
  if (bytes.size() < 40) return truncated;
  constexpr std::size_t source = 8, destination = 24;
  const Endpoint from = Endpoint::ipv6(&bytes[source], 0), to = Endpoint::ipv6(&bytes[destination], 0);
  std::uint8_t next = u8(bytes, 6);
  const bool is_cut = u16(bytes, 4) > bytes.size() - 40;
  bytes = bytes.subspan(40, std::min<std::size_t>(u16(bytes, 4), bytes.size() - 40));
  bool fragment = false;
  while (!is_carried(next)) {
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
        return other;
    }
    if (bytes.size() < header) return truncated;
    const std::uint8_t current = next;
    next = u8(bytes, 0);
    if (current == fragmentation) {
      constexpr std::uint16_t offset = 0xFFF8, more = 1;
      const std::uint16_t field = u16(bytes, 2);
      if ((field & offset) != 0) return later_fragment(next);
      fragment = (field & more) != 0;
    }
    bytes = bytes.subspan(header);
  }
  return {Outcome::found, next, fragment, is_cut, bytes, from, to};
}

IpPacket ip(Bytes bytes) {
  if (bytes.empty()) return truncated;
  return u8(bytes, 0) >> 4 == 6 ? ipv6(bytes) : ipv4(bytes);
}

IpPacket ether_type(std::uint16_t type, Bytes bytes) {
  constexpr std::uint16_t customer_tag = 0x8100, service_tag = 0x88A8, old_service_tag = 0x9100;
  while (type == customer_tag || type == service_tag || type == old_service_tag) {
    if (bytes.size() < 4) return truncated;
    type = u16(bytes, 2);
    bytes = bytes.subspan(4);
  }
  if (type == 0x0800) return ipv4(bytes);
  if (type == 0x86DD) return ipv6(bytes);
  return other;
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

IpPacket ip_packet(int link_type, Bytes captured) noexcept {
  const LinkLayer* layer = find(link_type);
  if (layer == nullptr) return other;
  if (captured.size() < layer->header) return truncated;
  const Bytes packet = captured.subspan(layer->header);
  if (layer->type_at < 0) return ip(packet);
  return ether_type(u16(captured, static_cast<std::size_t>(layer->type_at)), packet);
}

}  // namespace imud
