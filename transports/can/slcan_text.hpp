// The text of CAN adapters on a serial line: a line for each frame, which ends with a carriage return.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/frame.hpp"

namespace imud {

// The longest line of a frame, bytes: kind, 8 digits of the identifier, length code, 64 data bytes, carriage return.
constexpr std::size_t max_slcan_line = 1 + 8 + 1 + 128 + 1;

// Writes the line of a frame. Returns the length of the line, bytes; 0 if a CAN bus cannot carry the frame.
std::size_t write_slcan(const Frame& frame, std::span<char, max_slcan_line> line) noexcept;

// Parses the bytes that an adapter sends. Any input is safe. Used by one thread.
class SlcanReader {
 public:
  enum class Result : std::uint8_t {
    nothing,    // the line is not complete, or it acknowledges or answers a command
    frame,      // frame() returns the frame in the line
    refusal,    // the adapter has refused a command or a frame (BEL)
    malformed,  // the line has no valid form
  };
  Result feed(char byte) noexcept;

  // The frame of the last line; valid until the next byte.
  Frame frame() const noexcept { return {std::span(data_).first(size_), header_}; }

 private:
  Result read_line(std::string_view line) noexcept;
  bool read_frame(std::string_view line) noexcept;

  static constexpr std::size_t longest = max_slcan_line + 8;  // with a time stamp
  std::array<char, longest> line_{};
  std::size_t length_ = 0;  // of the line so far; more than `longest` if it is too long
  CanHeader header_;
  std::size_t size_ = 0;
  std::array<std::byte, 64> data_{};
};

}  // namespace imud
