#include "core/random.hpp"

#include <Random123/philox.h>

#include <array>
#include <cmath>
#include <cstddef>

#include "core/elementary.hpp"

namespace imud {

namespace {

using Coefficients = std::array<double, 8>;  // c0 + c1 x + ... + c7 x^7

constexpr Coefficients central_numerator = {3.387132872796366608,  133.14166789178437745, 1971.5909503065514427,
                                            13731.693765509461125, 45921.953931549871457, 67265.770927008700853,
                                            33430.575583588128105, 2509.0809287301226727};
constexpr Coefficients central_denominator = {1.0,
                                              42.313330701600911252,
                                              687.1870074920579083,
                                              5394.1960214247511077,
                                              21213.794301586595867,
                                              39307.89580009271061,
                                              28729.085735721942674,
                                              5226.495278852545925};
constexpr Coefficients near_numerator = {1.42343711074968357734,   4.6303378461565452959,   5.7694972214606914055,
                                         3.64784832476320460504,   1.27045825245236838258,  0.24178072517745061177,
                                         0.0227238449892691845833, 7.7454501427834140764e-4};
constexpr Coefficients near_denominator = {1.0,
                                           2.05319162663775882187,
                                           1.6763848301838038494,
                                           0.68976733498510000455,
                                           0.14810397642748007459,
                                           0.0151986665636164571966,
                                           5.475938084995344946e-4,
                                           1.05075007164441684324e-9};
constexpr Coefficients far_numerator = {6.6579046435011037772,     5.4637849111641143699,    1.7848265399172913358,
                                        0.29656057182850489123,    0.026532189526576123093,  0.0012426609473880784386,
                                        2.71155556874348757815e-5, 2.01033439929228813265e-7};
constexpr Coefficients far_denominator = {1.0,
                                          0.59983220655588793769,
                                          0.13692988092273580531,
                                          0.0148753612908506148525,
                                          7.868691311456132591e-4,
                                          1.8463183175100546818e-5,
                                          1.4215117583164458887e-7,
                                          2.04426310338993978564e-15};

}  // namespace

double inverse_normal_cdf(double p) noexcept {
  using elementary::detail::polynomial;
  const double q = p - 0.5;
  if (std::abs(q) <= 0.425) {
    const double r = 0.180625 - q * q;
    return q * polynomial(central_numerator, r) / polynomial(central_denominator, r);
  }
  const double r = std::sqrt(-elementary::log(q < 0.0 ? p : 1.0 - p));
  const double x = r <= 5.0 ? polynomial(near_numerator, r - 1.6) / polynomial(near_denominator, r - 1.6)
                            : polynomial(far_numerator, r - 5.0) / polynomial(far_denominator, r - 5.0);
  return q < 0.0 ? -x : x;
}

std::uint32_t stream_id(std::string_view imu_name) noexcept {
  std::uint32_t hash = 2166136261U;  // FNV-1a
  for (const char c : imu_name) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
  return hash;
}

Normals::Block Normals::block(Quantity quantity, Process process, std::uint64_t k) const noexcept {
  const auto low = [](std::uint64_t x) { return static_cast<std::uint32_t>(x); };
  const auto high = [](std::uint64_t x) { return static_cast<std::uint32_t>(x >> 32U); };
  const r123::Philox4x32::key_type key = {{low(seed_), high(seed_)}};
  const std::uint32_t purpose = static_cast<std::uint32_t>(process) << 8U | static_cast<std::uint32_t>(quantity)
                                                                                << 4U;
  Block block;
  block.number = k / 2;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const auto words = r123::Philox4x32{}({{low(block.number), high(block.number), purpose | axis, stream_}}, key);
    block.bits[0][axis] = std::uint64_t{words[1]} << 32U | words[0];
    block.bits[1][axis] = std::uint64_t{words[3]} << 32U | words[2];
  }
  return block;
}

Vector3 Normals::Block::normals(std::uint64_t k) const noexcept {
  const std::array<std::uint64_t, 3>& half = bits[k % 2];
  return {inverse_normal_cdf(uniform(half[0])), inverse_normal_cdf(uniform(half[1])),
          inverse_normal_cdf(uniform(half[2]))};
}

}  // namespace imud
