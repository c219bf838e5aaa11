// MagneticField: the Earth's main magnetic field as a series of spherical harmonics.
//
// The field is B = -grad V with the potential
//   V = a sum over n, m of (a/r)^(n+1) (g_nm cos(m lon) + h_nm sin(m lon)) P_nm(sin lat),
// where a = 6371.2 km, r, lat and lon are geocentric, and P_nm is Schmidt semi-normalised: the form in which IGRF
// and WMM are published.
#pragma once

#include <array>
#include <span>

#include "core/numbers/lanes.hpp"
#include "core/vector.hpp"

namespace imud {

// The coefficients of one degree n and order m of the series, nT.
struct GaussCoefficients {
  int degree;  // 1 to MagneticField::max_degree
  int order;   // 0 to `degree`
  double g;
  double h;  // without effect where the order is 0
};

// The field of one model at one date. Immutable; 6 kB.
class MagneticField {
 public:
  static constexpr int max_degree = 13;

  // Makes the field of a model: coefficients in any order, no two of the same degree and order.
  explicit MagneticField(std::span<const GaussCoefficients> model);

  // Returns the field, T, at the point r_E, m, in E. Valid outside of the Earth's core; at the poles as elsewhere.
  // Pure, thread-safe, does not allocate, and gives the same bits on every machine.
  Vector3 at(const Vector3& r_E) const noexcept;

 private:
  static constexpr int top = max_degree + 1;  // degree of the gradient of the highest harmonic
  // The parts of the two solid harmonics of one degree and order in the field, T.
  struct Weights {
    LaneVector cosine, sine;
  };
  Weights& weights(int degree, int order) noexcept;

  std::array<Weights, (top + 1) * (top + 2) / 2> weights_;  // by order, then by degree
};

}  // namespace imud
