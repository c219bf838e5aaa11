#include "emulator/imu/solution_judge.hpp"

#include "core/attitude.hpp"

namespace imud {

void SolutionJudge::keep(const Sample& sample, const PositionVelocity& position_B, const Vector3& rate_P) noexcept {
  kept_ = sample.counter;
  q_LP_ = sample.q_LP;
  // The axes of L at B's origin are those at S but for a millionth of a radian.
  const Navigation origin = earth_.navigation(position_B);
  const Quaternion q_NP = origin.is_known ? earth_.q_LN(position_B, origin).conjugate() * q_LP_ : q_LP_;
  PositionVelocity position_S = position_B;
  position_S.r_N += q_NP * r_SB_P_;
  position_S.v_N += q_NP * rate_P.cross(r_SB_P_);
  navigation_ = earth_.navigation(position_S);
}

SolutionErrors SolutionJudge::errors(const Sample& sample) const noexcept {
  SolutionErrors errors{.attitude = log(sample.q_LP * q_LP_.conjugate()).norm()};
  if (!navigation_.is_known || !sample.navigation.is_known) return errors;
  errors.velocity = (sample.navigation.v_L - navigation_.v_L).norm();
  errors.position = (sample.navigation.r_E - navigation_.r_E).norm();
  return errors;
}

std::optional<SolutionDifference> SolutionJudge::difference(const Sample& sample) const noexcept {
  if (kept_ != sample.counter) return std::nullopt;
  const Vector3 attitude = log(sample.q_LP * q_LP_.conjugate());
  if (!navigation_.is_known || !sample.navigation.is_known) return SolutionDifference{.attitude = attitude};
  const Matrix3 dcm_LE = dcm_EL(navigation_.latitude, navigation_.longitude).transpose();
  return SolutionDifference{.attitude = attitude,
                            .has_place = true,
                            .velocity = sample.navigation.v_L - navigation_.v_L,
                            .position = dcm_LE * (sample.navigation.r_E - navigation_.r_E)};
}

}  // namespace imud
