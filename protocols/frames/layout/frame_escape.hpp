// FrameEscape: framing by a mark byte. The content of a frame cannot contain the mark: escapes replace it.
//
// | name | on the line                                                                                              |
// |------|----------------------------------------------------------------------------------------------------------|
// | slip | C0 content C0; C0 is sent as DB DC, DB as DB DD (RFC 1055, with the mark at both ends)                   |
// | hdlc | 7E content 7E; 7E is sent as 7D 5E, 7D as 7D 5D (octet stuffing of RFC 1662)                             |
// | dle  | 10 content 10 03; 10 is sent as 10 10 (Trimble TSIP)                                                     |
// | cobs | content without 00, by consistent overhead byte stuffing, then 00 (Cheshire and Baker, 1999)             |
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/frames/layout/frame_description.hpp"

namespace imud {

// The names, in the order of the enumeration.
inline constexpr std::string_view escape_names[] = {"none", "slip", "hdlc", "dle", "cobs"};
constexpr std::string_view escape_name(FrameEscape escape) noexcept {
  return escape_names[static_cast<std::size_t>(escape)];
}

// Returns the bytes of the longest frame whose content has `size` bytes.
constexpr std::size_t longest_escaped(FrameEscape escape, std::size_t size) noexcept {
  switch (escape) {
    case FrameEscape::none:
      return size;
    case FrameEscape::cobs:
      return size + size / 254 + 2;
    default:
      return 2 * size + 3;
  }
}

// Writes the frame of `content` to `out`, of longest_escaped() bytes. Returns the size of the frame. Requires that
// `content` and `out` do not overlap.
std::size_t escape_frame(FrameEscape escape, std::span<const std::byte> content, std::span<std::byte> out) noexcept;

// Finds the frames of a stream, and removes the escapes from them. Allocates nothing. One thread.
class EscapeReader {
 public:
  explicit EscapeReader(FrameEscape escape) : escape_(escape) {}

  // Takes the next byte. Returns true if a frame ends with this byte; content() then has the frame's 1 to
  // FrameDescription::longest_frame bytes, and is valid until the next call.
  bool take(std::byte byte) noexcept;
  std::span<const std::byte> content() const noexcept { return std::span(held_).first(size_); }
  // Returns how many bytes the frame of content() has on the line. A mark that has ended the frame before does not
  // count.
  std::uint64_t frame_bytes() const noexcept { return frame_bytes_; }
  // Returns how many bytes since the last call belonged to no frame: damaged escapes, frames that are too long.
  std::uint64_t take_skipped() noexcept;
  // Ends the input: an unfinished frame counts as skipped.
  void finish() noexcept;

 private:
  bool end() noexcept;
  void put(std::byte byte) noexcept;
  void fail() noexcept;
  bool take_cobs(unsigned byte) noexcept;
  bool take_dle(unsigned byte) noexcept;
  bool take_marked(unsigned byte) noexcept;

  FrameEscape escape_;
  std::array<std::byte, FrameDescription::longest_frame> held_{};
  std::size_t size_ = 0;
  std::uint64_t bytes_ = 0;        // on the line, of the frame that is read
  std::uint64_t frame_bytes_ = 0;  // of the frame that was read
  std::uint64_t skipped_ = 0;
  bool is_open_ = false;           // a frame has begun
  bool is_ended_ = false;          // content() was returned
  bool is_escaped_ = false;        // the last byte was an escape
  bool is_skipping_ = false;       // COBS: skips the rest of a frame that is too long
  unsigned block_ = 0, left_ = 0;  // COBS: the code of the block, and how many of its bytes are missing
};

}  // namespace imud
