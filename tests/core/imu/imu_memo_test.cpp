// The memo's own test (its section 4): the motion of the sensor is formulated about the centre of mass C, which moves
// in the body, while the model uses only the origin of the body frame. All vectors in N unless named otherwise.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/attitude.hpp"
#include "core/imu.hpp"

namespace imud {
namespace {

constexpr double yaw = 0.7854, pitch = 1.0, roll = 0.1;
const Vector3 r_SB_B(1.0, 1.0, 2.0);

// The given accelerations.
struct Accelerations {
  Vector3 origin, centre, angular;  // of B, of C, and omegaDot_BN
};
using Program = Accelerations (*)(double t);

Accelerations constant(double) { return {{1.0, 1.1, 0.9}, {1.04, 1.18, 0.95}, {1.0, 1.5, 1.25}}; }
Accelerations varying(double t) {
  return {{1.0 + std::sin(3.0 * t), -0.5 * t, 2.0 * std::cos(5.0 * t)},
          {1.1 + std::sin(3.2 * t), 0.1 - 0.4 * t, 1.9 * std::cos(5.0 * t + 0.1)},
          {2.0 * std::cos(4.0 * t), 1.5 - 3.0 * t, -1.0 + std::sin(7.0 * t)}};
}

Matrix3 dcm_BN_of(const Vector3& s) {  // Eq. 3.152 of Schaub and Junkins, by the elements
  const double n = s.squaredNorm(), d = (1.0 + n) * (1.0 + n), m = 1.0 - n;
  Matrix3 c;
  c << 4 * (s[0] * s[0] - s[1] * s[1] - s[2] * s[2]) + m * m, 8 * s[0] * s[1] + 4 * m * s[2],
      8 * s[0] * s[2] - 4 * m * s[1],  //
      8 * s[1] * s[0] - 4 * m * s[2], 4 * (-s[0] * s[0] + s[1] * s[1] - s[2] * s[2]) + m * m,
      8 * s[1] * s[2] + 4 * m * s[0],  //
      8 * s[2] * s[0] + 4 * m * s[1], 8 * s[2] * s[1] - 4 * m * s[0],
      4 * (-s[0] * s[0] - s[1] * s[1] + s[2] * s[2]) + m * m;
  return c / d;
}

Vector3 rotation_vector_of(const Matrix3& dcm_21) {
  const Vector3 v(dcm_21(1, 2) - dcm_21(2, 1), dcm_21(2, 0) - dcm_21(0, 2), dcm_21(0, 1) - dcm_21(1, 0));
  return v.normalized() * std::atan2(0.5 * v.norm(), 0.5 * (dcm_21.trace() - 1.0));
}

Matrix3 skew(const Vector3& a) {
  Matrix3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

// The state that Eq. 32-39 carry from step to step.
struct MemoMotion {
  Accelerations a;
  Vector3 v_B{0.1, 0.2, -0.1};
  Vector3 v_C{0.05, 0.07, 0.08};
  Vector3 c_dot{-0.05, -0.13, 0.18};  // v_C - v_B
  Vector3 c{0.5, 0.7, 0.5};
  Vector3 omega{0.0, 0.15, 0.1};
  Vector3 sigma{0.25, 0.1, 0.03};

  Matrix3 dcm_BN() const { return dcm_BN_of(sigma); }
  Vector3 sigma_dot() const {  // Eq. 36, 37
    const Vector3 w = dcm_BN() * omega;
    const Matrix3 B =
        (1.0 - sigma.squaredNorm()) * Matrix3::Identity() + 2.0 * skew(sigma) + 2.0 * sigma * sigma.transpose();
    return 0.25 * B * w;
  }

  MemoMotion next(const Accelerations& to, double dt) const {
    MemoMotion n = *this;
    n.a = to;
    n.v_B += 0.5 * dt * (a.origin + to.origin);                               // Eq. 33
    n.v_C += 0.5 * dt * (a.centre + to.centre);                               // and the same for C
    n.c_dot += 0.5 * dt * ((a.centre - a.origin) + (to.centre - to.origin));  // Eq. 39
    n.c += 0.5 * dt * (c_dot + n.c_dot);
    n.omega += 0.5 * dt * (a.angular + to.angular);                                           // Eq. 35
    for (int i = 0; i < 20; ++i) n.sigma = sigma + 0.5 * dt * (sigma_dot() + n.sigma_dot());  // Eq. 38, implicit
    return n;
  }

  // Of the sensor's point, by way of C.
  Vector3 c_prime() const { return c_dot - omega.cross(c); }  // Eq. 30
  Vector3 r_SC() const { return dcm_BN().transpose() * r_SB_B - c; }
  Vector3 v_S() const { return v_C - c_prime() + omega.cross(r_SC()); }  // Eq. 28
  Vector3 a_S() const {
    const Vector3 c_prime_prime = (a.centre - a.origin) - 2.0 * omega.cross(c_prime()) - a.angular.cross(c) -
                                  omega.cross(omega.cross(c));  // Eq. 31
    return a.centre - c_prime_prime - 2.0 * omega.cross(c_prime()) + a.angular.cross(r_SC()) +
           omega.cross(omega.cross(r_SC()));  // Eq. 29
  }
};

struct Run {
  Program program;
  double dt;
};

class Memo : public ::testing::TestWithParam<Run> {
 protected:
  static constexpr double tolerance = 1e-8;  // relative; the memo allowed 1e-2

  Memo() {
    MemoMotion motion;
    motion.a = GetParam().program(0.0);
    for (int i = 0; i <= static_cast<int>(1.0 / GetParam().dt + 0.5); ++i) {
      motions_.push_back(motion);
      motion = motion.next(GetParam().program(GetParam().dt * (i + 1)), GetParam().dt);
    }
    dcm_PB_ = (Eigen::AngleAxisd(-roll, Vector3::UnitX()) * Eigen::AngleAxisd(-pitch, Vector3::UnitY()) *
               Eigen::AngleAxisd(-yaw, Vector3::UnitZ()))
                  .toRotationMatrix();
  }

  std::vector<Sample> samples(DeltaVelocity delta_velocity, AccumulatedDv kind) const {
    ImuModel model;
    model.r_SB_B = r_SB_B;
    model.dcm_PB = dcm_from_yaw_pitch_roll(yaw, pitch, roll);
    model.delta_velocity = delta_velocity;
    Timeline timeline;
    Imu imu(model, 1, 1);
    Vector3 body_sum = Vector3::Zero();
    std::vector<Sample> result;
    for (std::size_t i = 0; i < motions_.size(); ++i) {
      const MemoMotion& m = motions_[i];
      if (i > 0) body_sum += m.dcm_BN() * (m.v_B - motions_[i - 1].v_B);
      Truth truth;
      truth.time.ns = static_cast<std::int64_t>(static_cast<double>(i) * GetParam().dt * 1e9 + 0.5);
      truth.q_NB = quaternion_from_mrp(m.sigma);
      truth.omega_BN_B = m.dcm_BN() * m.omega;
      truth.has_angular_acceleration = truth.has_specific_force = true;
      truth.omegaDot_BN_B = m.dcm_BN() * m.a.angular;
      truth.specific_force_B = m.dcm_BN() * m.a.origin;  // no gravity
      truth.accumulated_dv = kind;
      truth.accumulated_dv_B =
          kind == AccumulatedDv::body_sum ? body_sum : Vector3(m.dcm_BN() * (m.v_B - motions_[0].v_B));
      timeline.push(truth);
      result.push_back(imu.sample(timeline, truth.time, {}));
    }
    return result;
  }

  void expect(const Vector3& actual, const Vector3& expected) const {
    EXPECT_LT((actual - expected).norm(), tolerance * expected.norm());
  }

  std::vector<MemoMotion> motions_;
  Matrix3 dcm_PB_;
};

TEST_P(Memo, RateAndAcceleration) {
  const std::vector<Sample> out = samples(DeltaVelocity::end_frame, AccumulatedDv::inertial);
  for (std::size_t i = 0; i < out.size(); ++i) {
    SCOPED_TRACE(i);
    const Matrix3 dcm_PN = dcm_PB_ * motions_[i].dcm_BN();
    expect(out[i].rate, dcm_PN * motions_[i].omega);
    expect(out[i].specific_force, dcm_PN * motions_[i].a_S());
  }
}

TEST_P(Memo, DeltaAngle) {
  const std::vector<Sample> out = samples(DeltaVelocity::end_frame, AccumulatedDv::inertial);
  for (std::size_t i = 1; i < out.size(); ++i) {
    SCOPED_TRACE(i);
    const Matrix3 dcm_PN1 = dcm_PB_ * motions_[i - 1].dcm_BN(), dcm_PN2 = dcm_PB_ * motions_[i].dcm_BN();
    expect(out[i].delta_angle, rotation_vector_of(dcm_PN2 * dcm_PN1.transpose()));
  }
}

// As the reference module takes it: the change of the sensor's velocity, resolved at the end of the step.
TEST_P(Memo, DeltaVelocityOfTheSensorPoint) {
  for (const AccumulatedDv kind : {AccumulatedDv::inertial, AccumulatedDv::body_sum}) {
    const std::vector<Sample> out = samples(DeltaVelocity::end_frame, kind);
    for (std::size_t i = 1; i < out.size(); ++i) {
      SCOPED_TRACE(i);
      expect(out[i].delta_velocity, dcm_PB_ * motions_[i].dcm_BN() * (motions_[i].v_S() - motions_[i - 1].v_S()));
    }
  }
}

// As Eq. 10-14 are printed: differences of components in the body frame, the accumulated velocity being the sum of
// body-frame increments.
TEST_P(Memo, DeltaVelocityInTheBodyFrame) {
  for (const AccumulatedDv kind : {AccumulatedDv::inertial, AccumulatedDv::body_sum}) {
    const std::vector<Sample> out = samples(DeltaVelocity::memo, kind);
    for (std::size_t i = 1; i < out.size(); ++i) {
      SCOPED_TRACE(i);
      const MemoMotion &m1 = motions_[i - 1], &m2 = motions_[i];
      const Vector3 lever1 = m1.dcm_BN() * (m1.v_S() - m1.v_B), lever2 = m2.dcm_BN() * (m2.v_S() - m2.v_B);
      expect(out[i].delta_velocity, dcm_PB_ * (m2.dcm_BN() * (m2.v_B - m1.v_B) + lever2 - lever1));
    }
  }
}

// The same test distinguishes the definitions: neither passes for the other.
TEST_P(Memo, DefinitionsDiffer) {
  const std::vector<Sample> a = samples(DeltaVelocity::memo, AccumulatedDv::inertial);
  const std::vector<Sample> b = samples(DeltaVelocity::end_frame, AccumulatedDv::inertial);
  const std::vector<Sample> c = samples(DeltaVelocity::integral, AccumulatedDv::inertial);
  EXPECT_GT((a.back().delta_velocity - b.back().delta_velocity).norm(), 1e-4 * a.back().delta_velocity.norm());
  EXPECT_GT((a.back().delta_velocity - c.back().delta_velocity).norm(), 1e-4 * a.back().delta_velocity.norm());
  EXPECT_GT((b.back().delta_velocity - c.back().delta_velocity).norm(), 1e-4 * a.back().delta_velocity.norm());
}

INSTANTIATE_TEST_SUITE_P(Motions, Memo,
                         ::testing::Values(Run{constant, 0.01}, Run{varying, 0.01}, Run{varying, 0.001},
                                           Run{varying, 0.1}));

}  // namespace
}  // namespace imud
