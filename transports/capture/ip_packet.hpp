// Extracts the IP packet from a captured frame, down to the bytes of UDP or TCP in it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "transports/endpoint.hpp"

namespace imud {

struct IpPacket {
  enum class Outcome : std::uint8_t {
    found,      // `payload` begins with the header of UDP or TCP
    truncated,  // UDP or TCP perhaps, but cut short, or the rest of a fragmented datagram
    other,      // anything else
  } outcome;
  std::uint8_t protocol = 0;  // tcp or udp below; valid if found
  bool is_fragment = false;   // `payload` is only the beginning
  bool is_cut = false;        // the same, because the capture has only the beginning of the packet
  std::span<const std::byte> payload = {};
  Endpoint from = {}, to = {};  // without ports

  static constexpr std::uint8_t tcp = 6, udp = 17;
};

// Returns whether ip_packet() supports the link type, a DLT_ number of libpcap.
bool supports_link_type(int link_type) noexcept;

// Parses a frame: Ethernet (also with VLAN tags), Linux cooked 1 and 2, raw IP, null and loop; IPv4 with options,
// IPv6 with extension headers. Any content of `captured` is safe.
IpPacket ip_packet(int link_type, std::span<const std::byte> captured) noexcept;

// The numbers in a header, in network byte order.
inline std::uint8_t network_u8(std::span<const std::byte> bytes, std::size_t at) noexcept {
  return std::to_integer<std::uint8_t>(bytes[at]);
}
inline std::uint16_t network_u16(std::span<const std::byte> bytes, std::size_t at) noexcept {
  return static_cast<std::uint16_t>(network_u8(bytes, at) << 8 | network_u8(bytes, at + 1));
}

}  // namespace imud
