// draft-ietf-opsawg-pcapng-01, sections 3.1, 3.5, 4.1, 4.2 and 4.3.
#include "transports/capture/pcapng_writer.hpp"

#include <algorithm>
#include <cstring>

namespace imud {
namespace {

using ByteVector = std::vector<std::byte>;

template <class T>
void append(ByteVector& out, T value) {
  const std::size_t at = out.size();
  out.resize(at + sizeof value);
  std::memcpy(out.data() + at, &value, sizeof value);
}

void append_padded(ByteVector& out, std::span<const std::byte> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
  out.resize((out.size() + 3) / 4 * 4);  // blocks begin at multiples of 4, and so does `out`
}

void append_option(ByteVector& out, std::uint16_t code, std::span<const std::byte> value) {
  constexpr std::size_t longest = 65'535;
  value = value.first(std::min(value.size(), longest));
  append(out, code);
  append(out, static_cast<std::uint16_t>(value.size()));
  append_padded(out, value);
}

void append_option(ByteVector& out, std::uint16_t code, std::string_view text) {
  append_option(out, code, std::as_bytes(std::span(text.data(), text.size())));
}

// A block with the content that `fill` appends.
template <class Fill>
void append_block(ByteVector& out, std::uint32_t type, Fill fill) {
  const std::size_t begin = out.size();
  append(out, type);
  append(out, std::uint32_t{0});
  fill();
  const auto length = static_cast<std::uint32_t>(out.size() - begin + sizeof(std::uint32_t));
  append(out, length);
  std::memcpy(out.data() + begin + sizeof type, &length, sizeof length);
}

constexpr std::uint16_t end_of_options = 0;

}  // namespace

void append_section(ByteVector& out, std::string_view application) {
  append_block(out, 0x0A0D0D0A, [&] {
    append(out, std::uint32_t{0x1A2B3C4D});
    append(out, std::uint16_t{1});
    append(out, std::uint16_t{0});
    append(out, std::int64_t{-1});  // the length of the section is not known
    constexpr std::uint16_t shb_userappl = 4;
    append_option(out, shb_userappl, application);
    append_option(out, end_of_options, std::string_view());
  });
}

void append_interface(ByteVector& out, const PcapngInterface& interface) {
  append_block(out, 1, [&] {
    append(out, interface.link_type);
    append(out, std::uint16_t{0});
    append(out, std::uint32_t{0});  // packets are never cut short
    constexpr std::uint16_t if_name = 2, if_tsresol = 9;
    constexpr std::byte nanoseconds[] = {std::byte{9}};
    append_option(out, if_name, interface.name);
    append_option(out, if_tsresol, nanoseconds);
    append_option(out, end_of_options, std::string_view());
  });
}

void append_packet(ByteVector& out, const PcapngPacket& packet) {
  append_block(out, 6, [&] {
    const auto time = static_cast<std::uint64_t>(packet.time_ns);
    const auto size = static_cast<std::uint32_t>(packet.bytes.size());
    append(out, packet.interface);
    append(out, static_cast<std::uint32_t>(time >> 32));
    append(out, static_cast<std::uint32_t>(time));
    append(out, size);
    append(out, size);
    append_padded(out, packet.bytes);
    if (packet.direction == PacketDirection::unknown) return;
    constexpr std::uint16_t epb_flags = 2;
    const auto flags = static_cast<std::uint32_t>(packet.direction);
    append_option(out, epb_flags, std::as_bytes(std::span(&flags, 1)));
    append_option(out, end_of_options, std::string_view());
  });
}

}  // namespace imud
