#include "core/attitude.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "core/numbers/lane_rotation.hpp"

namespace imud {
namespace {

constexpr double pi = 3.14159265358979324;

// Random rotation vectors with angles from 0 to `to`.
class Rotations {
 public:
  explicit Rotations(double to) : angle_(0.0, to) {}
  Vector3 next() {
    Vector3 axis;
    do axis = {unit_(random_), unit_(random_), unit_(random_)};
    while (axis.norm() > 1.0 || axis.norm() < 0.1);
    return angle_(random_) * axis.normalized();
  }

 private:
  std::mt19937_64 random_{1};
  std::uniform_real_distribution<double> unit_{-1.0, 1.0};
  std::uniform_real_distribution<double> angle_;
};

Quaternion by_eigen(const Vector3& phi) {
  const double angle = phi.norm();
  return Quaternion(Eigen::AngleAxisd(angle, angle > 0.0 ? Vector3(phi / angle) : Vector3::UnitX()));
}

double distance(const Quaternion& a, const Quaternion& b) {
  return std::min((a.coeffs() - b.coeffs()).norm(), (a.coeffs() + b.coeffs()).norm());
}

TEST(Attitude, ExpIsTheRotationHoweverLong) {
  for (const double to : {1e-9, 0.05, 1.0, 2.0 * pi, 100.0, 1e5}) {
    Rotations rotations(to);
    for (int i = 0; i < 2'000; ++i) {
      const Vector3 phi = rotations.next();
      const Quaternion q = exp(phi);
      ASSERT_LT(distance(q, by_eigen(phi)), 4e-16 * (2.0 + phi.norm())) << phi;
      ASSERT_NEAR(q.norm(), 1.0, 2e-15) << phi;
    }
  }
  for (const double angle : {1e8, 1e12, 1e17}) EXPECT_NEAR(exp({0.0, angle, 0.0}).norm(), 1.0, 1e-3) << angle;
}

TEST(Attitude, LogUndoesExp) {
  Rotations rotations(pi - 1e-9);
  for (int i = 0; i < 20'000; ++i) {
    const Vector3 phi = rotations.next();
    ASSERT_LT((log(exp(phi)) - phi).norm(), 3e-15) << phi;
    const Quaternion q = exp(phi);
    ASSERT_LT((log({-q.w(), -q.x(), -q.y(), -q.z()}) - phi).norm(), 3e-15) << "the other sign: " << phi;
  }
  EXPECT_NEAR(log({0.0, 0.6, 0.8, 0.0}).norm(), pi, 1e-15);
}

TEST(Attitude, NoDeadZoneNearZero) {
  for (double angle = 1e-300; angle < 0.1; angle *= 3.7) {
    const Vector3 phi = angle * Vector3(0.6, 0.0, -0.8);
    EXPECT_LT((log(exp(phi)) - phi).norm(), 1e-15 * angle) << angle;
    EXPECT_LT((rotation_vector_from_mrp(0.25 * phi) - phi).norm(), (1e-15 + angle * angle / 12.0) * angle) << angle;
  }
  EXPECT_EQ(log(Quaternion::Identity()).norm(), 0.0);
  EXPECT_EQ(exp(Vector3::Zero()).w(), 1.0);
}

// Memo Eq. 3, corrected; as printed it gives 2.5 here.
TEST(Attitude, RotationVectorOfAnMrp) {
  EXPECT_NEAR(rotation_vector_from_mrp({0.1, 0.0, 0.0}).x(), 4.0 * std::atan(0.1), 1e-16);
  EXPECT_NEAR(rotation_vector_from_mrp({0.1, 0.0, 0.0}).x(), 0.3987, 5e-5);
  const Vector3 sigma(0.3, -0.5, 0.2);
  EXPECT_LT((rotation_vector_from_mrp(sigma) - sigma.normalized() * 4.0 * std::atan(sigma.norm())).norm(), 1e-15);
  EXPECT_LT((rotation_vector_from_mrp(mrp_shadow(sigma)) - rotation_vector_from_mrp(sigma)).norm(), 1e-15);
}

TEST(Attitude, MrpAndQuaternionAreTheSameAttitude) {
  Rotations rotations(pi);
  for (int i = 0; i < 5'000; ++i) {
    const Vector3 phi = rotations.next();
    const Vector3 sigma = phi.normalized() * std::tan(0.25 * phi.norm());
    const Quaternion q_NB = by_eigen(phi);
    ASSERT_LT(distance(quaternion_from_mrp(sigma), q_NB), 1e-15);
    ASSERT_LT((mrp_from_quaternion(q_NB) - sigma).norm(), 1e-15);
    // The shadow set is the same attitude.
    const Vector3 shadow = mrp_shadow(sigma);
    ASSERT_LT(distance(quaternion_from_mrp(shadow), q_NB), 1e-15);
    ASSERT_LT((mrp_short(shadow) - sigma).norm(), 1e-15);
  }
}

TEST(Attitude, YawPitchRollAreFoundAgain) {
  for (double yaw = -3.1; yaw < 3.14; yaw += 0.31)
    for (double pitch = -1.55; pitch < 1.57; pitch += 0.155)
      for (double roll = -3.1; roll < 3.14; roll += 0.31) {
        const Vector3 found = yaw_pitch_roll_from_dcm(dcm_from_yaw_pitch_roll(yaw, pitch, roll));
        ASSERT_LT((found - Vector3(yaw, pitch, roll)).cwiseAbs().maxCoeff(), 1e-13);
      }
}

TEST(Attitude, RightJacobianIsTheRateOfARotationVector) {
  for (const double to : {1e-3, 0.5, 3.0, 20.0}) {
    Rotations rotations(to);
    for (int i = 0; i < 200; ++i) {
      const Vector3 phi = rotations.next();
      const Vector3 phi_dot(0.3, -0.8, 0.5);
      const double h = 1e-3;
      const auto back_and_forth = [&](double t) { return log(exp(phi).conjugate() * exp(phi + t * phi_dot)); };
      const Vector3 difference =
          (8.0 * (back_and_forth(h) - back_and_forth(-h)) - (back_and_forth(2 * h) - back_and_forth(-2 * h))) /
          (12.0 * h);
      ASSERT_LT((right_jacobian(phi, phi_dot) - difference).norm(), 2e-11) << phi;
    }
  }
}

TEST(Attitude, RightJacobianIsTheMeanOfARotation) {
  const Vector3 v(1.0, -2.0, 0.5);
  for (const Vector3& phi : {Vector3(0.01, 0.02, -0.01), Vector3(1.0, -0.5, 2.0), Vector3(-9.0, 4.0, 7.0)}) {
    Vector3 sum = Vector3::Zero();
    constexpr int n = 20'000;
    for (int i = 0; i < n; ++i) sum += exp(((i + 0.5) / n) * phi) * v;
    EXPECT_LT((right_jacobian(-phi, v) - sum / n).norm(), 1e-7);
  }
}

TEST(Attitude, InverseRightJacobianIsTheInverse) {
  for (const double to : {1e-8, 1e-3, 1.0, 6.0}) {
    Rotations rotations(to);
    for (int i = 0; i < 2'000; ++i) {
      const Vector3 phi = rotations.next();
      const Vector3 omega(0.3, -0.8, 0.5);
      ASSERT_LT((right_jacobian(phi, inverse_right_jacobian(phi, omega)) - omega).norm(), 1e-14) << phi;
    }
  }
}

TEST(Attitude, YawPitchRollAreTheThreeTurns) {
  const double yaw = 0.7854, pitch = 1.0, roll = 0.1;
  // Each rotation turns the axes, and therefore the components the other way.
  const Matrix3 expected = (Eigen::AngleAxisd(-roll, Vector3::UnitX()) * Eigen::AngleAxisd(-pitch, Vector3::UnitY()) *
                            Eigen::AngleAxisd(-yaw, Vector3::UnitZ()))
                               .toRotationMatrix();
  EXPECT_LT((dcm_from_yaw_pitch_roll(yaw, pitch, roll) - expected).norm(), 1e-15);
  EXPECT_EQ(dcm_from_yaw_pitch_roll(0, 0, 0), Matrix3::Identity());
  // Nose up: what was forward is now partly down the platform's z.
  EXPECT_NEAR((dcm_from_yaw_pitch_roll(0, pi / 2, 0) * Vector3::UnitX() - Vector3::UnitZ()).norm(), 0.0, 1e-15);
}

TEST(Attitude, RotationDefect) {
  EXPECT_LT(rotation_defect(dcm_from_yaw_pitch_roll(2.0, -1.0, 3.0)), 1e-15);
  EXPECT_NEAR(rotation_defect(Matrix3(1.01 * Matrix3::Identity())), 0.0201, 1e-12);
  Matrix3 mirror = Matrix3::Identity();
  mirror(2, 2) = -1.0;
  EXPECT_EQ(rotation_defect(mirror), 2.0);
}

// Deviations of roll, pitch and yaw: by the differences that small rotations about north, east and down make.
TEST(Attitude, DeviationsOfAnglesAreThoseOfSmallRotations) {
  const Vector3 sigma(0.002, 0.01, 0.03);
  constexpr double small = 1e-6;
  for (const Vector3& angles : {Vector3(0, 0, 0), Vector3(0.7, 0.3, -1.2), Vector3(-2.5, -1.3, 2.9),
                                Vector3(1.6, 1.5, 0.4), Vector3(3.1, 0, 0)}) {
    const Quaternion q_LP(dcm_from_yaw_pitch_roll(angles.x(), angles.y(), angles.z()).transpose());
    Vector3 variance = Vector3::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      const Quaternion turned = exp(small * Vector3::Unit(axis)) * q_LP;
      const Vector3 after = yaw_pitch_roll_from_dcm(turned.conjugate().toRotationMatrix());
      for (int i = 0; i < 3; ++i) {
        const double change = std::remainder(after[i] - angles[i], 2 * pi) / small * sigma[axis];
        variance[2 - i] += change * change;
      }
    }
    const Vector3 deviations = roll_pitch_yaw_deviations(q_LP, sigma);
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(deviations[i], std::sqrt(variance[i]), 2e-4 * std::sqrt(variance[i])) << angles.transpose() << i;
  }
  const Quaternion up(dcm_from_yaw_pitch_roll(0.3, 0.5 * pi, 0).transpose());
  EXPECT_EQ(roll_pitch_yaw_deviations(up, Vector3::Constant(0.1)).x(), pi);
  EXPECT_EQ(roll_pitch_yaw_deviations(up, Vector3::Constant(10)).y(), pi);
}

bool has_same_bits(const Vector3& a, const Vector3& b) { return std::memcmp(a.data(), b.data(), sizeof a) == 0; }
bool has_same_bits(const Quaternion& a, const Quaternion& b) {
  return std::memcmp(a.coeffs().data(), b.coeffs().data(), sizeof(Eigen::Vector4d)) == 0;
}

// The vectors have zeros of both signs, too.
TEST(Attitude, LanesHaveTheSameBits) {
  std::mt19937_64 random(7);
  std::uniform_int_distribution<int> choice(0, 5);
  for (const double to : {1e-6, 0.03, 1.0, pi, 20.0}) {
    Rotations rotations(to);
    const auto vector = [&] {
      Vector3 v = rotations.next();
      const int i = choice(random);
      if (i < 3) v[i] = i == choice(random) ? -0.0 : 0.0;
      return v;
    };
    for (int i = 0; i < 3000; ++i) {
      const Vector3 phi = vector(), v = 10 * vector();
      const Quaternion a = exp(phi), b = exp(vector());
      const Quaternion long_turn(i % 2 == 0 ? 0.0 : -0.0, 1.01, b.x(), b.y());  // its MRPs are longer than 1
      const Matrix3 matrix = a.toRotationMatrix();
      ASSERT_TRUE(has_same_bits(vector_of(cross(lanes(phi), lanes(v))), phi.cross(v)));
      ASSERT_EQ(squared_norm(lanes(v)), v.squaredNorm());
      ASSERT_TRUE(has_same_bits(quaternion_of(product(lanes(a), lanes(b))), a * b));
      ASSERT_TRUE(has_same_bits(quaternion_of(product(conjugate(lanes(a)), lanes(b))), a.conjugate() * b));
      ASSERT_TRUE(has_same_bits(vector_of(rotate(lanes(a), lanes(v))), Vector3(a * v)));
      ASSERT_TRUE(has_same_bits(vector_of(log_of_rotation(lanes(a))), log(a)));
      ASSERT_TRUE(has_same_bits(vector_of(log_of_rotation(-lanes(a))), log(Quaternion(-a.coeffs()))));
      ASSERT_TRUE(has_same_bits(vector_of(log_of_rotation(lanes(long_turn))), log(long_turn)));
      ASSERT_TRUE(has_same_bits(quaternion_of(exp_of_rotation(lanes(phi))), a));
      ASSERT_TRUE(has_same_bits(vector_of(right_jacobian(lanes(phi), lanes(v))), right_jacobian(phi, v)));
      ASSERT_TRUE(
          has_same_bits(vector_of(inverse_right_jacobian(lanes(phi), lanes(v))), inverse_right_jacobian(phi, v)));
      ASSERT_TRUE(has_same_bits(vector_of(LaneMatrix(matrix) * lanes(v)), Vector3(matrix * v)));
    }
  }
}

}  // namespace
}  // namespace imud
