#include "core/truth.hpp"

#include <cmath>
#include <limits>

namespace imud {
namespace {
bool within(const Vector3& v, double limit) { return v.cwiseAbs().maxCoeff() <= limit; }
}  // namespace

bool VehicleStates::are_within(double limit) const noexcept {
  for (std::size_t i = 0; i < vehicle_state_count; ++i)
    if ((given_ & bit(static_cast<VehicleState>(i))) != 0 && !(std::abs(value_[i]) <= limit)) return false;
  return true;
}

bool is_finite(const Truth& t) noexcept {
  return t.r_BN_N.allFinite() && t.v_BN_N.allFinite() && t.q_NB.coeffs().allFinite() && t.omega_BN_B.allFinite() &&
         t.omegaDot_BN_B.allFinite() && t.specific_force_B.allFinite() && t.accumulated_dv_B.allFinite() &&
         std::isfinite(t.temperature_c) && t.magnetic_field_B.allFinite() && std::isfinite(t.pressure) &&
         std::isfinite(t.earth_angle) &&
         (t.vehicle.is_empty() || t.vehicle.are_within(std::numeric_limits<double>::max()));
}

bool is_in_range(const Truth& t) noexcept {
  constexpr auto time_limit = static_cast<std::int64_t>(truth_limit::time_ns);
  return t.time.ns > -time_limit && t.time.ns < time_limit && within(t.r_BN_N, truth_limit::position) &&
         within(t.v_BN_N, truth_limit::velocity) && std::abs(t.q_NB.squaredNorm() - 1.0) <= 2e-6 &&
         within(t.omega_BN_B, truth_limit::rate) && within(t.omegaDot_BN_B, truth_limit::angular_acceleration) &&
         within(t.specific_force_B, truth_limit::specific_force) &&
         within(t.accumulated_dv_B, truth_limit::velocity) && std::abs(t.temperature_c) <= truth_limit::temperature &&
         within(t.magnetic_field_B, truth_limit::magnetic_field) && std::abs(t.pressure) <= truth_limit::pressure &&
         (t.vehicle.is_empty() || t.vehicle.are_within(truth_limit::vehicle));
}

}  // namespace imud
