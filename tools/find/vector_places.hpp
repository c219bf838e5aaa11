// find_vectors: where in the frames three numbers may stand that are the components of a vector.
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
  std::array<bool, 3> is_lively = {};  // it changes smoothly while the sensor is turned, and not at rest

  NumberPlace component(std::size_t i) const {
    NumberPlace place = first;
    place.at += i * stride;
    return place;
  }
  std::size_t end() const { return first.at + 2 * stride + first.type.bytes; }
  // Returns true if both have a byte in common.
  bool overlaps(const VectorPlace& other) const;
};

// Returns the vectors in free bytes of which at least two components are lively: no more than 1500. `is_free`: of
// each message, its bytes that have no meaning yet.
std::vector<VectorPlace> find_vectors(const HandledFrames& frames, const std::vector<std::vector<bool>>& is_free);

// Returns how much the lively components change from frame to frame while turned, relative to all their changes:
// least for the reading that has the right bytes.
double roughness(const VectorPlace& place, const HandledFrames& frames);

// Vectors with the same high bytes are one: returns the indices of those to keep. A wider number is taken as long as
// its further bytes are a part of it as far as the frames show: they take all values alike.
std::vector<std::size_t> distinct_vectors(const std::vector<VectorPlace>& all, const HandledFrames& frames);

}  // namespace imud
