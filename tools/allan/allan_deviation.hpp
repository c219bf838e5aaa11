// allan_deviations: the Allan deviation of equally spaced rates, and its relatives (Riley, Handbook of Frequency
// Stability Analysis, NIST Special Publication 1065, section 5.2).
//
// A rate is an average over one step. Rates are read as SP1065's fractional frequencies, their integral as its phase.
// A deviation is in the unit of the rates. Every function is pure and may run in any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "tools/allan/sample_store.hpp"

namespace imud {

enum class AllanKind : std::uint8_t {
  allan,        // of adjacent averages
  overlapping,  // the same from every sample on, which uses the data best
  modified,     // of averages over the averaging time; separates quantisation from other noise of short times
  hadamard,     // of second differences: a constant ramp does not count
  overlapping_hadamard,  // the same from every sample on
  total,                 // the data are continued by reflection at both ends: a longer averaging time
};

inline constexpr AllanKind allan_kinds[] = {AllanKind::allan,    AllanKind::overlapping,          AllanKind::modified,
                                            AllanKind::hadamard, AllanKind::overlapping_hadamard, AllanKind::total};

constexpr bool is_hadamard(AllanKind kind) noexcept {
  return kind == AllanKind::hadamard || kind == AllanKind::overlapping_hadamard;
}
// Returns the order of the differences of the phase.
constexpr std::size_t order_of(AllanKind kind) noexcept { return is_hadamard(kind) ? 3 : 2; }

// Returns the name on command lines and in files: "allan", "overlapping", "modified", "hadamard",
// "overlapping-hadamard", "total".
std::string_view name_of(AllanKind kind) noexcept;

// Returns the sum of the rates up to each sample, after subtraction of their mean from each rate. The result has
// one element more than the rates; the first element is 0. The mean has no effect on any deviation; without the
// mean, and with compensated summation, each element is exact to a few of its own ulps, whatever the number of
// rates. Empty if there is no rate. Computed in place: overwrites the rates.
SampleStore phase_of(SampleStore rates);

// Returns the largest averaging factor for which so many points of phase have a deviation; 0: there is none.
std::size_t largest_factor(AllanKind kind, std::size_t points) noexcept;

// Returns the number of squared differences whose mean gives the deviation.
std::size_t difference_count(AllanKind kind, std::size_t points, std::size_t factor) noexcept;

// Returns, for each factor, the deviation over an averaging time of so many samples, in the unit of the rates; 0 for
// a factor that is not from 1 to largest_factor(kind, phase.size()). The time it takes does not depend on the
// factors. Reads the phase once, in pieces that fit the processor's cache. `resident`: see SampleStore::pages().
std::vector<double> allan_deviations(AllanKind kind, std::span<const double> phase,
                                     std::span<const std::size_t> factors, const ResidentPages& resident = {});

// Returns the averaging factors from 1 to `largest`: the powers of 2 if `per_decade` is 0, otherwise so many per
// decade, rounded, each once.
std::vector<std::size_t> averaging_factors(std::size_t largest, unsigned per_decade);

}  // namespace imud
