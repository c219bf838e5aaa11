// Extracts the UDP datagram from a captured packet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "transports/endpoint.hpp"

namespace imud {

struct UdpPacket {
  enum class Outcome : std::uint8_t {
    whole,      // `payload` is the datagram's, all of it; perhaps empty
    truncated,  // a datagram for the port, or one that may be: a fragment, or cut short
    not_ours,   // anything else
  } outcome;
  std::span<const std::byte> payload;
  std::uint16_t port = 0;  // the destination; 0: not known, or not UDP
  Endpoint from = {};      // valid if whole
};

// Returns whether udp_packet() supports the link type, a DLT_ number of libpcap.
bool supports_link_type(int link_type) noexcept;

// Parses a packet: Ethernet (also with VLAN tags), Linux cooked 1 and 2, raw IP, null and loop; IPv4 with options,
// IPv6 with extension headers. `port` is the destination's; 0 accepts any. Any content of `captured` is safe.
UdpPacket udp_packet(int link_type, std::span<const std::byte> captured, std::uint16_t port) noexcept;

}  // namespace imud
