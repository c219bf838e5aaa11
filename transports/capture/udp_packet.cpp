// RFC 768.
#include "transports/capture/udp_packet.hpp"

namespace imud {

UdpPacket udp_packet(const IpPacket& ip, std::uint16_t port) noexcept {
  using Outcome = UdpPacket::Outcome;
  const UdpPacket truncated{Outcome::truncated, {}, 0, {}};
  if (ip.outcome == IpPacket::Outcome::truncated) return truncated;
  if (ip.outcome != IpPacket::Outcome::found || ip.protocol != IpPacket::udp) return {Outcome::not_ours, {}, 0, {}};
  constexpr std::size_t header = 8;
  const auto bytes = ip.payload;
  if (bytes.size() < header) return truncated;
  const std::uint16_t destination = network_u16(bytes, 2);
  if (port != 0 && destination != port) return {Outcome::not_ours, {}, destination, {}};
  const std::size_t length = network_u16(bytes, 4);
  if (ip.is_fragment || length < header || length > bytes.size()) return truncated;
  UdpPacket packet{Outcome::whole, bytes.subspan(header, length - header), destination, ip.from};
  packet.from.port = network_u16(bytes, 0);
  return packet;
}

}  // namespace imud
