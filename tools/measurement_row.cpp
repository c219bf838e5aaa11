#include "tools/measurement_row.hpp"

namespace imud {

namespace {

constexpr std::string_view axes = "P: platform (case) axes of the sensor";
constexpr std::string_view device = "the device's own clock";

constexpr MeasurementColumn columns[] = {
    {"time_ns", "i8", 1, "ns", device, "end of the sample's step; the least value (NaT): not carried"},
    {"counter", "u8", 1, "1", device, "number of the sample; the greatest value: not carried"},
    {"gyro", "f8", 3, "rad/s", axes, "measured rate at time_ns"},
    {"accel", "f8", 3, "m/s^2", axes, "measured specific force at time_ns"},
    {"dtheta", "f8", 3, "rad", axes, "measured delta-angle over the step"},
    {"dvel", "f8", 3, "m/s", axes, "measured delta-velocity over the step"},
    {"temperature", "f8", 1, "degC", "", "measured temperature"},
    {"status", "u4", 1, "1", "", "bits of the status; 0: none, or not carried"},
    {"fields", "u4", 1, "1", "",
     "what the frame carries: 1 time, 2 counter, 4 gyro, 8 accel, 16 dtheta, 32 dvel, 64 temperature, 128 status"},
    {"true_gyro", "f8", 3, "rad/s", axes, "true rate at the sample"},
    {"true_accel", "f8", 3, "m/s^2", axes, "true specific force at the sample"},
    {"true_dtheta", "f8", 3, "rad", axes, "true delta-angle over the step"},
    {"true_dvel", "f8", 3, "m/s", axes, "true delta-velocity over the step"},
};
constexpr std::size_t of_truth = 4;

void assign(const Measurement& measurement, std::uint32_t field, const Vector3& values, std::array<double, 3>& out) {
  for (std::size_t axis = 0; axis < out.size(); ++axis)
    out[axis] = (measurement.fields & field) != 0 ? values[static_cast<Eigen::Index>(axis)] : TrueValues::none;
}

}  // namespace

MeasurementRow::MeasurementRow(const Measurement& measurement, unsigned absent_rates) noexcept
    : fields(measurement.fields) {
  const Sample& sample = measurement.sample;
  if ((fields & Measurement::time) != 0) time_ns = sample.time.ns;
  if ((fields & Measurement::counter) != 0) counter = sample.counter;
  assign(measurement, Measurement::rate, sample.rate, gyro);
  assign(measurement, Measurement::specific_force, sample.specific_force, accel);
  assign(measurement, Measurement::delta_angle, sample.delta_angle, dtheta);
  assign(measurement, Measurement::delta_velocity, sample.delta_velocity, dvel);
  for (std::size_t axis = 0; axis < gyro.size(); ++axis)
    if (((absent_rates >> axis) & 1U) != 0) gyro[axis] = TrueValues::none;
  if ((fields & Measurement::temperature) != 0) temperature = sample.temperature_c;
  if ((fields & Measurement::status) != 0) status = sample.status;
}

std::span<const MeasurementColumn> measurement_columns(bool with_truth) noexcept {
  const std::span<const MeasurementColumn> all = columns;
  return with_truth ? all : all.first(all.size() - of_truth);
}

std::size_t row_size(bool with_truth) noexcept {
  return sizeof(MeasurementRow) - (with_truth ? 0 : sizeof(TrueValues));
}
static_assert(sizeof(MeasurementRow) == 128 + sizeof(TrueValues));

}  // namespace imud
