#include "core/earth/earth.hpp"

#include <array>
#include <chrono>
#include <cmath>

#include "core/earth/igrf.hpp"
#include "core/gps_time.hpp"
#include "core/numbers/elementary.hpp"
#include "core/units.hpp"

namespace imud {
namespace {

// WGS 84 (NGA.STND.0036).
using units::wgs84::a, units::wgs84::b, units::wgs84::f;
constexpr double e2 = f * (2.0 - f), second_e2 = e2 / ((1.0 - f) * (1.0 - f));

}  // namespace

Vector3 r_E_of(const Geodetic& place) noexcept {
  const auto [sin_lat, cos_lat] = elementary::sincos(place.latitude);
  const auto [sin_lon, cos_lon] = elementary::sincos(place.longitude);
  const double n = a / std::sqrt(1.0 - e2 * sin_lat * sin_lat), h = place.height;
  return {(n + h) * cos_lat * cos_lon, (n + h) * cos_lat * sin_lon, ((1.0 - e2) * n + h) * sin_lat};
}

// Bowring's iteration on the reduced latitude, from the outside in (Bowring, Survey Review 23, 1976).
Geodetic geodetic_of(const Vector3& r) noexcept {
  const double p = std::sqrt(r.x() * r.x() + r.y() * r.y());
  double sin_beta = r.z(), cos_beta = (1.0 - f) * p, sin = 0, cos = 1;
  for (int i = 0; i < 4; ++i) {
    const double norm = std::sqrt(sin_beta * sin_beta + cos_beta * cos_beta);
    sin_beta /= norm;
    cos_beta /= norm;
    sin = r.z() + second_e2 * b * sin_beta * sin_beta * sin_beta;
    cos = p - e2 * a * cos_beta * cos_beta * cos_beta;
    sin_beta = (1.0 - f) * sin;
    cos_beta = cos;
  }
  const double norm = std::sqrt(sin * sin + cos * cos);
  sin /= norm;
  cos /= norm;
  return {elementary::atan2(sin, cos), elementary::atan2(r.y(), r.x()),
          p * cos + r.z() * sin - a * std::sqrt(1.0 - e2 * sin * sin)};
}

Matrix3 dcm_EL(double latitude, double longitude) noexcept {
  const auto [sin_lat, cos_lat] = elementary::sincos(latitude);
  const auto [sin_lon, cos_lon] = elementary::sincos(longitude);
  Matrix3 m;                                              // north, east, down
  m << -sin_lat * cos_lon, -sin_lon, -cos_lat * cos_lon,  //
      -sin_lat * sin_lon, cos_lon, -cos_lat * sin_lon,    //
      cos_lat, 0.0, -sin_lat;
  return m;
}

double decimal_year(std::int64_t gps_ns) noexcept {
  using std::chrono::sys_days, std::chrono::sys_seconds, std::chrono::year, std::chrono::years;
  const auto now = std::chrono::floor<std::chrono::seconds>(utc_from_gps(gps_ns));
  const year today = std::chrono::year_month_day(std::chrono::floor<std::chrono::days>(now)).year();
  const auto seconds_until = [now](year next) {
    return static_cast<double>((sys_seconds(sys_days(next / 1 / 1)) - now).count());
  };
  const double since = -seconds_until(today), until = seconds_until(today + years(1));
  return static_cast<int>(today) + since / (since + until);
}

double earth_rotation_angle(std::int64_t utc_s) noexcept {
  const double days = static_cast<double>(utc_s - 946'728'000) / 86'400.0;  // since 2000-01-01 12:00
  const double turns = 0.7790572732640 + 0.00273781191135448 * days + (days - std::floor(days));
  return 2.0 * units::pi * (turns - std::floor(turns));
}

double normal_gravity(double latitude, double height) noexcept {
  constexpr double m = 0.00344978650684;
  const double sin = elementary::sincos(latitude).sin, sin2 = sin * sin, up = height / a;
  const double surface = 9.7803253359 * (1 + 0.00193185265241 * sin2) / std::sqrt(1 - f * (2 - f) * sin2);
  return surface * (1 - 2 * (1 + f + m - 2 * f * sin2) * up + 3 * up * up);
}

namespace {

constexpr double atmosphere_radius = 6'356'766.0;  // m

struct Layer {
  double base_m, temperature_k, lapse_k_per_m;

  // The logarithm of the ratio of the pressure at the base to that at `rise` m above it.
  double log_ratio(double rise) const noexcept {
    return lapse_k_per_m == 0 ? k * rise / temperature_k
                              : k / lapse_k_per_m * elementary::log(1.0 + lapse_k_per_m * rise / temperature_k);
  }
  // The inverse of log_ratio(): the rise, m, with this logarithm of the ratio.
  double rise(double log_ratio) const noexcept {
    return lapse_k_per_m == 0
               ? log_ratio * temperature_k / k
               : temperature_k / lapse_k_per_m * (elementary::exp(log_ratio * lapse_k_per_m / k) - 1.0);
  }
  static constexpr double k = 9.80665 * 28.9644e-3 / 8.31432;  // K/m
};
constexpr std::array<Layer, 8> layers = {{{0, 288.15, -6.5e-3},
                                          {11'000, 216.65, 0},
                                          {20'000, 216.65, 1e-3},
                                          {32'000, 228.65, 2.8e-3},
                                          {47'000, 270.65, 0},
                                          {51'000, 270.65, -2.8e-3},
                                          {71'000, 214.65, -2e-3},
                                          {84'852, 186.946, 0}}};
constexpr double sea_level = 101'325.0;  // Pa

}  // namespace

double geopotential_altitude(double height_m) noexcept {
  return atmosphere_radius * height_m / (atmosphere_radius + height_m);
}

double height_of(double geopotential_m) noexcept {
  return atmosphere_radius * geopotential_m / (atmosphere_radius - geopotential_m);
}

double standard_pressure(double geopotential_m) noexcept {
  double log_ratio = 0;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const bool is_last = i + 1 == layers.size() || geopotential_m < layers[i + 1].base_m;
    const double top = is_last ? geopotential_m : layers[i + 1].base_m;
    log_ratio -= layers[i].log_ratio(top - layers[i].base_m);
    if (is_last) break;
  }
  return sea_level * elementary::exp(log_ratio);
}

double standard_altitude(double pressure) noexcept {
  double log_ratio = elementary::log(sea_level / pressure);  // from the base of the layer
  for (std::size_t i = 0;; ++i) {
    const double altitude = layers[i].base_m + layers[i].rise(log_ratio);
    if (i + 1 == layers.size() || altitude < layers[i + 1].base_m) return altitude;
    log_ratio -= layers[i].log_ratio(layers[i + 1].base_m - layers[i].base_m);
  }
}

Earth::Earth(const EarthModel& model)
    : model_(model),
      q_EN_local_(Quaternion(dcm_EL(model.latitude, model.longitude)).normalized()),
      origin_E_(r_E_of({model.latitude, model.longitude, model.height})),
      magnetic_field_(igrf14(decimal_year(model.start_gps_ns))) {}

double angle_between(double angle, double other) noexcept {
  const double turns = (angle - other) / (2.0 * units::pi);
  return 2.0 * units::pi * (turns - std::floor(turns + 0.5));
}

bool Earth::is_local(const PositionVelocity& position) const noexcept {
  return model_.frame == EarthModel::Frame::local && !position.earth_angle;
}

Quaternion Earth::q_NE(const PositionVelocity& position) const noexcept {
  double angle = position.earth_angle.value_or(model_.angle);
  if (model_.frame == EarthModel::Frame::inertial &&
      std::abs(angle_between(angle, model_.angle)) < EarthModel::largest_angle_error)
    angle = model_.angle;
  const double t = seconds(position.time - TruthTime{});
  const double turns = (angle + units::earth_rate * t) / (2.0 * units::pi);
  const auto [sin, cos] = elementary::sincos(units::pi * (turns - std::floor(turns)));
  return {cos, 0.0, 0.0, sin};
}

namespace {

// Sets latitude, longitude and height of a position in E.
void set_place(Navigation& navigation) {
  const Geodetic place = geodetic_of(navigation.r_E);
  navigation.latitude = place.latitude;
  navigation.longitude = place.longitude;
  navigation.height = place.height;
}

}  // namespace

void move(Navigation& navigation, const Vector3& offset_L) noexcept {
  navigation.r_E += dcm_EL(navigation.latitude, navigation.longitude) * offset_L;
  set_place(navigation);
}

Vector3 r_L_from_origin(const Navigation& navigation) noexcept {
  const Geodetic& origin = navigation.origin;
  return dcm_EL(origin.latitude, origin.longitude).transpose() * (navigation.r_E - r_E_of(origin));
}

std::optional<Geodetic> Earth::origin(const PositionVelocity& first) const noexcept {
  if (is_local(first)) return Geodetic{model_.latitude, model_.longitude, model_.height};
  const Navigation place = navigation(first);
  if (!place.is_known) return std::nullopt;
  return Geodetic{place.latitude, place.longitude, place.height};
}

Navigation Earth::navigation(const PositionVelocity& position) const noexcept {
  Navigation navigation;
  if (!is_on() || !position.is_known || (is_automatic() && !position.earth_angle)) return navigation;
  if (is_local(position)) {
    navigation.r_E = origin_E_ + q_EN_local_ * position.r_N;
    navigation.v_L = q_EN_local_ * position.v_N;
  } else {
    const Quaternion q_EN = q_NE(position).conjugate();
    navigation.r_E = q_EN * position.r_N;
    navigation.v_L = q_EN * position.v_N - Vector3(0, 0, units::earth_rate).cross(navigation.r_E);
  }
  constexpr double deepest = 6'256'000.0;
  if (!(navigation.r_E.squaredNorm() > deepest * deepest)) return Navigation{};
  navigation.is_known = true;
  navigation.gps_ns = model_.start_gps_ns + (position.time - TruthTime{}).count();
  set_place(navigation);
  navigation.v_L = dcm_EL(navigation.latitude, navigation.longitude).transpose() * navigation.v_L;
  return navigation;
}

PositionVelocity Earth::position_velocity(const Navigation& navigation, TruthTime time,
                                          std::optional<double> earth_angle) const noexcept {
  PositionVelocity position = {.is_known = true, .time = time, .earth_angle = earth_angle};
  const Vector3 v_E = dcm_EL(navigation.latitude, navigation.longitude) * navigation.v_L;
  if (is_local(position)) {
    position.r_N = q_EN_local_.conjugate() * (navigation.r_E - origin_E_);
    position.v_N = q_EN_local_.conjugate() * v_E;
  } else {
    const Quaternion q = q_NE(position);
    position.r_N = q * navigation.r_E;
    position.v_N = q * Vector3(v_E + Vector3(0, 0, units::earth_rate).cross(navigation.r_E));
  }
  return position;
}

Quaternion Earth::q_LN(const PositionVelocity& position, const Navigation& navigation) const noexcept {
  const Quaternion q_LE(dcm_EL(navigation.latitude, navigation.longitude).transpose());
  return q_LE * (is_local(position) ? q_EN_local_ : q_NE(position).conjugate());
}

Vector3 Earth::magnetic_field_L(const Navigation& navigation) const noexcept {
  return dcm_EL(navigation.latitude, navigation.longitude).transpose() * magnetic_field_.at(navigation.r_E);
}

}  // namespace imud
