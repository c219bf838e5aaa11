// is_calendar: which quantities are of UTC and of the GPS time.
#pragma once

#include "protocols/measurements/measured_quantities.hpp"

namespace imud {

// Returns true if the quantity, of measured_quantities(), is known where Sample::timed() is.
bool is_calendar(const MeasuredQuantity& quantity) noexcept;

}  // namespace imud
