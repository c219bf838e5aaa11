// The draws of the constant errors: once for a unit, and again at each power on.
#pragma once

#include <cstdint>
#include <span>

#include "core/effects/triad_errors.hpp"
#include "core/numbers/random.hpp"

namespace imud {

// The number of the draw of drawn_current_field(), which no member of ConstantErrors may have (drawn_errors.cpp).
constexpr std::uint64_t current_field_draw = 25;

// These two return the drawn errors of one layer. Each element is sigma n, n ~ N(0, 1); a Cause may determine a part
// of it. The two layers are independent. Nothing here allocates or throws.
ConstantErrors drawn_for_unit(const TriadErrors& errors, Quantity quantity, const Normals& normals,
                              std::span<const Cause> causes = {}) noexcept;
// `number` counts the power ons from 0. The bias returned is only the part of TriadErrors::turn_on_bias that causes
// determine; TurnOnBias draws the rest.
ConstantErrors drawn_at_power_on(const TriadErrors& errors, Quantity quantity, const Normals& normals,
                                 std::uint64_t number, std::span<const Cause> causes = {}) noexcept;

// Returns the errors of a unit after a power on: `errors`, and the draws for the unit and for this power on.
// `turn_on_bias` of the result is the standard deviation of the part that TurnOnBias draws; the part of the causes is
// drawn, and is in the bias.
TriadErrors drawn_errors(const TriadErrors& errors, Quantity quantity, const Normals& of_unit,
                         const Normals& of_power_on, std::uint64_t number,
                         std::span<const Cause> causes = {}) noexcept;

}  // namespace imud
