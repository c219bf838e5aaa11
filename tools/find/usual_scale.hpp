// scale_of: the figures that manuals give for the LSB of a number, near a measured one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/frames/layout/frame_number.hpp"

namespace imud {

enum class VectorQuantity : std::uint8_t { specific_force, rate, delta_velocity, delta_angle };

// Returns the name of the quantity in descriptions of frames: "specific_force".
std::string_view quantity_name(VectorQuantity quantity);

struct UsualScale {
  std::string unit;  // of a name: "deg_per_s"
  std::string lsb;   // in the syntax of a description: "0.01", "2000/32768", "2^-16"; "1" is left out there
  double value = 1;  // of the LSB, in the unit
  double si = 1;     // of the LSB
};

// The scale of a vector, and its evidence.
struct VectorScale {
  UsualScale taken;  // the nearest usual figure within the tolerance, or the measured scale
  bool is_usual = false;
  std::vector<UsualScale> others;  // as good
  double measured = 0;             // SI of the LSB
  double tolerance = 0;            // relative
  double by_chance = 0;            // mean number of usual figures that are equally near by chance
};

// Returns the scale of numbers whose LSB is `si` within a relative tolerance. Floats have whole units; integers
// have decimals, powers of two and, with two bytes, ranges over 32768. Where usual figures are too dense, none is
// taken.
VectorScale scale_of(VectorQuantity quantity, const FrameNumber& type, double si, double tolerance);
// Returns the scale for people: "LSB 0.0010002 g +- 0.4 %, taken as 0.001 g ...".
std::string scale_text(VectorQuantity quantity, const VectorScale& scale);

}  // namespace imud
