#include "core/earth/magnetic_field.hpp"

#include <cmath>
#include <cstddef>
#include <tuple>

#include "core/numbers/dispatch.hpp"

namespace imud {
namespace {

constexpr double reference = 6'371'200.0;  // a, m

// Factors from the harmonics of degrees n and n - 1 to degree n + 1, for order m.
struct Step {
  double once, twice;
};

template <std::size_t Size>
constexpr std::array<Step, Size> make_steps(int top) {
  std::array<Step, Size> steps = {};
  std::size_t i = 0;
  for (int m = 0; m <= top; ++m)
    for (int n = m; n <= top; ++n)
      steps[i++] = {static_cast<double>(2 * n + 1) / (n + 1 - m), static_cast<double>(n + m) / (n + 1 - m)};
  return steps;
}

// Returns the Schmidt semi-normalised harmonic divided by the one without normalisation.
double schmidt(int n, int m) {
  double squared = m == 0 ? 1.0 : 2.0;
  for (int k = n - m + 1; k <= n + m; ++k) squared /= k;
  return std::sqrt(squared);
}

}  // namespace

MagneticField::Weights& MagneticField::weights(int degree, int order) noexcept {
  return weights_[static_cast<std::size_t>(order * (2 * top + 3 - order) / 2 + degree - order)];
}

// The field is a sum of solid harmonics, which need no angle:
//   V_nm + i W_nm = (a/r)^(n+1) P_nm(sin lat) e^(i m lon),  P_nm not normalised,
// because each derivative of one of degree n is a sum of such harmonics of degree n + 1 (Cunningham, Celestial
// Mechanics 2, 1970; Montenbruck and Gill, Satellite Orbits, section 3.2).
MagneticField::MagneticField(std::span<const GaussCoefficients> model) {
  for (const auto& [n, m, g_nT, h_nT] : model) {
    const double unit = 1e-9 * schmidt(n, m);
    const double g = unit * g_nT, h = m == 0 ? 0.0 : unit * h_nT;
    const double vertical = n - m + 1;
    weights(n + 1, m).cosine.add(lanes({0, 0, vertical * g}));
    weights(n + 1, m).sine.add(lanes({0, 0, vertical * h}));
    const double higher = m == 0 ? 1.0 : 0.5;
    weights(n + 1, m + 1).cosine.add(lanes(higher * Vector3(g, -h, 0.0)));
    weights(n + 1, m + 1).sine.add(lanes(higher * Vector3(h, g, 0.0)));
    if (m == 0) continue;
    const double lower = 0.5 * (n - m + 2) * (n - m + 1);
    weights(n + 1, m - 1).cosine.add(lanes(-lower * Vector3(g, h, 0.0)));
    weights(n + 1, m - 1).sine.add(lanes(-lower * Vector3(h, -g, 0.0)));
  }
}

IMUD_DISPATCHED Vector3 MagneticField::at(const Vector3& r_E) const noexcept {
  static constexpr auto steps = make_steps<std::tuple_size_v<decltype(weights_)>>(top);
  const double r2 = r_E.squaredNorm(), scale = reference / r2, a2 = reference * scale;
  const Vector3 u = scale * r_E;
  Lanes field = {};
  double v_mm = reference / std::sqrt(r2), w_mm = 0.0;
  std::size_t i = 0;
  for (int m = 0; m <= top; ++m) {
    double v = v_mm, w = w_mm, v_below = 0.0, w_below = 0.0;
    for (int n = m; n <= top; ++n, ++i) {
      field += v * weights_[i].cosine.lanes() + w * weights_[i].sine.lanes();
      const double once = steps[i].once * u.z(), twice = steps[i].twice * a2;
      const double v_above = once * v - twice * v_below, w_above = once * w - twice * w_below;
      v_below = v;
      w_below = w;
      v = v_above;
      w = w_above;
    }
    const double sectoral = 2 * m + 1;
    const double v_next = sectoral * (u.x() * v_mm - u.y() * w_mm);
    w_mm = sectoral * (u.x() * w_mm + u.y() * v_mm);
    v_mm = v_next;
  }
  return vector_of(field);
}

}  // namespace imud
