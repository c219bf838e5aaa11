// Extracts the UDP datagram from a captured packet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "transports/capture/ip_packet.hpp"
#include "transports/endpoint.hpp"

namespace imud {

struct UdpPacket {
  enum class Outcome : std::uint8_t {
    whole,      // `payload` is the whole payload of the datagram; perhaps empty
    truncated,  // a fragment or a cut datagram that is, or may be, for the port
    not_ours,   // anything else
  } outcome;
  std::span<const std::byte> payload;
  std::uint16_t port = 0;  // the destination; 0: not known, or not UDP
  Endpoint from = {};      // valid if whole
};

// Returns the datagram in a packet. Accepts only datagrams whose destination is `port`; 0 accepts any port. Any
// content is safe.
UdpPacket udp_packet(const IpPacket& ip, std::uint16_t port) noexcept;
inline UdpPacket udp_packet(int link_type, std::span<const std::byte> captured, std::uint16_t port) noexcept {
  return udp_packet(ip_packet(link_type, captured), port);
}

}  // namespace imud
