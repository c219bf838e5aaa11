#include "emulator/faults/sensor_fault_kinds.hpp"

#include <algorithm>
#include <iterator>

#include "emulator/faults/fault_kinds.hpp"

namespace imud {
namespace {

constexpr std::string_view triads[] = {"gyro", "accelerometer", "magnetometer"};
constexpr std::string_view all_sensors[] = {"gyro", "accelerometer", "magnetometer", "barometer", "temperature"};
constexpr std::string_view gnss[] = {"gnss"};

constexpr FaultParameter value_of(std::string_view meaning) {
  return {.key = "value", .meaning = meaning, .has_targets_unit = true};
}
constexpr FaultParameter added_value[] = {value_of("what is added")};
constexpr FaultParameter per_second[] = {{.key = "value",
                                          .meaning = "the slope, by which the error grows in each second",
                                          .has_targets_unit = true,
                                          .is_per_s = true}};
constexpr FaultParameter value_factor[] = {{.key = "value", .meaning = "the factor on the value"}};
constexpr FaultParameter added_noise[] = {
    {.key = "factor", .meaning = "by which the sensor's own white noise grows", .initial = 1, .min = 1},
    {.key = "value",
     .meaning = "standard deviation of white noise of a sample that is added",
     .initial = 0,
     .min = 0,
     .has_targets_unit = true}};
constexpr FaultParameter constant_value[] = {value_of("the value that is sent")};
constexpr FaultParameter random_spikes[] = {
    value_of("the height of a spike, of either sign"),
    {.key = "per_s", .meaning = "spikes on each axis in a second, on average", .min = 0}};
constexpr FaultParameter limit_at[] = {
    {.key = "value", .meaning = "the magnitude at which the value is cut off", .min = 0, .has_targets_unit = true}};
constexpr FaultParameter coarse_lsb[] = {
    {.key = "value", .meaning = "the LSB", .min = 1e-300, .has_targets_unit = true}};
constexpr FaultParameter added_sine[] = {value_of("the amplitude"),
                                         {.key = "hz", .meaning = "the frequency", .min = 1e-6, .max = 1e6}};
constexpr FaultParameter position_offset[] = {
    {.key = "north_m", .meaning = "by which the position is off, to the north", .initial = 0},
    {.key = "east_m", .meaning = "to the east", .initial = 0},
    {.key = "down_m", .meaning = "downwards", .initial = 0}};
constexpr FaultParameter drift_of_position[] = {
    {.key = "north_m_per_s", .meaning = "the speed at which the position drifts to the north", .initial = 0},
    {.key = "east_m_per_s", .meaning = "to the east", .initial = 0},
    {.key = "down_m_per_s", .meaning = "downwards", .initial = 0}};
constexpr FaultParameter satellites_left[] = {
    {.key = "value", .meaning = "the number of satellites", .min = 0, .max = 99}};
constexpr FaultParameter factor_on_accuracy[] = {
    {.key = "factor", .meaning = "on the accuracies; below 1 they promise too much", .min = 0, .max = 1e6}};
constexpr FaultParameter time_step[] = {{.key = "value_s", .meaning = "by which GPS time is off"}};

constexpr FaultKind sensor_table[] = {
    {.code = SensorFault::bias,
     .name = "bias",
     .summary = "a constant is added",
     .targets = all_sensors,
     .parameters = added_value,
     .has_axes = true},
    {.code = SensorFault::drift,
     .name = "drift",
     .summary = "an error grows in proportion to time",
     .targets = all_sensors,
     .parameters = per_second,
     .has_axes = true,
     .is_ramped = false},
    {.code = SensorFault::scale,
     .name = "scale",
     .summary = "the value is multiplied",
     .targets = all_sensors,
     .parameters = value_factor,
     .has_axes = true},
    {.code = SensorFault::more_noise,
     .name = "noise",
     .summary = "white noise is added",
     .targets = all_sensors,
     .parameters = added_noise,
     .has_axes = true},
    {.code = SensorFault::stuck,
     .name = "stuck",
     .summary = "the last value before the fault is sent again and again",
     .targets = all_sensors,
     .has_axes = true,
     .is_ramped = false},
    {.code = SensorFault::stuck_at,
     .name = "stuck_at",
     .summary = "a constant value is sent",
     .targets = all_sensors,
     .parameters = constant_value,
     .has_axes = true,
     .is_ramped = false},
    {.code = SensorFault::dead,
     .name = "dead",
     .summary = "the value is 0",
     .targets = all_sensors,
     .has_axes = true,
     .is_ramped = false},
    {.code = SensorFault::inverted,
     .name = "inverted",
     .summary = "the sign is the opposite",
     .targets = triads,
     .has_axes = true,
     .is_ramped = false},
    {.code = SensorFault::swapped,
     .name = "swapped",
     .summary = "the values of two axes are exchanged, those of three in a circle",
     .targets = triads,
     .has_axes = true,
     .is_ramped = false},
    {.code = SensorFault::spike,
     .name = "spike",
     .summary = "spikes are added at random",
     .targets = all_sensors,
     .parameters = random_spikes,
     .has_axes = true},
    {.code = SensorFault::saturation,
     .name = "saturation",
     .summary = "the value is cut off early",
     .targets = triads,
     .parameters = limit_at,
     .has_axes = true,
     .is_ramped = false},
    {.code = SensorFault::quantisation,
     .name = "quantisation",
     .summary = "the value is rounded to a coarse LSB",
     .targets = all_sensors,
     .parameters = coarse_lsb,
     .has_axes = true,
     .is_ramped = false},
    {.code = SensorFault::vibration,
     .name = "vibration",
     .summary = "a sine is added, with its integral in the increments",
     .targets = triads,
     .parameters = added_sine,
     .has_axes = true},
    {.code = SensorFault::no_fix,
     .name = "no_fix",
     .summary = "the position is not known",
     .targets = gnss,
     .is_ramped = false},
    {.code = SensorFault::position_jump,
     .name = "jump",
     .summary = "the position is off",
     .targets = gnss,
     .parameters = position_offset},
    {.code = SensorFault::position_drift,
     .name = "drift",
     .summary = "the position drifts away, as by slow spoofing, with a velocity that agrees",
     .targets = gnss,
     .parameters = drift_of_position,
     .is_ramped = false},
    {.code = SensorFault::gps_time_jump,
     .name = "time_jump",
     .summary = "GPS time is off",
     .targets = gnss,
     .parameters = time_step,
     .is_ramped = false},
    {.code = SensorFault::satellites,
     .name = "satellites",
     .summary = "the receiver uses another number of satellites",
     .targets = gnss,
     .parameters = satellites_left,
     .is_ramped = false},
    {.code = SensorFault::accuracy,
     .name = "accuracy",
     .summary = "the reported accuracies of position and velocity are wrong",
     .targets = gnss,
     .parameters = factor_on_accuracy},
};
static_assert(has_every_code(sensor_table, static_cast<std::size_t>(SensorFault::count)));
static_assert(std::all_of(std::begin(sensor_table), std::end(sensor_table), [](const FaultKind& kind) {
  return (kind.targets.data() == gnss) == (kind.code.as<SensorFault>() >= SensorFault::no_fix);
}));

}  // namespace

std::span<const FaultKind> sensor_fault_kinds() noexcept { return sensor_table; }

}  // namespace imud
