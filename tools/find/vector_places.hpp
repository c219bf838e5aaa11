// find_vectors: finds places in the frames where three numbers may be the components of a vector.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "tools/find/handled_frames.hpp"

namespace imud {

// Three numbers of one type at equal distances.
struct VectorPlace {
  NumberPlace first;
  std::size_t stride = 0;              // bytes
  std::array<bool, 3> is_lively = {};  // the component changes smoothly while the sensor is turned, and not at rest

  NumberPlace component(std::size_t i) const {
    NumberPlace place = first;
    place.at += i * stride;
    return place;
  }
  std::size_t end() const { return first.at + 2 * stride + first.type.bytes; }
  // Returns true if both have a byte in common.
  bool overlaps(const VectorPlace& other) const;
};

// Returns at most 1500 vectors that lie in free bytes and have at least two lively components. `is_free` has a flag
// for each byte of each message: true if the byte has no meaning yet.
std::vector<VectorPlace> find_vectors(const HandledFrames& frames, const std::vector<std::vector<bool>>& is_free);

// Returns the sum over the lively components of their typical change from frame to frame, in standard deviations of
// the component, while the sensor is turned. Of several ways to read the same bytes, the right one has the smallest
// roughness.
double roughness(const VectorPlace& place, const HandledFrames& frames);

// Vectors with the same high bytes count as one vector: returns the indices of the vectors to keep. A wider number
// is preferred if its further bytes take all values equally often, and thus seem to be a part of the number.
std::vector<std::size_t> distinct_vectors(const std::vector<VectorPlace>& all, const HandledFrames& frames);

}  // namespace imud
