// Motions with attitude, position and their derivatives in closed form, and pose tables of them. N is a local level
// with 9.80665 m/s^2 along its z. They share no code with the model: std::sin, Eigen's AngleAxis.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string_view>
#include <vector>

#include "core/pose/pose_fit.hpp"
#include "tools/truth/motion.hpp"

namespace imud {

struct PoseMotion {
  std::string_view name;
  Truth (*at)(TruthTime time);
};

namespace pose_motion {

// a sin(w t + b) + c t, with its derivatives.
struct Swing {
  double a, w, b, c;
  double value(double t) const { return a * std::sin(w * t + b) + c * t; }
  double first(double t) const { return a * w * std::cos(w * t + b) + c; }
  double second(double t) const { return -a * w * w * std::sin(w * t + b); }
};

// Rolls of 2.5 rad/s during lazy eights: pitch to +-1.2 rad, rates to 4.6 rad/s, specific force to 40 m/s^2.
inline Truth aerobatic(TruthTime time) {
  constexpr Swing yaw{0.8, 1.1, 0.3, 0.2}, pitch{1.2, 0.9, 0.0, 0.0}, roll{0.4, 3.0, 1.0, 2.5};
  constexpr Swing r[] = {{60, 0.7, 0.0, 20}, {80, 0.5, 0.4, 0}, {-15, 1.4, 0.2, 1}};
  const double t = seconds(time - TruthTime{});
  const double theta = pitch.value(t), phi = roll.value(t);
  const double st = std::sin(theta), ct = std::cos(theta), sp = std::sin(phi), cp = std::cos(phi);
  const double yaw1 = yaw.first(t), pitch1 = pitch.first(t), roll1 = roll.first(t);
  Truth truth;
  truth.time = time;
  truth.q_NB = Eigen::AngleAxisd(yaw.value(t), Vector3::UnitZ()) * Eigen::AngleAxisd(theta, Vector3::UnitY()) *
               Eigen::AngleAxisd(phi, Vector3::UnitX());
  truth.omega_BN_B = {roll1 - yaw1 * st, pitch1 * cp + yaw1 * ct * sp, -pitch1 * sp + yaw1 * ct * cp};
  const double yaw2 = yaw.second(t), pitch2 = pitch.second(t), roll2 = roll.second(t);
  truth.omegaDot_BN_B = {
      roll2 - yaw2 * st - yaw1 * pitch1 * ct,
      pitch2 * cp - pitch1 * roll1 * sp + yaw2 * ct * sp - yaw1 * pitch1 * st * sp + yaw1 * roll1 * ct * cp,
      -pitch2 * sp - pitch1 * roll1 * cp + yaw2 * ct * cp - yaw1 * pitch1 * st * cp - yaw1 * roll1 * ct * sp};
  truth.r_BN_N = {r[0].value(t), r[1].value(t), r[2].value(t)};
  truth.v_BN_N = {r[0].first(t), r[1].first(t), r[2].first(t)};
  const Vector3 a_N(r[0].second(t), r[1].second(t), r[2].second(t) - 9.80665);
  truth.specific_force_B = truth.q_NB.conjugate() * a_N;
  return truth;
}

inline Truth coning_2_hz(TruthTime time) {
  return find_motion("coning")->at(time, {.half_angle_rad = 0.1, .frequency_hz = 2.0});
}
inline Truth spiral(TruthTime time) { return find_motion("spiral")->at(time, {}); }

inline constexpr PoseMotion table[] = {{"spiral", spiral}, {"coning", coning_2_hz}, {"aerobatic", aerobatic}};

}  // namespace pose_motion

inline const PoseMotion& find_pose_motion(std::string_view name) {
  const PoseMotion* motion = pose_motion::table;
  while (motion->name != name) ++motion;
  return *motion;
}

inline double in_float32(double x) { return static_cast<double>(static_cast<float>(x)); }

// The poses alone, from time 0; every third quaternion has the other sign.
inline std::vector<Truth> poses_of(const PoseMotion& motion, int rate_hz, Nanoseconds duration, bool as_float32) {
  std::vector<Truth> poses;
  const Nanoseconds step = Nanoseconds{1'000'000'000} / rate_hz;
  for (TruthTime t; t - TruthTime{} <= duration; t = t + step) {
    const Truth truth = motion.at(t);
    Truth pose;
    pose.time = t;
    pose.q_NB = truth.q_NB;
    if (poses.size() % 3 == 1) pose.q_NB.coeffs() = -pose.q_NB.coeffs();
    pose.has_rate = false;
    pose.has_position = true;
    pose.r_BN_N = truth.r_BN_N;
    if (as_float32) {
      pose.q_NB.coeffs() = pose.q_NB.coeffs().unaryExpr(&in_float32).eval();
      pose.r_BN_N = pose.r_BN_N.unaryExpr(&in_float32).eval();
    }
    poses.push_back(pose);
  }
  return poses;
}

// Returns all truths as a fit completes them.
inline std::vector<Truth> fitted(PoseFit& fit, const std::vector<Truth>& given) {
  std::vector<Truth> all;
  Truth truth;
  for (const Truth& t : given) {
    fit.push(t);
    while (fit.next(truth)) all.push_back(truth);
  }
  fit.finish();
  while (fit.next(truth)) all.push_back(truth);
  return all;
}
inline std::vector<Truth> fitted(const PoseFit::Options& options, const std::vector<Truth>& given) {
  PoseFit fit(options);
  return fitted(fit, given);
}

struct FitErrors {
  double rate = 0, force = 0;          // rad/s, m/s^2; the largest inside
  double end_rate = 0, end_force = 0;  // within a window of the ends
};

inline FitErrors errors_of(const std::vector<Truth>& derived, const PoseMotion& motion) {
  constexpr std::chrono::milliseconds ends(60);
  FitErrors errors;
  for (const Truth& truth : derived) {
    const Truth expected = motion.at(truth.time);
    const double rate = (truth.omega_BN_B - expected.omega_BN_B).norm();
    const double force = (truth.specific_force_B - expected.specific_force_B).norm();
    const bool is_inside = truth.time - derived.front().time > ends && derived.back().time - truth.time > ends;
    double& largest_rate = is_inside ? errors.rate : errors.end_rate;
    double& largest_force = is_inside ? errors.force : errors.end_force;
    largest_rate = std::max(largest_rate, rate);
    largest_force = std::max(largest_force, force);
  }
  return errors;
}

// Options with the gravitation of these motions.
inline constexpr PoseFit::Options level{
    .gravitation = {.kind = GravitationModel::Kind::constant, .constant = 9.80665}};

}  // namespace imud
