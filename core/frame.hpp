// Frame: one transmission unit, which is serial bytes or a CAN identifier with data.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace imud {

// The header of a CAN frame; unused on byte links.
struct CanHeader {
  std::uint32_t id = 0;  // 11 bits, or 29 if `extended`
  bool extended = false;
  bool fd = false;  // a CAN FD frame, of 0..8, 12, 16, 20, 24, 32, 48 or 64 data bytes
  bool bit_rate_switch = false;
  bool remote = false;  // a remote request (classic only)
  bool error = false;   // an error frame that the controller reports
  constexpr bool operator==(const CanHeader&) const = default;
};

// Passes the CAN frames whose identifier equals `id` in the bits set in `mask`.
struct CanFilter {
  std::uint32_t id = 0;
  std::uint32_t mask = 0x1FFF'FFFF;
  bool extended = false;  // identifiers of 29 bits; otherwise of 11
  bool data = true;       // passes data frames
  bool remote = false;    // passes remote requests
  bool inverted = false;  // passes every frame, of either length of identifier, that it would not pass otherwise
};

// A view. The FrameBuffer or the Port that made it owns the bytes and keeps them until its next use.
struct Frame {
  std::span<const std::byte> bytes;
  CanHeader can = {};
  std::uint8_t uart = 0;  // of a product with two UARTs: 0 for the one at the port, 1 for the one at the second port
};

// The frames of one sample or of one answer, in order, with their bytes. Make it once, then clear and refill it. It
// does not allocate. Not thread-safe.
class FrameBuffer {
 public:
  static constexpr std::size_t max_frames = 64;
  static constexpr std::size_t max_bytes = 16384;

  // Discards all frames; views of them become invalid.
  void clear() noexcept {
    count_ = 0;
    used_ = 0;
  }

  // Returns memory for one frame of at most `size` bytes, which push() completes, or an empty span if there is not
  // enough. A Device that stays within the limits above always has room.
  std::span<std::byte> room(std::size_t size) noexcept {
    if (count_ == max_frames || size > max_bytes - used_) return {};
    return {bytes_.data() + used_, size};
  }

  // Adds a frame of the first `size` bytes of the last room(), which must be at least as large.
  void push(std::size_t size, CanHeader can = {}, std::uint8_t uart = 0) noexcept {
    frames_[count_++] = Frame{{bytes_.data() + used_, size}, can, uart};
    used_ += size;
  }
  // Adds a frame with these bytes, or none if there is no room.
  void append(std::span<const std::byte> bytes, CanHeader can = {}, std::uint8_t uart = 0) noexcept {
    const std::span<std::byte> free = room(bytes.size());
    if (free.size() < bytes.size() || count_ == max_frames) return;
    std::copy(bytes.begin(), bytes.end(), free.begin());
    push(bytes.size(), can, uart);
  }
  // Adds the bytes of the last frame once more, for another UART. Does nothing if there is no frame, or no room.
  void repeat(std::uint8_t uart) noexcept {
    if (count_ == 0 || count_ == max_frames) return;
    frames_[count_] = Frame{frames_[count_ - 1].bytes, {}, uart};
    ++count_;
  }

  // Returns the frames, valid until the next change of the buffer.
  std::span<const Frame> frames() const noexcept { return {frames_.data(), count_}; }

 private:
  std::array<Frame, max_frames> frames_;
  std::array<std::byte, max_bytes> bytes_;
  std::size_t count_ = 0;
  std::size_t used_ = 0;
};

}  // namespace imud
