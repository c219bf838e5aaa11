// A motion given by its rate and specific force in body axes, as a truth source for tests. Attitude and accumulated
// velocity are integrated with fourth order and steps of 1 ms, so that they are exact to about 1e-14 for motions of a
// few rad/s. The code shares nothing with the model: it uses std::sin and Eigen's AngleAxis.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "core/truth.hpp"

namespace imud {

struct BodyMotion {
  Vector3 (*omega)(double t);
  Vector3 (*omega_dot)(double t);
  Vector3 (*force)(double t);
};

// The trajectory of tests/vectors: rates to 0.5 rad/s, up to 0.35 Hz.
inline BodyMotion smooth_motion() {
  return {[](double t) {
            return Vector3(0.05 + 0.30 * std::sin(0.7 * t), -0.04 - 0.20 * std::cos(0.5 * t + 0.2),
                           0.10 + 0.40 * std::sin(1.1 * t + 0.3));
          },
          [](double t) {
            return Vector3(0.21 * std::cos(0.7 * t), 0.10 * std::sin(0.5 * t + 0.2), 0.44 * std::cos(1.1 * t + 0.3));
          },
          [](double t) {
            return Vector3(0.50 + 0.20 * std::sin(1.3 * t), -0.30 * std::cos(0.9 * t),
                           0.10 + 0.80 * std::sin(2.1 * t));
          }};
}

// The integrals of smooth_motion()'s rate and specific force from 0 to t, in closed form.
inline Vector3 smooth_rate_integral(double t) {
  return {0.05 * t + 0.30 / 0.7 * (1.0 - std::cos(0.7 * t)),
          -0.04 * t - 0.20 / 0.5 * (std::sin(0.5 * t + 0.2) - std::sin(0.2)),
          0.10 * t + 0.40 / 1.1 * (std::cos(0.3) - std::cos(1.1 * t + 0.3))};
}
inline Vector3 smooth_force_integral(double t) {
  return {0.50 * t + 0.20 / 1.3 * (1.0 - std::cos(1.3 * t)), -0.30 / 0.9 * std::sin(0.9 * t),
          0.10 * t + 0.80 / 2.1 * (1.0 - std::cos(2.1 * t))};
}

class IntegratedMotion {
 public:
  IntegratedMotion(const BodyMotion& motion, double duration_s) : motion_(motion) {
    const auto steps = static_cast<std::size_t>(std::ceil(duration_s / step_s)) + 1;
    knots_.push_back({});
    for (std::size_t i = 0; i < steps; ++i) knots_.push_back(advance(i, step_s));
  }

  Vector3 omega_BN_B(double t) const { return motion_.omega(t); }
  Vector3 specific_force_B(double t) const { return motion_.force(t); }
  Quaternion q_NB(double t) const { return near(t).q_NB; }
  Vector3 dv_N(double t) const { return near(t).dv_N; }

  // Gives every quantity of a truth; times count from 0.
  Truth truth(TruthTime time) const {
    const double t = seconds(time - TruthTime{});
    const Knot at = near(t);
    Truth truth;
    truth.time = time;
    truth.q_NB = at.q_NB;
    truth.omega_BN_B = motion_.omega(t);
    truth.has_angular_acceleration = true;
    truth.omegaDot_BN_B = motion_.omega_dot(t);
    truth.has_specific_force = true;
    truth.specific_force_B = motion_.force(t);
    truth.accumulated_dv = AccumulatedDv::inertial;
    truth.accumulated_dv_B = at.q_NB.conjugate() * at.dv_N;
    return truth;
  }

 private:
  static constexpr double step_s = 1e-3;
  struct Knot {
    Quaternion q_NB = Quaternion(Eigen::AngleAxisd(2.0, Vector3(0.6, 0.0, 0.8)));
    Vector3 dv_N = Vector3::Zero();
  };

  static Quaternion turn(const Vector3& phi) {
    const double angle = phi.norm();
    return angle > 0.0 ? Quaternion(Eigen::AngleAxisd(angle, phi / angle)) : Quaternion::Identity();
  }

  // The rotation from t to t + h: Magnus expansion of fourth order.
  Vector3 rotation(double t, double h) const {
    const Vector3 w1 = motion_.omega(t + h * (0.5 - std::sqrt(3.0) / 6.0));
    const Vector3 w2 = motion_.omega(t + h * (0.5 + std::sqrt(3.0) / 6.0));
    return 0.5 * h * (w1 + w2) + std::sqrt(3.0) / 12.0 * h * h * w1.cross(w2);
  }

  Knot advance(std::size_t i, double h) const {
    const Knot& from = knots_[i];
    const double t = static_cast<double>(i) * step_s;
    Knot to = from;
    const double offset = std::sqrt(0.15);  // Gauss-Legendre, three points
    const double nodes[] = {0.5 - offset, 0.5, 0.5 + offset};
    const double weights[] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
    for (int j = 0; j < 3; ++j) {
      const double part = nodes[j] * h;
      to.dv_N += weights[j] * h * (from.q_NB * turn(rotation(t, part)) * motion_.force(t + part));
    }
    to.q_NB = (from.q_NB * turn(rotation(t, h))).normalized();
    return to;
  }

  Knot near(double t) const {
    const auto i = static_cast<std::size_t>(std::max(0.0, std::floor(t / step_s + 0.5)));
    return advance(i, t - static_cast<double>(i) * step_s);
  }

  BodyMotion motion_;
  std::vector<Knot> knots_;
};

// The angle between two attitudes, rad.
inline double angle_between(const Quaternion& a, const Quaternion& b) {
  return 2.0 * std::min((a.coeffs() - b.coeffs()).norm(), (a.coeffs() + b.coeffs()).norm());
}

}  // namespace imud
