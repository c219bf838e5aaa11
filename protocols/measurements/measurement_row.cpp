#include "protocols/measurements/measurement_row.hpp"

namespace imud {
namespace {

constexpr std::string_view platform_axes = "P: platform (case) axes of the sensor";
constexpr std::string_view device_clock = "the device's own clock";

constexpr MeasurementColumn row_columns[] = {
    {"time_ns", "i8", 1, "ns", device_clock, "end of the sample's step; the least value (NaT): not carried"},
    {"counter", "u8", 1, "1", device_clock, "number of the sample; the greatest value: not carried"},
    {"gyro", "f8", 3, "rad/s", platform_axes, "measured rate at time_ns"},
    {"accel", "f8", 3, "m/s^2", platform_axes, "measured specific force at time_ns"},
    {"dtheta", "f8", 3, "rad", platform_axes, "measured delta-angle over the step"},
    {"dvel", "f8", 3, "m/s", platform_axes, "measured delta-velocity over the step"},
    {"temperature", "f8", 1, "degC", "", "measured temperature"},
    {"status", "u4", 1, "1", "", "bits of the status; 0: none, or not carried"},
    {"fields", "u4", 1, "1", "",
     "what the frame carries: 1 time, 2 counter, 4 gyro, 8 accel, 16 dtheta, 32 dvel, 64 temperature, 128 status"},
    {"true_gyro", "f8", 3, "rad/s", platform_axes, "true rate at the sample"},
    {"true_accel", "f8", 3, "m/s^2", platform_axes, "true specific force at the sample"},
    {"true_dtheta", "f8", 3, "rad", platform_axes, "true delta-angle over the step"},
    {"true_dvel", "f8", 3, "m/s", platform_axes, "true delta-velocity over the step"},
};
constexpr std::size_t of_truth = 4;
constexpr auto true_columns = [] {
  std::array<MeasurementColumn, 1 + of_truth> all{row_columns[0]};
  for (std::size_t i = 0; i < of_truth; ++i) all[1 + i] = row_columns[std::size(row_columns) - of_truth + i];
  return all;
}();

void take_values(const Measurement& measurement, std::uint32_t field, const Vector3& values,
                 std::array<double, 3>& out) {
  for (std::size_t axis = 0; axis < out.size(); ++axis)
    out[axis] = (measurement.fields & field) != 0 ? values[static_cast<Eigen::Index>(axis)] : TrueValues::none;
}

}  // namespace

MeasurementRow::MeasurementRow(const Measurement& measurement) noexcept : fields(measurement.fields) {
  const Sample& sample = measurement.sample;
  if ((fields & Measurement::time) != 0) time_ns = sample.time.ns;
  if ((fields & Measurement::counter) != 0) counter = sample.counter;
  take_values(measurement, Measurement::rate, sample.rate, gyro);
  take_values(measurement, Measurement::specific_force, sample.specific_force, accel);
  take_values(measurement, Measurement::delta_angle, sample.delta_angle, dtheta);
  take_values(measurement, Measurement::delta_velocity, sample.delta_velocity, dvel);
  if ((fields & Measurement::temperature) != 0) temperature = sample.temperature_c;
  if ((fields & Measurement::status) != 0) status = sample.status;
}

std::span<const MeasurementColumn> measurement_columns(bool with_truth) noexcept {
  const std::span<const MeasurementColumn> all = row_columns;
  return with_truth ? all : all.first(all.size() - of_truth);
}

std::span<const MeasurementColumn> truth_columns() noexcept { return true_columns; }

std::size_t row_size(bool with_truth) noexcept {
  return sizeof(MeasurementRow) - (with_truth ? 0 : sizeof(TrueValues));
}
static_assert(sizeof(MeasurementRow) == 128 + sizeof(TrueValues));

}  // namespace imud
