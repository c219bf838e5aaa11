#include "core/gnss/sky.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/earth/earth.hpp"
#include "core/numbers/elementary.hpp"

namespace imud {
namespace {

constexpr int unknowns = 4;  // north, east, down, and the receiver's clock

double elevation(const Vector3& line_L) {
  return elementary::atan2(-line_L.z(), std::sqrt(std::max(0.0, 1 - line_L.z() * line_L.z())));
}

}  // namespace

Sky::Sky(const GnssModel& model)
    : orbits_(model.almanac),
      sine_of_mask_(elementary::sincos(model.mask).sin),
      multipath_(model.multipath),
      multipath_ns_(nanoseconds(model.multipath_s).count()) {
  satellites_.reserve(model.almanac.size());
  seen_.reserve(model.almanac.size());
}

void Sky::place_satellites(std::int64_t gps_ns) noexcept {
  satellites_.clear();
  const auto away = [gps_ns](const AlmanacOrbit& orbit) { return std::abs(gps_ns - orbit.reference_ns); };
  for (auto orbit = orbits_.begin(); orbit != orbits_.end();) {
    auto nearest = orbit;
    const int prn = orbit->prn;
    for (; orbit != orbits_.end() && orbit->prn == prn; ++orbit)
      if (away(*orbit) < away(*nearest)) nearest = orbit;
    if (nearest->is_healthy) satellites_.push_back({prn, satellite_E(*nearest, gps_ns)});
  }
}

bool Sky::look(Navigation& navigation) noexcept {
  constexpr std::int64_t ns_per_s = 1'000'000'000;
  gps_ns_ = navigation.gps_ns;
  if (const std::int64_t second = gps_ns_ / ns_per_s; second != second_) {
    second_ = second;
    place_satellites(second * ns_per_s);
  }
  const Matrix3 dcm_LE = dcm_EL(navigation.latitude, navigation.longitude).transpose();
  seen_.clear();
  double normal[unknowns][unknowns] = {};
  for (const Placed& satellite : satellites_) {
    const Vector3 line_L = (dcm_LE * (satellite.r_E - navigation.r_E)).normalized();
    if (-line_L.z() < sine_of_mask_) continue;
    seen_.push_back({satellite.prn, line_L});
    const double row[unknowns] = {-line_L.x(), -line_L.y(), -line_L.z(), 1};
    for (int r = 0; r < unknowns; ++r)
      for (int c = 0; c <= r; ++c) normal[r][c] += row[r] * row[c];
  }
  if (seen_.size() < unknowns) return false;
  auto& l = root_.at;
  for (int c = 0; c < unknowns; ++c) {
    for (int r = c; r < unknowns; ++r) {
      double sum = normal[r][c];
      for (int k = 0; k < c; ++k) sum -= l[r][k] * l[c][k];
      constexpr double least = 1e-6;  // a smaller pivot means a dilution above 1000
      if (r == c && sum < least) return false;
      l[r][c] = r == c ? std::sqrt(sum) : sum / l[c][c];
    }
  }
  // The diagonal of the inverse: sums of squares of the columns of the inverse of L.
  double variance[unknowns] = {};
  for (int c = 0; c < unknowns; ++c) {
    double column[unknowns] = {};
    for (int r = c; r < unknowns; ++r) {
      double sum = r == c ? 1 : 0;
      for (int k = c; k < r; ++k) sum -= l[r][k] * column[k];
      column[r] = sum / l[r][r];
      variance[c] += column[r] * column[r];
    }
  }
  const double horizontal2 = variance[0] + variance[1], position2 = horizontal2 + variance[2];
  const auto root = [](double square) { return static_cast<float>(std::sqrt(square)); };
  navigation.dilution = {.geometric = root(position2 + variance[3]),
                         .position = root(position2),
                         .horizontal = root(horizontal2),
                         .vertical = root(variance[2]),
                         .time = root(variance[3]),
                         .north = root(variance[0]),
                         .east = root(variance[1])};
  navigation.satellites = static_cast<std::uint8_t>(seen_.size());
  navigation.accuracy_factor *= static_cast<float>(std::sqrt(position2) / GnssModel::nominal_dilution);
  return true;
}

Vector3 Sky::displacement(const Normals& normals) const noexcept {
  if (multipath_ == 0) return Vector3::Zero();
  constexpr double scale = 10 * units::degree;
  constexpr std::int64_t most_satellites = 64;
  double x[unknowns] = {};
  for (const Seen& one : seen_) {
    // The errors of different satellites change at different times.
    const std::int64_t index = (gps_ns_ + one.prn * (multipath_ns_ / most_satellites)) / multipath_ns_;
    const double deviate =
        normals(Quantity::position, Process::multipath, static_cast<std::uint64_t>(most_satellites * index + one.prn))
            .x();
    const double error = multipath_ * elementary::exp(-elevation(one.line_L) / scale) * deviate;
    const double row[unknowns] = {-one.line_L.x(), -one.line_L.y(), -one.line_L.z(), 1};
    for (int r = 0; r < unknowns; ++r) x[r] += row[r] * error;
  }
  const auto& l = root_.at;
  for (int r = 0; r < unknowns; ++r) {
    for (int k = 0; k < r; ++k) x[r] -= l[r][k] * x[k];
    x[r] /= l[r][r];
  }
  for (int r = unknowns - 1; r >= 0; --r) {
    for (int k = r + 1; k < unknowns; ++k) x[r] -= l[k][r] * x[k];
    x[r] /= l[r][r];
  }
  return {x[0], x[1], x[2]};
}

}  // namespace imud
