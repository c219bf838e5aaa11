// The single terms of an Allan deviation, for fits and model curves.
#pragma once

#include <array>
#include <cstddef>

#include "core/allan_terms.hpp"
#include "tools/allan/allan_deviation.hpp"

namespace imud {

// The terms in the order in which they dominate as the averaging time grows.
struct AllanTerm {
  char letter;
  double AllanTerms::*value;
};
inline constexpr auto allan_term_list = std::to_array<AllanTerm>({{'Q', &AllanTerms::Q},
                                                                  {'N', &AllanTerms::N},
                                                                  {'B', &AllanTerms::B},
                                                                  {'K', &AllanTerms::K},
                                                                  {'R', &AllanTerms::R}});
static_assert(allan_term_list.size() * sizeof(double) == sizeof(AllanTerms), "a term is missing");
inline constexpr std::size_t allan_term_count = allan_term_list.size();

// One averaging time of a recording.
struct AveragingTime {
  std::size_t factor = 1;    // in samples
  double tau_s = 0;          // in s
  double record_length = 0;  // of the recording, s; affects only the total deviation
};

// Returns the variance that each term with a coefficient of 1 contributes to the expected square of the deviation, in
// the order of allan_term_list. For the Allan deviation this is 3/tau^2, 1/tau, 2 ln(2)/pi, tau/3, tau^2/2.
std::array<double, allan_term_count> unit_variances(AllanKind kind, const AveragingTime& time) noexcept;

// Returns the expected deviation of all terms together, in u. The flicker is flat from `flicker_from_s` on, and
// lower at shorter averaging times, see flicker_share(); 0: the flicker is flat at all averaging times.
double expected_deviation(AllanKind kind, const AllanTerms& terms, const AveragingTime& time,
                          double flicker_from_s = 0) noexcept;

}  // namespace imud
