// Elementary functions that give the same bits on every machine.
//
// A run must give the same bytes everywhere, but libm's results differ in the last bit between C libraries, their
// versions, and processors with and without fused multiply-add. These use only +, -, *, / and sqrt, which IEEE 754
// defines exactly. Errors are below 2 ulp of 1, for atan and log below 3 ulp, over the stated ranges
// (tests/core/elementary_test.cpp). All functions are pure and thread-safe and do not throw; angles are in rad.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/numbers/lanes.hpp"

namespace imud::elementary {

// The four even functions of an angle x that rotations need. They are power series in x^2 near zero, so that nothing
// is singular or cancels there.
struct EvenSeries {
  double sinc;     // sin(x)/x
  double cos;      // cos(x)
  double versine;  // (1 - cos x)/x^2
  double cubic;    // (x - sin x)/x^3
};

namespace detail {
template <int Offset, int Terms>
constexpr std::array<double, Terms + 1> series_ratios() {
  std::array<double, Terms + 1> ratios = {};
  for (std::size_t k = 1; k <= Terms; ++k)
    ratios[k] = 1.0 / static_cast<double>((2 * k + Offset) * (2 * k + Offset - 1));
  return ratios;
}

// 1, 1/3, 1/5, ...: the coefficients of atanh(x)/x as a polynomial in x^2, and of atan(x)/x in -x^2.
template <std::size_t Terms>
constexpr std::array<double, Terms> make_odd_reciprocals() {
  std::array<double, Terms> odd = {};
  for (std::size_t k = 0; k < Terms; ++k) odd[k] = 1.0 / static_cast<double>(2 * k + 1);
  return odd;
}
template <std::size_t Terms>
inline constexpr std::array<double, Terms> odd_reciprocals = make_odd_reciprocals<Terms>();

// c[0] + c[1] x + c[2] x^2 + ... by Estrin's scheme (pairs, pairs of pairs, ...), whose chain of dependent
// operations is shorter than in Horner's rule.
template <class Coefficient, std::size_t N, class Real>
[[gnu::always_inline]] constexpr Real polynomial(const std::array<Coefficient, N>& c, Real x) {
  if constexpr (N == 1) {
    return c[0];
  } else {
    std::array<Real, (N + 1) / 2> pairs = {};
    for (std::size_t i = 0; i < N / 2; ++i) pairs[i] = c[2 * i] + c[2 * i + 1] * x;
    if constexpr (N % 2 == 1) pairs.back() = c.back() - Real{};
    return polynomial(pairs, x * x);
  }
}

// Sum over k of (-1)^k z^k Offset!/(2k + Offset)!, by Horner's rule.
template <int Offset, int Terms, class Real>
[[gnu::always_inline]] constexpr Real alternating_series(Real z) {
  constexpr auto ratios = series_ratios<Offset, Terms>();
  Real sum = 1.0 - z * ratios[Terms];
  for (std::size_t k = Terms - 1; k >= 1; --k) sum = 1.0 - z * ratios[k] * sum;
  return sum;
}

template <int Terms>
constexpr auto make_even_ratios() {
  constexpr auto sinc = series_ratios<1, Terms>(), cos = series_ratios<0, Terms>(),
                 versine = series_ratios<2, Terms>(), cubic = series_ratios<3, Terms>();
  std::array<std::array<double, 4>, Terms + 1> ratios = {};
  for (std::size_t k = 1; k <= Terms; ++k) ratios[k] = {sinc[k], cos[k], versine[k], cubic[k]};
  return ratios;
}
template <int Terms>
inline constexpr auto even_ratios = make_even_ratios<Terms>();

// The sums for the four functions of EvenSeries, side by side.
template <int Terms>
inline EvenSeries even_series(double z) {
  Lanes sum = all_lanes(1.0);
  for (std::size_t k = Terms; k >= 1; --k) sum = 1.0 - z * std::bit_cast<Lanes>(even_ratios<Terms>[k]) * sum;
  return {sum[0], sum[1], sum[2] / 2.0, sum[3] / 6.0};
}
}  // namespace detail

// Returns atan(x)/x for x^2 = `z`, x in [0, 1].
inline double atan_over_x(double z) {
  if (z < 1e-4) return detail::polynomial(detail::odd_reciprocals<5>, -z);
  // atan x = 2 atan(x/(1 + sqrt(1 + x^2))): three halvings bring x below tan(pi/32).
  double factor = 1.0;
  while (z > 0.01) {
    const double d = 1.0 + std::sqrt(1.0 + z);
    z = z / (d * d);
    factor *= 2.0 / d;
  }
  return factor * detail::polynomial(detail::odd_reciprocals<10>, -z);
}

// Returns the angle from the x axis to (x, y), in [-pi, pi]; 0 at the origin.
inline double atan2(double y, double x) {
  constexpr double pi = 3.141592653589793;
  const double across = std::abs(x);
  const double up = std::abs(y);
  if (across + up == 0.0) return 0.0;
  const double t = up <= across ? up / across : across / up;
  double angle = t * atan_over_x(t * t);
  if (up > across) angle = 0.5 * pi - angle;
  if (x < 0.0) angle = pi - angle;
  return y < 0.0 ? -angle : angle;
}

namespace detail {
// Returns the natural logarithm of m 2^exponent, m being between sqrt(1/2) and sqrt(2).
template <class Real>
[[gnu::always_inline]] inline Real log_of(Real m, Real exponent) {
  const Real s = (m - 1.0) / (m + 1.0);  // log m = 2 atanh s, |s| < 0.172
  const Real sum = polynomial(odd_reciprocals<12>, Real(s * s));
  constexpr double ln2_high = 0x1.62e42fee00000p-1;  // 33 bits: times an exponent it is exact
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  return exponent * ln2_high + (2.0 * s * sum + exponent * ln2_low);
}
}  // namespace detail

// Returns the natural logarithm of x, finite and above 0, not subnormal.
inline double log(double x) {
  auto bits = std::bit_cast<std::uint64_t>(x);
  int exponent = static_cast<int>(bits >> 52U) - 1022;
  bits = (bits & 0x000F'FFFF'FFFF'FFFFULL) | 0x3FE0'0000'0000'0000ULL;
  double m = std::bit_cast<double>(bits);  // in [0.5, 1)
  if (m < 0.70710678118654752) {
    m *= 2.0;
    --exponent;
  }
  return detail::log_of(m, static_cast<double>(exponent));
}

// Returns the natural logarithm of each lane of x, with the bits of log().
[[gnu::always_inline]] inline Lanes log(Lanes x) {
  const auto bits = std::bit_cast<LaneMask>(x);
  // An integer below 2^52 is in the last bits of its sum with 2^52.
  const Lanes exponent = std::bit_cast<Lanes>((bits >> 52) | 0x4330'0000'0000'0000LL) - (0x1p52 + 1022.0);
  const auto m = std::bit_cast<Lanes>((bits & 0x000F'FFFF'FFFF'FFFFLL) | 0x3FE0'0000'0000'0000LL);  // in [0.5, 1)
  const LaneMask is_small = m < 0.70710678118654752;
  return detail::log_of(select(is_small, 2.0 * m, m), select(is_small, exponent - 1.0, exponent));
}

// Returns e^x; 0 for x <= -708 and for a NaN, e^709 for x > 709.
inline double exp(double x) {
  if (!(x > -708.0)) return 0.0;
  if (x > 709.0) x = 709.0;
  constexpr double ln2_high = 0x1.62e42fee00000p-1;
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  constexpr double log2_e = 0x1.71547652b82fep+0;
  const double exponent = std::floor(x * log2_e + 0.5);
  const double r = (x - exponent * ln2_high) - exponent * ln2_low;  // |r| < 0.347
  double sum = 1.0;
  for (int k = 14; k >= 1; --k) sum = 1.0 + r * sum / k;
  return sum * std::bit_cast<double>(static_cast<std::uint64_t>(static_cast<std::int64_t>(exponent) + 1023) << 52U);
}

template <class Real>
struct SineAndCosine {
  Real sin;
  Real cos;
};
using SinCos = SineAndCosine<double>;

namespace detail {
constexpr double two_over_pi = 0x1.45f306dc9c883p-1;

// Returns sine and cosine of x - quadrant * pi/2. This difference must be within +-pi/4.
template <class Real>
[[gnu::always_inline]] inline SineAndCosine<Real> sincos_in(Real quadrant, Real x) {
  // Cody and Waite: pi/2 as two parts of 33 bits each, and the rest in 53 bits.
  constexpr double high = 0x1.921fb54400000p+0;
  constexpr double middle = 0x1.0b4611a600000p-34;
  constexpr double low = 0x1.3198a2e037073p-69;
  const Real r = ((x - quadrant * high) - quadrant * middle) - quadrant * low;
  const Real z = r * r;
  return {r * alternating_series<1, 9>(z), alternating_series<0, 9>(z)};
}
}  // namespace detail

// Returns sine and cosine of x. Beyond |x| = 1e5 the error grows in proportion to x.
inline SinCos sincos(double x) {
  const double quadrant = std::floor(x * detail::two_over_pi + 0.5);
  const auto [s, c] = detail::sincos_in(quadrant, x);
  switch (static_cast<std::int64_t>(quadrant) & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

// Returns sine and cosine of each lane of x, with the bits of sincos().
[[gnu::always_inline]] inline SineAndCosine<Lanes> sincos(Lanes x) {
  Lanes quadrant = x * detail::two_over_pi + 0.5;
  for (int i = 0; i < 4; ++i) quadrant[i] = std::floor(quadrant[i]);
  const auto [s, c] = detail::sincos_in(quadrant, x);
  // The last bits of this sum are the quadrant as an integer.
  const auto number = std::bit_cast<LaneMask>(quadrant + 0x1.8p52);
  const LaneMask is_odd = -(number & 1);
  const LaneMask sin_sign = (number & 2) << 62, cos_sign = ((number + 1) & 2) << 62;
  return {change_sign(sin_sign, select(is_odd, c, s)), change_sign(cos_sign, select(is_odd, s, c))};
}

// Returns the four functions of x for x^2 = `z`; x is in the range of sincos().
inline EvenSeries even_series(double z) {
  if (z < 1e-3) return detail::even_series<4>(z);
  if (z < 1.0) return detail::even_series<9>(z);
  const double x = std::sqrt(z);
  const auto [sin, cos] = sincos(x);
  return {sin / x, cos, (1.0 - cos) / z, (1.0 - sin / x) / z};
}

}  // namespace imud::elementary
