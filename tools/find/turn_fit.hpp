// fit_gravity, TurnFit: which vectors in the frames are specific forces, and which are angular rates.
//
// At rest and in slow turns the specific force is gravity's reaction: its norm is constant, and its direction u,
// in the sensor's axes, turns with du/dt = u x omega. For numbers r of a rate gyro, omega = s P (r - r at rest),
// where P pairs the axes, with signs: the integral over a window, u(t2) - u(t1) = sum of dt u x s P r, is linear
// in the scales s.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/vector.hpp"
#include "tools/find/handled_frames.hpp"
#include "tools/find/vector_places.hpp"

namespace imud {

struct GravityFit {
  double norm = 0;          // at rest, of the mean vector; in units of the numbers
  double sigma = 0;         // relative, of one frame's norm at rest
  double deviation = 0;     // relative, root mean square, of the norm while turned from the norm at rest
  double change = 0;        // relative, of the mean norm while turned from the norm at rest
  double spread_rad = 0;    // root mean square of the direction about its mean, while turned
  std::vector<Vector3> up;  // the direction in each block while turned
};

// Returns nullopt if the vector is no specific force, because its norm is not constant, or its direction does not
// change in the turns; also if there are no frames at rest, or none in turns.
std::optional<GravityFit> fit_gravity(const HandledFrames& frames, const VectorPlace& place);

// Returns, for each component of `one`, the parallel component of `other`, and whether their signs are opposite;
// nullopt if the two vectors have different axes.
std::optional<std::array<std::size_t, 3>> axes_along(const GravityFit& one, const GravityFit& other,
                                                     std::array<bool, 3>& is_negative);

struct TurnFound {
  std::array<std::size_t, 3> axis = {};  // of the specific force, of each component
  std::array<double, 3> scale = {};      // rad per unit and unit of time; its sign is the component's
  std::array<double, 3> sigma = {};      // of `scale`
  std::array<bool, 3> is_observed = {};  // the scale is known within a tenth
  double common = 0;                     // the magnitude of the scale of all components
  double common_sigma = 0;
  double explained = 0;  // the share of the turn, in squares
  std::size_t windows = 0;
  double bias = 0;  // the largest at rest, in rad per unit of time
};

class TurnFit {
 public:
  // Both arguments must outlive this.
  TurnFit(const HandledFrames& frames, const GravityFit& gravity);

  // Returns nullopt if the numbers are no rates in these axes.
  std::optional<TurnFound> fit(const VectorPlace& place) const;
  std::size_t windows() const { return windows_.size(); }

 private:
  struct Window {
    std::size_t first, last;  // blocks
  };
  const HandledFrames& frames_;
  std::span<const Vector3> up_;
  std::vector<Window> windows_;
};

}  // namespace imud
