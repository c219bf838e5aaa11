// The vectors of a measurement.
#pragma once

#include "protocols/protocol.hpp"

namespace imud {

struct MeasuredVector {
  Measurement::Field field;
  Vector3 Sample::*values;
};

// In the order of their columns in a CSV and of their bits in ReadBack::components.
inline constexpr MeasuredVector measured_vectors[] = {{Measurement::rate, &Sample::rate},
                                                      {Measurement::specific_force, &Sample::specific_force},
                                                      {Measurement::delta_angle, &Sample::delta_angle},
                                                      {Measurement::delta_velocity, &Sample::delta_velocity}};

}  // namespace imud
