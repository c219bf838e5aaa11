// choose_begin: decides where the frames of a split begin.
//
// A split has the length of each frame and an anchor in it, but not the place where the frame begins. The last bytes
// of a frame that can be known are a check, or bytes that a check covers. Constant bytes follow, up to the next byte
// that varies. The first of the constant bytes may belong to the end of that frame; the others are the header of the
// next one.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "tools/checks/check_search.hpp"
#include "tools/find/frame_split.hpp"

namespace imud {

// The greatest number of constant bytes at the beginning of a frame that are taken for its header.
inline constexpr std::size_t longest_header = 4;

// A split with its checks, by windows that begin `before` bytes before the anchors.
struct Trial {
  FrameSplit split;
  std::size_t before = 0;
  std::vector<CheckSearch> searches;            // of each kind
  std::vector<std::vector<FoundCheck>> checks;  // of each kind, by places in its windows
  std::size_t begin = 0;                        // of the frames, in the windows
  std::vector<std::ptrdiff_t> other_begins;     // as good, or nearly: bytes later
  double checked = 0;                           // the share of the frames' bytes with a check of all

  // If all frames have one length, a check that begins after the end of a frame is also in the previous frame.
  bool is_cyclic() const { return split.kinds.size() == 1; }
};

// Sets `begin` and `other_begins` by the places of the checks, by constant bytes, and by the first byte of the
// stream.
void choose_begin(Trial& trial, std::span<const std::byte> stream);

// Returns the check with its places in the frame that begins at `trial.begin`, without forms that begin before the
// frame; nullopt if it is not in the frame.
std::optional<FoundCheck> in_frame(const Trial& trial, std::size_t kind, FoundCheck check);

// Returns true for a byte that could be the high byte of a number that hardly changes: of an integer near 0, or of a
// float from 0.001 to 100.
bool is_high_byte(std::byte byte) noexcept;

}  // namespace imud
