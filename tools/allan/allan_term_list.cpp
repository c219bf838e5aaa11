#include "tools/allan/allan_term_list.hpp"

#include <cmath>
#include <numbers>

#include "tools/allan/flicker_band.hpp"

namespace imud {

std::array<double, allan_term_count> unit_variances(AllanKind kind, const AveragingTime& time) noexcept {
  static_assert(allan_term_count == 5, "give each variance of the new term");
  using std::numbers::ln2;
  using std::numbers::pi;
  const double tau = time.tau_s;
  const auto m = static_cast<double>(time.factor);
  const double share = time.record_length > 0 ? tau / time.record_length : 0;
  const double Q = 3 / (tau * tau), N = 1 / tau, B = 2 * ln2 / pi, K = tau / 3, R = tau * tau / 2;
  if (kind == AllanKind::modified)
    // The ratios of the integrals over the density of sin^6(u)/u^4 and sin^4(u)/u^2, exact for any m for Q and N.
    return {Q / m, N * (m * m + 1) / (2 * m * m), B * (27 * std::log(3.0) - 32 * ln2) / (16 * ln2), K * 33 / 40, R};
  if (is_hadamard(kind)) return {Q * 10 / 9, N, B * std::log(256.0 / 27) / (4 * ln2), K / 2, 0};
  if (kind == AllanKind::total)
    // The bias of the reflection: SP1065 5.2.11 for B and K. At up to half of the record, 2 tau/T of the squares
    // are reflected. For Q the reflected squares have 10/6 of the mean of the others; for R, the mean over the
    // quadratic phase.
    return {Q * (1 + share * 4 / 3), N, B * (1 - share / (3 * ln2)), K * (1 - 0.75 * share),
            R * (1 - share * 14 / 15)};
  return {Q, N, B, K, R};
}

double expected_deviation(AllanKind kind, const AllanTerms& terms, const AveragingTime& time,
                          double flicker_from_s) noexcept {
  auto unit = unit_variances(kind, time);
  constexpr std::size_t B = 2;
  if (terms.B > 0) unit[B] *= flicker_share(kind, time, flicker_from_s);
  double variance = 0;
  for (std::size_t i = 0; i < allan_term_count; ++i) {
    const double value = terms.*allan_term_list[i].value;
    variance += unit[i] * value * value;
  }
  return std::sqrt(variance);
}

}  // namespace imud
