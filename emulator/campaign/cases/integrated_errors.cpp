#include "emulator/campaign/cases/integrated_errors.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <string_view>

namespace imud {

namespace {

// Returns the time after the first measurement until which measurements belong to the instant, which has a number.
Nanoseconds instant_end(std::size_t instant, Nanoseconds every, Nanoseconds half_interval) noexcept {
  return static_cast<std::int64_t>(instant + 1) * every + half_interval;
}

}  // namespace

void MeasuredSums::add(const Measurement& measurement) noexcept {
  fields = measurements == 0 ? measurement.fields : fields & measurement.fields;
  if (measurements++ == 0) return;
  const Sample& sample = measurement.sample;
  delta_angle += sample.delta_angle;
  delta_velocity += sample.delta_velocity;
  rate += sample.rate;
  specific_force += sample.specific_force;
}

void TrueSums::add(const TrueRow& row) noexcept {
  if (sums.measurements++ == 0) {
    first_ns_ = row.time_ns;
    return;
  }
  const auto add = [](Vector3& sum, const std::array<double, 3>& values) {
    sum += Vector3(values[0], values[1], values[2]);
  };
  add(sums.delta_angle, row.values.dtheta);
  add(sums.delta_velocity, row.values.dvel);
  add(sums.rate, row.values.gyro);
  add(sums.specific_force, row.values.accel);
  interval_s = 1e-9 * static_cast<double>(row.time_ns - first_ns_) / static_cast<double>(sums.measurements - 1);
}

TrueSumsOverTime::TrueSumsOverTime(std::span<const TrueRow> rows, Nanoseconds time_step) : every(time_step) {
  for (const TrueRow& row : rows) end.add(row);
  if (every <= Nanoseconds{0} || rows.size() < 2) return;
  half_interval = nanoseconds(end.interval_s / 2);
  const auto ends_before = [&](const TrueRow& row) {
    return Nanoseconds{row.time_ns - rows.front().time_ns} > instant_end(at.size(), every, half_interval);
  };
  TrueSums so_far;
  for (const TrueRow& row : rows) {
    while (ends_before(row)) at.push_back(so_far);
    so_far.add(row);
  }
  const Nanoseconds last{rows.back().time_ns - rows.front().time_ns};
  while (instant_end(at.size(), every, Nanoseconds{0}) <= last + half_interval) at.push_back(end);
}

void MeasuredSumsOverTime::add(const Measurement& measurement, DeviceTime time) noexcept {
  if (end_.measurements == 0) first_ = time;
  while (reached_ < at_.size() && time - first_ > instant_end(reached_, every_, half_interval_))
    at_[reached_++] = end_;
  end_.add(measurement);
}

std::vector<std::pair<std::string, double>> integrated_errors(const MeasuredSums& measured, const TrueSums& truth) {
  std::vector<std::pair<std::string, double>> errors;
  const auto error = [&](Measurement::Field increment, Vector3 MeasuredSums::*increments, Measurement::Field level,
                         Vector3 MeasuredSums::*levels) -> std::optional<Vector3> {
    if ((measured.fields & increment) != 0) return measured.*increments - truth.sums.*increments;
    if ((measured.fields & level) == 0) return std::nullopt;
    return truth.interval_s * (measured.*levels - truth.sums.*levels);
  };
  const auto add = [&](std::string_view name, std::string_view unit, const std::optional<Vector3>& values) {
    for (int axis = 0; values && axis < 3; ++axis)
      if (!std::isnan((*values)[axis]))
        errors.emplace_back(fmt::format("{}_error_{}_{}", name, "xyz"[axis], unit), (*values)[axis]);
  };
  add("angle", "rad",
      error(Measurement::delta_angle, &MeasuredSums::delta_angle, Measurement::rate, &MeasuredSums::rate));
  add("velocity", "m_per_s",
      error(Measurement::delta_velocity, &MeasuredSums::delta_velocity, Measurement::specific_force,
            &MeasuredSums::specific_force));
  return errors;
}

std::vector<std::pair<std::string, double>> integrated_errors(const MeasuredSumsOverTime& measured,
                                                              const TrueSumsOverTime& truth) {
  auto errors = integrated_errors(measured.end(), truth.end);
  for (std::size_t i = 0; i < truth.at.size(); ++i)
    for (auto& [name, error] : integrated_errors(measured.at(i), truth.at[i]))
      errors.emplace_back(fmt::format("{}@{:.12g}", name, static_cast<double>(i + 1) * seconds(truth.every)), error);
  return errors;
}

}  // namespace imud
