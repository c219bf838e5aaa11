// Frame: one transmission unit, serial bytes or a CAN identifier with data.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace imud {

// CAN side of a Frame; unused on byte links.
struct CanHeader {
  std::uint32_t id = 0;  // 11 bits, or 29 if `extended`
  bool extended = false;
  bool fd = false;  // CAN FD frame: 0..8, 12, 16, 20, 24, 32, 48 or 64 data bytes
  bool bit_rate_switch = false;
  bool remote = false;  // remote request (classic only)
  bool error = false;   // error frame reported by the controller
  constexpr bool operator==(const CanHeader&) const = default;
};

// A view: the bytes belong to whoever made the frame (a FrameBuffer, a Port) and stay until its next use.
struct Frame {
  std::span<const std::byte> bytes;
  CanHeader can = {};
};

// The frames of one sample, or of one answer, in order, with their bytes. Made once, cleared and refilled.
class FrameBuffer {
 public:
  static constexpr std::size_t max_frames = 64;
  static constexpr std::size_t max_bytes = 16384;

  void clear() noexcept {
    count_ = 0;
    used_ = 0;
  }

  // Room for one frame of at most `size` bytes, to be completed by push(). Empty if there is no room, which a
  // Device that stays within the limits above never sees.
  std::span<std::byte> room(std::size_t size) noexcept {
    if (count_ == max_frames || size > max_bytes - used_) return {};
    return {bytes_.data() + used_, size};
  }

  // Completes the frame begun by room(): its first `size` bytes.
  void push(std::size_t size, CanHeader can = {}) noexcept {
    frames_[count_++] = Frame{{bytes_.data() + used_, size}, can};
    used_ += size;
  }

  std::span<const Frame> frames() const noexcept { return {frames_.data(), count_}; }

 private:
  std::array<Frame, max_frames> frames_;
  std::array<std::byte, max_bytes> bytes_;
  std::size_t count_ = 0;
  std::size_t used_ = 0;
};

}  // namespace imud
