#include "core/truth.hpp"

#include <cmath>

namespace imud {

namespace {
bool within(const Vector3& v, double limit) { return v.cwiseAbs().maxCoeff() <= limit; }
}  // namespace

bool is_finite(const Truth& t) noexcept {
  return t.r_BN_N.allFinite() && t.v_BN_N.allFinite() && t.q_NB.coeffs().allFinite() && t.omega_BN_B.allFinite() &&
         t.omegaDot_BN_B.allFinite() && t.specific_force_B.allFinite() && t.accumulated_dv_B.allFinite();
}

bool is_in_range(const Truth& t) noexcept {
  constexpr std::int64_t time_limit = std::int64_t{1} << 62;
  return t.time.ns > -time_limit && t.time.ns < time_limit && within(t.r_BN_N, 1e15) && within(t.v_BN_N, 1e9) &&
         std::abs(t.q_NB.squaredNorm() - 1.0) <= 2e-6 && within(t.omega_BN_B, 1e5) && within(t.omegaDot_BN_B, 1e8) &&
         within(t.specific_force_B, 1e8) && within(t.accumulated_dv_B, 1e9);
}

}  // namespace imud
