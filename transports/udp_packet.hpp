// The UDP datagram in a captured packet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace imud {

struct UdpPacket {
  enum class Outcome : std::uint8_t {
    whole,      // `payload` is the datagram's, all of it; perhaps empty
    truncated,  // a datagram for the port, or one that may be: a fragment, or cut short
    not_ours,   // anything else
  } outcome;
  std::span<const std::byte> payload;
};

// Whether udp_packet() knows the link type, a DLT_ number of libpcap.
bool knows_link_type(int link_type) noexcept;

// Takes a packet apart: Ethernet (also with VLAN tags), Linux cooked 1 and 2, raw IP, null and loop; IPv4 with
// options, IPv6 with extension headers. `port` is the destination's; 0 takes any. Any bytes are harmless.
UdpPacket udp_packet(int link_type, std::span<const std::byte> captured, std::uint16_t port) noexcept;

}  // namespace imud
