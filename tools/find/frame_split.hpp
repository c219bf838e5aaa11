// FrameSplit: divides a stream of bytes into frames of unknown length by what repeats in it.
//
// An anchor is one byte or two that occur in every frame. The distance from an anchor to a later one is the length of
// the frame; where the frames have several lengths, a byte near the anchor (a type or a length) decides which. For
// every anchor, and every such byte, the shortest distance is taken at which most anchors have another one, and the
// stream is divided by it.
//
// Limits: frames of 5 to 1024 bytes, at most 64 lengths; at least 8 frames of a length, and a fiftieth of the most
// frequent frames; text and escapes are not understood.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace imud {

// A division of a stream. The position of a frame is its anchor's: where the frame itself begins is not known yet,
// but the distance from the beginning to the anchor is the same in frames of every length.
struct FrameSplit {
  static constexpr std::size_t shortest_frame = 5, longest_frame = 1024;  // bytes
  static constexpr std::size_t fewest_frames = 8;                         // of a length

  struct Place {
    std::size_t at = 0;    // of the anchor
    bool is_next = false;  // the frame before it in the stream is whole, and ends where this one begins
  };
  struct Kind {
    std::size_t length = 0;
    std::vector<Place> places;  // ascending
  };
  std::vector<Kind> kinds;  // ascending lengths
  double coverage = 0;      // the share of the bytes that are in frames
};

// Returns possible divisions, the most probable first: no more than 24. Takes time in proportion to the bytes; the
// lengths are found in the first 64 KiB.
std::vector<FrameSplit> find_splits(std::span<const std::byte> stream);

}  // namespace imud
