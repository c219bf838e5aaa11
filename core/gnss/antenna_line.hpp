// AntennaLine: the line from the main antenna of a receiver to its second one, as the receiver measures it.
#pragma once

#include <cstdint>

#include "core/attitude.hpp"
#include "core/numbers/random.hpp"
#include "core/sample.hpp"

namespace imud {

// Returns the line of two antennas along the platform's x axis, at sample `k`. `q_LP`: the true attitude, v_L = q_LP
// * v_P. `sigma`: the standard deviation of the azimuth, rad, above 0. Errors are white, and of the azimuth alone:
// the pitch of the line is the true one. Unlike a place, a line is not late: a unit corrects for its time.
inline AntennaLine measured_line(const Quaternion& q_LP, double sigma, const Normals& normals,
                                 std::uint64_t k) noexcept {
  const double error = sigma * normals(Quantity::attitude, Process::white_noise, k).z();
  return {.direction_L = exp(Vector3(0, 0, error)) * (q_LP * Vector3::UnitX()), .sigma = sigma};
}

}  // namespace imud
