// SignalSource: the source that a configuration assigns to a CAN signal:
//
// | text                      | the signal has                                                              |
// |---------------------------|-----------------------------------------------------------------------------|
// | rate_z_deg_per_s          | the quantity; with a minus before it, of the other sign                     |
// | abs(rate_z_deg_per_s)     | its magnitude, for a message with a sign of its own                         |
// | sign(rate_z_deg_per_s)    | 1 if it is negative, otherwise 0                                            |
// | yaw_deg%360, utc_year%100 | the remainder, from 0 to below the modulus, which a rounded value never has |
// | 1, -2.5                   | a constant, in the signal's unit                                            |
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "protocols/measurements/measured_quantities.hpp"

namespace imud {

struct SignalSource {
  enum class Form : std::uint8_t { plain, magnitude, sign, remainder, constant };
  Form form = Form::plain;
  MeasuredIn in = {};   // for all forms but constant
  double modulus = 0;   // of a remainder; positive, in the unit of `in`
  double constant = 0;  // in the signal's unit
};

// Parses one of the texts above. Returns nullopt for any other text, or if a form is applied to a clock, a counter
// or a status.
std::optional<SignalSource> parse_signal_source(std::string_view text) noexcept;

inline constexpr std::string_view signal_source_syntax =
    "give a quantity, abs(QUANTITY), sign(QUANTITY), QUANTITY%MODULUS or a number";

}  // namespace imud
