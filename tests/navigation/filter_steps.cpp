// filter_steps STEPS: an InertialFilter in endless turns, climbs and outages, with every aid. Each 1000 steps the
// covariance of the states, of the aids' errors and of the scale factors must be symmetric to the bit, positive
// definite by Cholesky's decomposition, and bounded, and the errors must be within 10 standard deviations. Exits with
// 1 at the first that is not.
#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "core/attitude.hpp"
#include "core/navigation/azimuth.hpp"
#include "core/navigation/inertial_filter.hpp"
#include "core/units.hpp"

namespace {

using namespace imud;
using Filter = InertialFilter;
constexpr double dt = 0.02, g = units::standard_gravity;
constexpr int all = Filter::states + Filter::most_added;

class Noise {
 public:
  // Three deviates of this standard deviation, uniform: cheap, and any will do.
  Vector3 operator()(double sigma) {
    std::uniform_real_distribution<double> uniform(-std::sqrt(3.0) * sigma, std::sqrt(3.0) * sigma);
    const double x = uniform(random_), y = uniform(random_);
    return {x, y, uniform(random_)};
  }

 private:
  std::mt19937_64 random_{1};
};

const char* fault_of(const Filter& filter, const InertialState& truth) {
  Eigen::Matrix<double, all, all> P;
  P << filter.covariance(), filter.added().cross_covariance, filter.added().cross_covariance.transpose(),
      filter.added().covariance;
  if (!(P.array() == P.transpose().array()).all()) return "the covariance is not symmetric";
  if (P.llt().info() != Eigen::Success) return "the covariance is not positive definite";
  const auto largest = [&](int first) { return std::sqrt(P.diagonal().segment<3>(first).maxCoeff()); };
  if (!(largest(Filter::phi) < 0.2 && largest(Filter::velocity) < 50 && largest(Filter::position) < 2000))
    return "the covariance is not bounded";
  const Vector3 r = truth.r_N - filter.motion().r_N, v = truth.v_N - filter.motion().v_N;
  const Vector3 phi = log(truth.q_NP * filter.motion().q_NP.conjugate());
  if (!(r.norm() < 10 * largest(Filter::position) && v.norm() < 10 * largest(Filter::velocity) &&
        phi.norm() < 10 * largest(Filter::phi)))
    return "the errors are larger than the covariance allows";
  return nullptr;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::uint64_t steps = std::strtoull(argv[1], nullptr, 10);
  const GravitationModel flat = {.kind = GravitationModel::Kind::constant};
  std::vector<Filter::AidError> errors(3, Filter::AidError::correlated(1.5, 600));
  errors.insert(errors.end(), 3, Filter::AidError::correlated(0.1, 60));
  errors.push_back(Filter::AidError::walk(500, 0.13));
  Filter filter(flat, {}, {1e-4, 1e-3, 1e-6, 1e-5}, errors);
  Filter::State sigma;
  sigma << 0.02, 0.02, 0.05, 0.2, 0.2, 0.2, 2, 2, 3, 1e-3, 1e-3, 1e-3, 0.02, 0.02, 0.02;
  filter.estimate_scale_factors({2e-3, 2e-3});
  filter.begin({}, Vector3::Zero(), Vector3::Zero(), sigma.cwiseProduct(sigma).asDiagonal());
  Strapdown truth(flat);
  Noise noise;
  const double root = std::sqrt(dt);
  for (std::uint64_t k = 1; k <= steps; ++k) {
    const double t = dt * static_cast<double>(k);
    const Vector3 rate(0.3 * std::sin(0.9 * t), 0.2 * std::cos(0.7 * t), 0.25 * std::sin(0.31 * t));
    const Vector3 a_N(2 * std::sin(0.5 * t), 2 * std::cos(0.4 * t), std::sin(0.8 * t));
    const Vector3 force = truth.state().q_NP.conjugate() * Vector3(a_N - Vector3(0, 0, g));
    truth.advance(dt * rate, dt * force, dt);
    filter.advance(dt * rate + noise(1e-4 * root), dt * force + noise(1e-3 * root), dt);
    if (k % 10 == 0) {
      filter.propagate();
      const InertialState &is = truth.state(), &of = filter.motion();
      if (k / 5000 % 3 != 1) {  // no outage
        filter.update({.first = Filter::position,
                       .innovation = is.r_N - of.r_N + noise(0.5),
                       .variance = Vector3::Constant(0.25),
                       .error = 0});
        filter.update({.first = Filter::velocity,
                       .innovation = is.v_N - of.v_N + noise(0.05),
                       .variance = Vector3::Constant(0.0025),
                       .error = 3});
        const Vector3 x = is.q_NP * Vector3::UnitX();
        if (x.head<2>().norm() > 0.3)
          filter.update(azimuth_measurement(exp(Vector3(0, 0, noise(0.01).z())) * x, of.q_NP * Vector3::UnitX(),
                                            Quaternion::Identity(), 0.01));
      }
      Filter::Measurement up = {.first = Filter::position, .rows = 1, .error = 6};
      up.axes_N.row(0) = -Vector3::UnitZ().transpose();
      up.innovation[0] = of.r_N.z() - is.r_N.z() + noise(1).z();
      filter.update(up);
    }
    if (k % 1000 != 0) continue;
    filter.propagate();
    if (const char* fault = fault_of(filter, truth.state())) {
      std::printf("step %llu: %s\n", static_cast<unsigned long long>(k), fault);
      return 1;
    }
  }
  std::printf("%llu steps\n", static_cast<unsigned long long>(steps));
  return 0;
}
