#include "tools/truth/motion.hpp"

#include <cmath>

#include "core/numbers/elementary.hpp"

namespace imud {
namespace {

constexpr double two_pi = 6.283185307179586;

// Returns (cos x - 1 + x^2/2)/x^4 for x^2 = z, the next member of elementary::EvenSeries.
double next_even(double z, double versine) {
  return z < 1.0 ? elementary::detail::alternating_series<4, 8>(z) / 24.0 : (0.5 - versine) / z;
}

Quaternion about_y(double angle) {
  const auto [s, c] = elementary::sincos(0.5 * angle);
  return {c, 0.0, s, 0.0};
}

Quaternion about_z(double angle) {
  const auto [s, c] = elementary::sincos(0.5 * angle);
  return {c, 0.0, 0.0, s};
}

Truth complete(TruthTime time) {
  Truth truth;
  truth.time = time;
  truth.has_position = truth.has_velocity = true;
  truth.has_angular_acceleration = true;
  truth.has_specific_force = true;
  truth.accumulated_dv = AccumulatedDv::inertial;
  return truth;
}

double elapsed(TruthTime time) { return seconds(time - TruthTime{}); }

Truth rest(TruthTime time, const MotionParameters& parameters) {
  Truth truth = complete(time);
  truth.specific_force_B = {0.0, 0.0, -parameters.gravity_m_per_s2};
  truth.accumulated_dv_B = elapsed(time) * truth.specific_force_B;
  return truth;
}

Truth turntable(TruthTime time, const MotionParameters& parameters) {
  Truth truth = rest(time, parameters);  // gravity lies along the axis
  truth.q_NB = about_z(parameters.rate_rad_per_s * elapsed(time));
  truth.omega_BN_B = {0.0, 0.0, parameters.rate_rad_per_s};
  return truth;
}

// q = [cos a/2, sin a/2 cos wt, sin a/2 sin wt, 0]: body z goes round a cone of half-angle a.
Truth coning(TruthTime time, const MotionParameters& parameters) {
  Truth truth = complete(time);
  const double t = elapsed(time);
  const double w = two_pi * parameters.frequency_hz;
  const double turns = parameters.frequency_hz * t;
  const auto [sin_wt, cos_wt] = elementary::sincos(two_pi * (turns - std::floor(turns + 0.5)));
  const auto [sin_a, cos_a] = elementary::sincos(parameters.half_angle_rad);
  const auto [sin_half, cos_half] = elementary::sincos(0.5 * parameters.half_angle_rad);
  truth.q_NB = {cos_half, sin_half * cos_wt, sin_half * sin_wt, 0.0};
  truth.omega_BN_B = {-w * sin_a * sin_wt, w * sin_a * cos_wt, -2.0 * w * sin_half * sin_half};
  truth.omegaDot_BN_B = {-w * w * sin_a * cos_wt, -w * w * sin_a * sin_wt, 0.0};
  const Vector3 down_B = {-sin_a * sin_wt, sin_a * cos_wt, cos_a};
  truth.specific_force_B = -parameters.gravity_m_per_s2 * down_B;
  truth.accumulated_dv_B = t * truth.specific_force_B;  // constant in N
  return truth;
}

// Body x along the velocity, which turns at w in the horizontal plane while the speed is a t.
Truth spiral(TruthTime time, const MotionParameters& parameters) {
  Truth truth = complete(time);
  const double t = elapsed(time);
  const double w = parameters.rate_rad_per_s;
  const double a = parameters.acceleration_m_per_s2;
  const double g = parameters.gravity_m_per_s2;
  const double x = w * t;
  const auto even = elementary::even_series(x * x);
  const auto [sin, cos] = elementary::sincos(x);
  truth.r_BN_N = a * t * t * Vector3(even.sinc - even.versine, x * (even.versine - even.cubic), 0.0);
  truth.v_BN_N = a * t * Vector3(cos, sin, 0.0);
  truth.q_NB = about_z(x);
  truth.omega_BN_B = {0.0, 0.0, w};
  truth.specific_force_B = {a, a * x, -g};
  truth.accumulated_dv_B = {a * t, 0.0, -g * t};
  return truth;
}

// Specific force a + j t along body x, which pitches up from the horizontal at w.
Truth boost(TruthTime time, const MotionParameters& parameters) {
  Truth truth = complete(time);
  const double t = elapsed(time);
  const double w = parameters.rate_rad_per_s;
  const double a = parameters.acceleration_m_per_s2;
  const double j = parameters.jerk_m_per_s3;
  const double x = w * t;
  const auto [sin, cos] = elementary::sincos(x);
  const auto even = elementary::even_series(x * x);
  const double sinc = even.sinc, versine = even.versine, cubic = even.cubic;
  const double quartic = next_even(x * x, versine);
  // Single and double integrals of (a + j t) (cos wt, -sin wt); `up` is minus N's z.
  const double dv_north = t * (a * sinc + j * t * (sinc - versine));
  const double dv_up = t * x * (a * versine + j * t * (versine - cubic));
  const double north = t * t * (a * versine + j * t * (versine - 2.0 * cubic));
  const double up = t * t * x * (a * cubic + j * t * (cubic - 2.0 * quartic));
  const Vector3 fall = {0.0, 0.0, parameters.gravity_m_per_s2 * t};
  truth.r_BN_N = Vector3(north, 0.0, -up) + 0.5 * t * fall;
  truth.v_BN_N = Vector3(dv_north, 0.0, -dv_up) + fall;
  truth.q_NB = about_y(x);
  truth.omega_BN_B = {0.0, w, 0.0};
  truth.specific_force_B = {a + j * t, 0.0, 0.0};
  truth.accumulated_dv_B = {cos * dv_north + sin * dv_up, 0.0, sin * dv_north - cos * dv_up};
  return truth;
}

constexpr Motion table[] = {
    {"rest", "at rest, body axes along N (gravity)", rest},
    {"turntable", "constant rate about the vertical body z (rate, gravity)", turntable},
    {"coning", "body z goes round a cone (half angle, frequency, gravity)", coning},
    {"spiral", "turn at constant rate with growing speed along body x (rate, acceleration, gravity)", spiral},
    {"boost", "growing thrust along body x, pitching up at constant rate (rate, acceleration, jerk, gravity)", boost},
};

}  // namespace

std::span<const Motion> motions() noexcept { return table; }

const Motion* find_motion(std::string_view name) noexcept {
  for (const Motion& motion : table)
    if (motion.name == name) return &motion;
  return nullptr;
}

}  // namespace imud
