// The azimuth of a direction as a measurement of an InertialFilter.
#pragma once

#include "core/navigation/inertial_filter.hpp"
#include "core/vector.hpp"

namespace imud {

// Returns whether a magnetic field, T, has a horizontal part that shows north: near the poles of the field it has
// none.
bool has_azimuth(const Vector3& field_L) noexcept;

// Returns the measurement that a direction, which by the filter's attitude is `estimated_L`, has the azimuth of
// `measured_L`, with a standard deviation of `sigma` rad, above 0. Both are north, east, down, of any length, and not
// vertical; v_L = q_LN * v_N. A tilt about the horizontal part changes the azimuth by the tangent of the direction's
// depression.
InertialFilter::Measurement azimuth_measurement(const Vector3& measured_L, const Vector3& estimated_L,
                                                const Quaternion& q_LN, double sigma) noexcept;

}  // namespace imud
