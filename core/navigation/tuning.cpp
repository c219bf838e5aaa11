// The tuning of a Navigator by the errors of its sensors.
#include <algorithm>
#include <cmath>

#include "core/navigation/navigator.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

struct Tuning {
  double noise = 0, walk = 0, bias = 0, scale = 0, g_sensitivity = 0;  // scale: factors and misalignments
  double scale_factor = 0, misalignment = 0;
};

// Returns the tuning by the largest of the axes. A slow error that is no random walk counts as the random walk that
// has the error's Allan deviation after `slow_s`; the figure is chosen: a maker's own tuning is not published.
Tuning tuning_of(const TriadErrors& errors, double internal_hz) {
  constexpr double slow_s = 20, flat = 0.664;  // sqrt(2 ln 2/pi), the Allan deviation of B = 1
  const bool is_white = errors.walk_transition.isZero(0.0);
  Tuning largest;
  for (int i = 0; i < 3; ++i) {
    const double step2 = errors.walk_sqrt_cov.row(i).squaredNorm();
    const double noise2 = square(errors.white_density[i]) + (is_white ? step2 / internal_hz : 0);
    const double slow2 = square(flat * errors.bias_instability[i]) + square(errors.correlated_sigma[i]);
    const double walk2 =
        square(errors.random_walk_density[i]) + (is_white ? 0 : step2 * internal_hz) + 3 * slow2 / slow_s;
    const double bias2 = square(errors.bias[i]) + square(errors.turn_on_bias[i]) + square(errors.unit_sigma.bias[i]) +
                         square(errors.turn_on_sigma.bias[i]) + slow2;
    const double scale2 =
        square(errors.scale_factor[i] - 1) + (errors.misalignment - Matrix3::Identity()).row(i).squaredNorm() +
        square(errors.unit_sigma.scale_factor[i]) + square(errors.turn_on_sigma.scale_factor[i]) +
        errors.unit_sigma.misalignment.row(i).squaredNorm() + errors.turn_on_sigma.misalignment.row(i).squaredNorm();
    // The two parts of scale2, whose sum would round otherwise than scale2, and change the bits of filters of 15
    // states.
    const double scale_factor2 = square(errors.scale_factor[i] - 1) + square(errors.unit_sigma.scale_factor[i]) +
                                 square(errors.turn_on_sigma.scale_factor[i]);
    const double misalignment2 = (errors.misalignment - Matrix3::Identity()).row(i).squaredNorm() +
                                 errors.unit_sigma.misalignment.row(i).squaredNorm() +
                                 errors.turn_on_sigma.misalignment.row(i).squaredNorm();
    const double g_sensitivity2 = errors.g_sensitivity.row(i).squaredNorm() +
                                  errors.unit_sigma.g_sensitivity.row(i).squaredNorm() +
                                  errors.turn_on_sigma.g_sensitivity.row(i).squaredNorm();
    largest.scale = std::max(largest.scale, std::sqrt(scale2));
    largest.scale_factor = std::max(largest.scale_factor, std::sqrt(scale_factor2));
    largest.misalignment = std::max(largest.misalignment, std::sqrt(misalignment2));
    largest.g_sensitivity = std::max(largest.g_sensitivity, std::sqrt(g_sensitivity2));
    largest.noise = std::max(largest.noise, std::sqrt(noise2));
    largest.walk = std::max(largest.walk, std::sqrt(walk2));
    largest.bias = std::max(largest.bias, std::sqrt(bias2));
  }
  return largest;
}

}  // namespace

std::uint64_t samples_between(double rate_hz, double aid_hz) noexcept {
  return aid_hz > 0 ? static_cast<std::uint64_t>(std::max(1.0, std::floor(rate_hz / aid_hz + 0.5))) : 0;
}

void tune(NavigatorModel& navigator, const ImuModel& imu) noexcept {
  const double internal_hz = imu.rate_hz * imu.internal_samples;
  const Tuning gyro = tuning_of(imu.gyro, internal_hz), accelerometer = tuning_of(imu.accelerometer, internal_hz);
  // A filter that trusts its sensors without limit would take no aid.
  constexpr double least_gyro = 1e-7, least_accelerometer = 1e-6, least_walk = 1e-9, least_bias = 1e-6,
                   least_scale = 1e-6;
  navigator.noise = {std::max(gyro.noise, least_gyro),
                     std::max(accelerometer.noise, least_accelerometer),
                     std::max(gyro.walk, least_walk),
                     std::max(accelerometer.walk, 10 * least_walk),
                     gyro.scale,
                     accelerometer.scale,
                     gyro.g_sensitivity,
                     gyro.misalignment,
                     accelerometer.misalignment};
  // In gravity these errors are a bias.
  constexpr double g = units::standard_gravity;
  navigator.gyro_bias = std::max(std::sqrt(square(gyro.bias) + square(g * gyro.g_sensitivity)), least_bias);
  const auto with_bias = [&](double scale) {
    return std::max(std::sqrt(square(accelerometer.bias) + square(g * scale)), 100 * least_bias);
  };
  navigator.accelerometer_bias = with_bias(accelerometer.scale);
  navigator.accelerometer_bias_beside_scale = with_bias(accelerometer.misalignment);
  navigator.gyro_scale_factor = std::max(gyro.scale_factor, least_scale);
  navigator.accelerometer_scale_factor = std::max(accelerometer.scale_factor, least_scale);
}

}  // namespace imud
