// The International Geomagnetic Reference Field, 14th generation (IAGA Working Group V-MOD, 2024).
#pragma once

#include <vector>

#include "core/earth/magnetic_field.hpp"

namespace imud {

// The prediction of the secular variation, and with it the model, ends at this year.
inline constexpr double igrf14_end = 2030.0;

// Returns the coefficients at a decimal year from 2000 to igrf14_end: linear between the model's epochs, five years
// apart, and after 2025 by the predicted secular variation. Outside of that range they are extrapolated linearly. For
// WGS 84 heights and latitudes; gives the same bits on every machine.
std::vector<GaussCoefficients> igrf14(double year);

}  // namespace imud
