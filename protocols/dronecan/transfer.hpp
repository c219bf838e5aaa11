// The transfer layer of DroneCAN (UAVCAN v0): a transfer is one message, request or response, in one frame or several
// (DroneCAN specification, "CAN bus transport layer").
//
// Identifier, 29 bits, from the most significant bit on:
//
// | transfer          | bits                                                                                      |
// |-------------------|-------------------------------------------------------------------------------------------|
// | message           | priority 5, data type 16, 0, source 7                                                     |
// | anonymous message | priority 5, discriminator 14, lowest 2 bits of the data type, 0, source 7 = 0             |
// | service           | priority 5, data type 8, request 1, destination 7, 1, source 7                            |
//
// The last byte of every frame is the tail byte: bits for the first frame, the last frame, and the toggle (0 in the
// first frame), and 5 bits of transfer id. In a transfer of several frames, all frames but the last are full, and a
// CRC-16-CCITT-FALSE, little-endian, precedes the payload. The CRC covers the 8 bytes of the data type's signature
// and the payload.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/frame.hpp"
#include "core/time.hpp"
#include "protocols/protocol.hpp"

namespace imud::dronecan {

struct DataType {
  std::uint16_t id;
  bool is_service;
  std::uint64_t signature;
  std::string_view name;
};

inline constexpr unsigned anonymous = 0, highest_node_id = 127;
inline constexpr unsigned lowest_priority = 31;
inline constexpr unsigned transfer_ids = 32;
inline constexpr std::size_t frame_data = 7;  // bytes of a frame before its tail byte
inline constexpr std::size_t longest_transfer = 400;
// A transfer that is not complete this long after its first frame is discarded.
inline constexpr Nanoseconds transfer_timeout = std::chrono::seconds(2);

// Returns the number of frames of a transfer.
constexpr std::size_t frame_count(std::size_t payload) noexcept {
  return payload <= frame_data ? 1 : (payload + 2 + frame_data - 1) / frame_data;
}

// The content of an identifier.
struct Identifier {
  unsigned priority = 0;  // 0: the highest
  unsigned type = 0;      // the data type's id; of an anonymous message, its lowest 2 bits
  unsigned source = anonymous;
  bool is_service = false;
  bool is_request = false;     // of a service; otherwise a response
  unsigned destination = 0;    // of a service
  unsigned discriminator = 0;  // of an anonymous message

  static Identifier parse(std::uint32_t id) noexcept;
  CanHeader header() const noexcept;
  bool is_anonymous() const noexcept { return !is_service && source == anonymous; }
};

// The content of a tail byte.
struct Tail {
  bool is_first, is_last, toggle;
  unsigned transfer_id;

  static Tail parse(std::byte tail) noexcept;
  std::byte byte() const noexcept;
};

// Appends the frames of a transfer to `out`, and returns the number of frames. If there is not enough room for all,
// appends nothing and returns 0.
std::size_t send(const Identifier& identifier, const DataType& type, unsigned transfer_id,
                 std::span<const std::byte> payload, FrameBuffer& out) noexcept;

// Writes the right CRC to `data`, the data of all frames of a transfer, one after another. Returns the bytes behind
// the CRC, without the last tail byte. If `data` is no transfer of several frames, writes nothing and returns an
// empty span.
std::span<std::byte> reseal_transfer(std::span<std::byte> data, const DataType& type) noexcept;

// Assembles transfers of one data type from one node. A frame with the wrong toggle is discarded, because a
// controller may receive a frame twice. If a frame is missing, the CRC or the length is wrong. If the next transfer
// begins before the last frame of a transfer, this transfer is counted as incomplete. A transfer is malformed if its
// frames are not full, or too many.
class Reception {
 public:
  // Processes the data of one frame. Returns true if a transfer is complete. Then payload() is valid until the next
  // call.
  bool feed(std::span<const std::byte> frame, const DataType& type, DecodeErrors& errors) noexcept;
  bool is_active() const noexcept { return is_active_; }  // a transfer has begun
  void clear() noexcept { is_active_ = false; }           // discards an unfinished transfer
  std::span<const std::byte> payload() const noexcept { return std::span(bytes_).first(size_); }

 private:
  bool append(std::span<const std::byte> data) noexcept;

  std::array<std::byte, longest_transfer> bytes_;
  std::size_t size_ = 0;
  unsigned crc_ = 0, transfer_id_ = 0;
  bool is_active_ = false, toggle_ = false;
};

// Assembles the transfers of all nodes. Discards repetitions of a transfer, and transfers that take too long. If
// there are more nodes and data types than slots, the slot that was used least recently is taken over.
class Receiver {
 public:
  // Processes the data of one frame. Returns the payload if a transfer is complete; valid until the next call.
  std::optional<std::span<const std::byte>> feed(const Identifier& identifier, const DataType& type,
                                                 std::span<const std::byte> frame, DeviceTime now) noexcept;
  // See Device::deadline().
  std::optional<DeviceTime> deadline() const noexcept { return deadline_; }
  void poll(DeviceTime now) noexcept;
  void step_clock(Nanoseconds by) noexcept;
  // Discards all transfers, but keeps the counters.
  void clear() noexcept;

  const DecodeErrors& errors() const noexcept { return errors_; }
  std::uint64_t timed_out() const noexcept { return timed_out_; }

 private:
  struct Slot {
    unsigned source = anonymous, type = 0;
    bool is_service = false;
    Reception reception;
    DeviceTime begin;                          // of the transfer that is received
    std::optional<unsigned> last_transfer_id;  // of the transfer that was completed last
    DeviceTime last_time;                      // when it was completed
    std::uint64_t used = 0;                    // number of the last frame received
  };
  // Returns the slot of a node and data type. If there is none, returns a new slot for the first frame of a transfer,
  // otherwise nullptr.
  Slot* slot_of(const Identifier& identifier, bool is_first) noexcept;
  // Computes deadline_. Call this after each change of a reception.
  void find_deadline() noexcept;

  std::array<Slot, 16> slots_;
  std::optional<DeviceTime> deadline_;
  std::uint64_t frames_ = 0;
  DecodeErrors errors_;
  std::uint64_t timed_out_ = 0;
};

}  // namespace imud::dronecan
