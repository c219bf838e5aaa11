#include "emulator/faults/sensor_faults.hpp"

#include <algorithm>
#include <cmath>

#include "core/earth/earth.hpp"
#include "core/effects/saturation.hpp"
#include "core/numbers/elementary.hpp"
#include "core/numbers/round_to.hpp"
#include "core/units.hpp"
#include "emulator/faults/sensor_fault_kinds.hpp"

namespace imud {
namespace {

// Returns the deviates of the white noise of a sample, one for each axis.
Vector3 deviates(const Normals& normals, std::uint64_t k) noexcept {
  return normals(Quantity::rate, Process::fault_noise, k);
}

// Returns the change of a polynomial without constant term from T - T0 = a to b; column j - 1 has the coefficients of
// degree j.
Vector3 change(const Matrix3& coefficients, double a, double b) noexcept {
  return coefficients.col(0) * (b - a) + coefficients.col(1) * (b * b - a * a) +
         coefficients.col(2) * (b * b * b - a * a * a);
}

}  // namespace

SensorFaults::SensorFaults(const ImuModel& model, std::span<const Normals> normals)
    : model_(model), normals_(normals), held_(normals.size()) {}

void SensorFaults::apply(std::span<const ActiveFault> faults, std::uint64_t k, double step_s,
                         Sample& sample) noexcept {
  const double internal_s = 1.0 / (model_.internal_samples * model_.rate_hz);
  const auto white = [internal_s](const TriadErrors& errors) {
    const double sigma = errors.white_density.x() / std::sqrt(internal_s);
    // The memo's process (GaussMarkov) without memory is white noise, too.
    return errors.walk_transition.isZero(0.0) ? std::sqrt(sigma * sigma + errors.walk_sqrt_cov.row(0).squaredNorm())
                                              : sigma;
  };
  const bool is_first = !has_last_;
  for (const ActiveFault& fault : faults) {
    Output& held = held_[fault.number];
    if (is_first) remember(sample);
    if (fault.since == 0) held = last_;
    if (sensor_fault_of(*fault.kind) >= SensorFault::no_fix) {
      apply_to_gnss(fault, sample);
      continue;
    }
    // The targets. Without inclinometers their place is taken by values that no fault changes.
    const TriadErrors& inclinometer = model_.inclinometer ? *model_.inclinometer : model_.accelerometer;
    Vector3 no_inclination = Vector3::Zero();
    Vector3& inclination = sample.inclination ? *sample.inclination : no_inclination;
    Triad triads[] = {{&sample.rate, &sample.delta_angle, model_.gyro, white(model_.gyro), status::gyro_saturated_x},
                      {&sample.specific_force, &sample.delta_velocity, model_.accelerometer,
                       white(model_.accelerometer), status::accelerometer_saturated_x},
                      {&sample.magnetic_field, nullptr, model_.magnetometer, white(model_.magnetometer), 0},
                      {&inclination, nullptr, inclinometer, white(inclinometer), status::inclinometer_saturated_x}};
    const Vector3* const lasts[] = {&held.rate, &held.specific_force, &held.magnetic_field, &held.inclination};
    const bool has_field = sample.navigation.is_known || !sample.magnetic_field.isZero(0.0);
    const bool is_measured[] = {true, true, has_field, sample.inclination.has_value()};
    constexpr std::size_t magnetometer = 2, barometer = 4;
    if (fault.target < barometer) {
      if (is_measured[fault.target])
        apply_to_triad(fault, k, step_s, *lasts[fault.target], triads[fault.target], sample);
    } else if (fault.target == barometer) {
      apply_to_number(fault, k, held.pressure, sample.pressure);
      sample.pressure = std::max(0.0, sample.pressure);
    } else {
      const double before = sample.temperature_c;
      apply_to_number(fault, k, held.temperature_c, sample.temperature_c);
      for (Triad& triad : triads) {
        if (&triad == &triads[magnetometer] || !is_measured[&triad - triads]) continue;
        const double a = before - triad.errors.reference_temperature_c;
        const double b = sample.temperature_c - triad.errors.reference_temperature_c;
        const Vector3 added_value = change(triad.errors.temperature_bias, a, b) +
                                    change(triad.errors.temperature_scale, a, b).cwiseProduct(*triad.value);
        if (added_value.isZero(0.0)) continue;
        if (triad.increment != nullptr) *triad.increment += step_s * added_value;
        *triad.value += added_value;
        limit(triad, 7, sample, step_s);
      }
    }
  }
  remember(sample);
}

void SensorFaults::apply_to_triad(const ActiveFault& fault, std::uint64_t k, double step_s, const Vector3& last,
                                  Triad& triad, Sample& sample) noexcept {
  Vector3& value = *triad.value;
  const Vector3 before = value;
  const Vector3 increment = triad.increment != nullptr ? *triad.increment : Vector3::Zero();
  Vector3 after = value, other = increment;
  const double p = fault.parameters[0], w = fault.weight;
  const Normals& normals = normals_[fault.number];
  const auto add = [&](const Vector3& change) {
    after = before + change;
    other = increment + step_s * change;
  };
  const auto hold = [&](const Vector3& constant_value) {
    after = constant_value;
    other = step_s * constant_value;
  };
  switch (sensor_fault_of(*fault.kind)) {
    case SensorFault::bias:
      add(Vector3::Constant(w * p));
      break;
    case SensorFault::drift:
      after = before + Vector3::Constant(p * fault.since_s);
      // Adds the integral of the drift over the step, which may begin before the fault.
      other = increment + Vector3::Constant(fault.since > 0 ? step_s * p * (fault.since_s - 0.5 * step_s) : 0.0);
      break;
    case SensorFault::scale:
      after = (1 + w * (p - 1)) * before;
      other = (1 + w * (p - 1)) * increment;
      break;
    case SensorFault::more_noise: {
      const double own = std::sqrt(std::max(0.0, p * p - 1)) * triad.white_sigma;
      const double sigma = std::sqrt(own * own + fault.parameters[1] * fault.parameters[1]);
      add(w * sigma * deviates(normals, k));
      break;
    }
    case SensorFault::stuck:
      hold(last);
      break;
    case SensorFault::stuck_at:
      hold(Vector3::Constant(p));
      break;
    case SensorFault::dead:
      hold(Vector3::Zero());
      break;
    case SensorFault::inverted:
      after = -before;
      other = -increment;
      break;
    case SensorFault::swapped: {
      // Each selected axis has the value of the next selected one.
      for (int axis = 0; axis < 3; ++axis) {
        if (((fault.axes >> axis) & 1U) == 0) continue;
        int next = axis;
        do next = (next + 1) % 3;
        while (((fault.axes >> next) & 1U) == 0);
        after[axis] = before[next];
        other[axis] = increment[next];
      }
      break;
    }
    case SensorFault::spike: {
      Vector3 heights = Vector3::Zero();
      const double probability = std::min(1.0, fault.parameters[1] / model_.rate_hz);
      for (int axis = 0; axis < 3; ++axis) {
        // One uniform deviate says whether there is a spike, and of which sign.
        const double u = normals.uniform(Quantity::rate, Process::fault_noise, 3 * k + static_cast<unsigned>(axis));
        if (u < probability) heights[axis] = u < 0.5 * probability ? w * p : -w * p;
      }
      add(heights);
      break;
    }
    case SensorFault::saturation:
      for (int axis = 0; axis < 3; ++axis)
        if (limit_axis({Vector3::Constant(-p), Vector3::Constant(p)}, axis, step_s, after, other) &&
            ((fault.axes >> axis) & 1U) != 0)
          sample.status |= triad.saturated << axis;
      break;
    case SensorFault::quantisation:
      for (int axis = 0; axis < 3; ++axis) {
        after[axis] = round_to(before[axis], p);
        other[axis] = increment[axis] + step_s * (after[axis] - before[axis]);
      }
      break;
    case SensorFault::vibration: {
      const double omega = 2 * units::pi * fault.parameters[1], begin_s = std::max(0.0, fault.since_s - step_s);
      after = before + Vector3::Constant(w * p * elementary::sincos(omega * fault.since_s).sin);
      other = increment + Vector3::Constant(w * p / omega *
                                            (elementary::sincos(omega * begin_s).cos -
                                             elementary::sincos(omega * fault.since_s).cos));
      break;
    }
    case SensorFault::no_fix:
    case SensorFault::position_jump:
    case SensorFault::position_drift:
    case SensorFault::gps_time_jump:
    case SensorFault::satellites:
    case SensorFault::accuracy:
    case SensorFault::count:
      return;
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (((fault.axes >> axis) & 1U) == 0) continue;
    value[axis] = after[axis];
    if (triad.increment != nullptr && step_s > 0) (*triad.increment)[axis] = other[axis];
  }
  limit(triad, fault.axes, sample, step_s);
}

// Rounds to the nearest LSB and limits to the range. A value within the range and on the grid stays as it is.
void SensorFaults::limit(Triad& triad, unsigned axes, Sample& sample, double step_s) noexcept {
  Vector3& value = *triad.value;
  Vector3 none = Vector3::Zero();
  Vector3& increment = triad.increment != nullptr && step_s > 0 ? *triad.increment : none;
  const AxisLimits range = triad.errors.range();
  for (int axis = 0; axis < 3; ++axis) {
    if (((axes >> axis) & 1U) == 0) continue;
    if (triad.errors.lsb > 0) {
      const double rounded = round_to(value[axis], triad.errors.lsb);
      if (triad.errors.increment_lsb <= 0) increment[axis] += step_s * (rounded - value[axis]);
      value[axis] = rounded;
    }
    if (limit_axis(range, axis, step_s, value, increment)) sample.status |= triad.saturated << axis;
  }
}

void SensorFaults::apply_to_number(const ActiveFault& fault, std::uint64_t k, double last, double& value) noexcept {
  const double p = fault.parameters[0], w = fault.weight;
  const Normals& normals = normals_[fault.number];
  switch (sensor_fault_of(*fault.kind)) {
    case SensorFault::bias:
      value += w * p;
      break;
    case SensorFault::drift:
      value += p * fault.since_s;
      break;
    case SensorFault::scale:
      value *= 1 + w * (p - 1);
      break;
    case SensorFault::more_noise:
      value += w * fault.parameters[1] * deviates(normals, k).x();
      break;
    case SensorFault::stuck:
      value = last;
      break;
    case SensorFault::stuck_at:
      value = p;
      break;
    case SensorFault::dead:
      value = 0;
      break;
    case SensorFault::spike: {
      const double probability = std::min(1.0, fault.parameters[1] / model_.rate_hz);
      const double u = normals.uniform(Quantity::rate, Process::fault_noise, 3 * k);
      if (u < probability) value += u < 0.5 * probability ? w * p : -w * p;
      break;
    }
    case SensorFault::quantisation:
      value = round_to(value, p);
      break;
    case SensorFault::inverted:
    case SensorFault::swapped:
    case SensorFault::saturation:
    case SensorFault::vibration:
    case SensorFault::no_fix:
    case SensorFault::position_jump:
    case SensorFault::position_drift:
    case SensorFault::gps_time_jump:
    case SensorFault::satellites:
    case SensorFault::accuracy:
    case SensorFault::count:
      break;
  }
}

void SensorFaults::apply_to_gnss(const ActiveFault& fault, Sample& sample) noexcept {
  if (!sample.navigation.is_known) return;
  const Vector3 p(fault.parameters[0], fault.parameters[1], fault.parameters[2]);
  switch (sensor_fault_of(*fault.kind)) {
    case SensorFault::no_fix:
      sample.navigation = {};
      break;
    case SensorFault::position_jump:
      move(sample.navigation, fault.weight * p);
      break;
    case SensorFault::position_drift:
      move(sample.navigation, fault.since_s * p);
      sample.navigation.v_L += p;
      break;
    case SensorFault::gps_time_jump:
      sample.navigation.gps_ns += static_cast<std::int64_t>(1e9 * p.x());
      break;
    case SensorFault::satellites:
      sample.navigation.satellites = static_cast<std::uint8_t>(p.x());
      break;
    case SensorFault::accuracy:
      sample.navigation.accuracy_factor *= static_cast<float>(1 + fault.weight * (p.x() - 1));
      break;
    case SensorFault::bias:
    case SensorFault::drift:
    case SensorFault::scale:
    case SensorFault::more_noise:
    case SensorFault::stuck:
    case SensorFault::stuck_at:
    case SensorFault::dead:
    case SensorFault::inverted:
    case SensorFault::swapped:
    case SensorFault::spike:
    case SensorFault::saturation:
    case SensorFault::quantisation:
    case SensorFault::vibration:
    case SensorFault::count:
      break;
  }
}

}  // namespace imud
