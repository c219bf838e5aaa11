// The blocks of a pcapng file (draft-ietf-opsawg-pcapng), which Wireshark opens.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace imud {

// The direction of a packet, as in the option epb_flags.
enum class PacketDirection : std::uint8_t { unknown = 0, inbound = 1, outbound = 2 };

struct PcapngInterface {
  std::uint16_t link_type = 0;  // a LINKTYPE_ number of tcpdump.org
  std::string name;             // if_name
};

struct PcapngPacket {
  std::uint32_t interface = 0;  // the number of its interface in the section
  std::int64_t time_ns = 0;     // since 1970, UTC
  PacketDirection direction = PacketDirection::unknown;
  std::span<const std::byte> bytes;
};

// Append one block each, in the byte order of this machine, which the section header declares. A file is a section
// header, then the interfaces, in the order of their numbers, then the packets. Times have a resolution of 1 ns.
void append_section(std::vector<std::byte>& out, std::string_view application);
void append_interface(std::vector<std::byte>& out, const PcapngInterface& interface);
void append_packet(std::vector<std::byte>& out, const PcapngPacket& packet);

}  // namespace imud
