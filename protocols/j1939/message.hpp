// J1939's protocol data units (SAE J1939-21) on raw CAN: identifiers, parameter group numbers, frames of 8 bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/frame.hpp"
#include "protocols/wire/wire.hpp"

namespace imud::j1939 {

// Special addresses; nodes have addresses 0 to 253.
inline constexpr std::uint8_t null_address = 254;  // the source of a node without an address
inline constexpr std::uint8_t everyone = 255;      // the global destination

// Parameter group numbers.
namespace pgn {
inline constexpr std::uint32_t memory_response = 0xD800;  // DM15
inline constexpr std::uint32_t memory_request = 0xD900;   // DM14
inline constexpr std::uint32_t stop_start = 0xDF00;       // DM13
inline constexpr std::uint32_t acknowledgement = 0xE800;
inline constexpr std::uint32_t request = 0xEA00;
inline constexpr std::uint32_t transfer_data = 0xEB00;     // TP.DT
inline constexpr std::uint32_t transfer_control = 0xEC00;  // TP.CM
inline constexpr std::uint32_t address_claimed = 0xEE00;
inline constexpr std::uint32_t slope = 0xF013;         // SSI
inline constexpr std::uint32_t slope_2 = 0xF029;       // SSI2
inline constexpr std::uint32_t angular_rate = 0xF02A;  // ARI
inline constexpr std::uint32_t acceleration = 0xF02D;  // ACCS
inline constexpr std::uint32_t ecu_identification = 0xFDC5;
inline constexpr std::uint32_t commanded_address = 0xFED8;
inline constexpr std::uint32_t software_identification = 0xFEDA;
inline constexpr std::uint32_t vehicle_position = 0xFEF3;
inline constexpr std::uint32_t proprietary_b = 0xFF00;  // + the group extension
}  // namespace pgn

inline constexpr unsigned control_priority = 6;  // of all messages but sensor data and transfers
inline constexpr unsigned transfer_priority = 7;

// The header of a message: the parts of its identifier of 29 bits.
struct Header {
  unsigned priority = control_priority;
  std::uint32_t pgn = 0;  // 18 bits; its low byte is 0 if the message has a destination (PDU1)
  std::uint8_t destination = everyone;
  std::uint8_t source = null_address;

  // Returns true if messages with this parameter group number have a destination.
  static constexpr bool has_destination(std::uint32_t pgn) noexcept { return (pgn >> 8 & 0xFFU) < 240; }

  constexpr std::uint32_t id() const noexcept {
    return priority << 26 | pgn << 8 | (has_destination(pgn) ? std::uint32_t{destination} << 8 : 0U) | source;
  }
  constexpr CanHeader can() const noexcept { return {.id = id(), .extended = true}; }

  // Reads an identifier of 29 bits.
  static constexpr Header parse(std::uint32_t id) noexcept {
    Header header{id >> 26 & 7U, id >> 8 & 0x3FFFFU, everyone, static_cast<std::uint8_t>(id)};
    if (!has_destination(header.pgn)) return header;
    header.destination = static_cast<std::uint8_t>(header.pgn);
    header.pgn &= 0x3FF00U;
    return header;
  }
};

using Data = std::span<const std::byte>;

// A received message, of 8 bytes at most.
struct Message {
  Header header;
  Data data;

  // Returns byte `i`; 0xFF, which stands for "not available", if the message is shorter.
  std::uint8_t operator[](std::size_t i) const noexcept {
    return i < data.size() ? std::to_integer<std::uint8_t>(data[i]) : std::uint8_t{0xFF};
  }
  // Returns the number of three bytes, little-endian, that begins at byte `i`.
  std::uint32_t number_at(std::size_t i) const noexcept {
    return (*this)[i] | std::uint32_t{(*this)[i + 1]} << 8 | std::uint32_t{(*this)[i + 2]} << 16;
  }
  // Returns nullopt if the frame is not J1939: a frame with an 11-bit identifier, a remote request, an error frame,
  // or CAN FD.
  static std::optional<Message> parse(const Frame& frame) noexcept {
    const CanHeader& can = frame.can;
    if (!can.extended || can.remote || can.error || can.fd || frame.bytes.size() > 8) return std::nullopt;
    return Message{Header::parse(can.id), frame.bytes};
  }
};

// Returns the eight bytes of a frame; `word`: these bytes as one little-endian number.
inline std::array<std::byte, 8> bytes_of(std::uint64_t word) noexcept {
  std::array<std::byte, 8> bytes;
  write_little(word, bytes);
  return bytes;
}

// Appends a frame of at most 8 bytes to `out`.
inline void send(const Header& header, Data data, FrameBuffer& out) noexcept { out.append(data, header.can()); }
// Appends a frame of 8 bytes.
inline void send(const Header& header, std::uint64_t word, FrameBuffer& out) noexcept {
  send(header, bytes_of(word), out);
}

}  // namespace imud::j1939
