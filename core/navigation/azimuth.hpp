// The azimuth of a direction as a measurement of an InertialFilter.
#pragma once

#include <optional>

#include "core/navigation/inertial_filter.hpp"
#include "core/navigation/navigation_requests.hpp"
#include "core/vector.hpp"

namespace imud {

// Returns whether a magnetic field, T, has a horizontal part that shows north: near the poles of the field it has
// none.
bool has_azimuth(const Vector3& field_L) noexcept;

// Returns the horizontal unit vector of a given azimuth, rad, clockwise from north.
Vector3 horizontal_at(double azimuth) noexcept;

// Returns the rotation about down, rad from -pi to pi, after which the given direction has the given azimuth; nullopt
// where the direction is within 6 degrees of the vertical, and has none. `q_LP`: the attitude before the rotation,
// v_L = q_LP * v_P.
std::optional<double> turn_to(const GivenHeading& given, const Quaternion& q_LP) noexcept;

// Returns the measurement that a direction, which by the filter's attitude is `estimated_L`, has the azimuth of
// `measured_L`, with a standard deviation of `sigma` rad, above 0. Both are north, east, down, of any length, and not
// vertical; v_L = q_LN * v_N. A tilt about the horizontal part changes the azimuth by the tangent of the direction's
// depression.
InertialFilter::Measurement azimuth_measurement(const Vector3& measured_L, const Vector3& estimated_L,
                                                const Quaternion& q_LN, double sigma) noexcept;

}  // namespace imud
