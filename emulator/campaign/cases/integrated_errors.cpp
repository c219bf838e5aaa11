#include "emulator/campaign/cases/integrated_errors.hpp"

#include <fmt/format.h>

#include <optional>
#include <string_view>

namespace imud {

void MeasuredSums::add(const Measurement& measurement) noexcept {
  fields = measurements == 0 ? measurement.fields : fields & measurement.fields;
  if (measurements++ == 0) return;
  const Sample& sample = measurement.sample;
  delta_angle += sample.delta_angle;
  delta_velocity += sample.delta_velocity;
  rate += sample.rate;
  specific_force += sample.specific_force;
}

TrueSums::TrueSums(std::span<const TrueRow> rows) noexcept {
  sums.measurements = rows.size();
  if (rows.size() < 2) return;
  const auto add = [](Vector3& sum, const std::array<double, 3>& values) {
    sum += Vector3(values[0], values[1], values[2]);
  };
  for (const TrueRow& row : rows.subspan(1)) {
    add(sums.delta_angle, row.values.dtheta);
    add(sums.delta_velocity, row.values.dvel);
    add(sums.rate, row.values.gyro);
    add(sums.specific_force, row.values.accel);
  }
  interval_s =
      1e-9 * static_cast<double>(rows.back().time_ns - rows.front().time_ns) / static_cast<double>(rows.size() - 1);
}

std::vector<std::pair<std::string, double>> integrated_errors(const MeasuredSums& measured, const TrueSums& truth,
                                                              unsigned absent_rates) {
  std::vector<std::pair<std::string, double>> errors;
  const auto error = [&](Measurement::Field increment, Vector3 MeasuredSums::*increments, Measurement::Field level,
                         Vector3 MeasuredSums::*levels) -> std::optional<Vector3> {
    if ((measured.fields & increment) != 0) return measured.*increments - truth.sums.*increments;
    if ((measured.fields & level) == 0) return std::nullopt;
    return truth.interval_s * (measured.*levels - truth.sums.*levels);
  };
  const auto add = [&](std::string_view name, std::string_view unit, const std::optional<Vector3>& values,
                       unsigned absent) {
    for (int axis = 0; values && axis < 3; ++axis)
      if ((absent >> axis & 1U) == 0)
        errors.emplace_back(fmt::format("{}_error_{}_{}", name, "xyz"[axis], unit), (*values)[axis]);
  };
  add("angle", "rad",
      error(Measurement::delta_angle, &MeasuredSums::delta_angle, Measurement::rate, &MeasuredSums::rate),
      absent_rates);
  add("velocity", "m_per_s",
      error(Measurement::delta_velocity, &MeasuredSums::delta_velocity, Measurement::specific_force,
            &MeasuredSums::specific_force),
      0);
  return errors;
}

}  // namespace imud
