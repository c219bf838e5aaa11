#include "emulator/faults/sensor_fault_kinds.hpp"

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
constexpr FaultParameter per_second[] = {value_of("the slope, by which the error grows in each second")};
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
    {.name = "bias",
     .summary = "a constant is added",
     .targets = all_sensors,
     .parameters = added_value,
     .has_axes = true},
    {.name = "drift",
     .summary = "an error grows in proportion to time",
     .targets = all_sensors,
     .parameters = per_second,
     .has_axes = true,
     .is_ramped = false},
    {.name = "scale",
     .summary = "the value is multiplied",
     .targets = all_sensors,
     .parameters = value_factor,
     .has_axes = true},
    {.name = "noise",
     .summary = "white noise is added",
     .targets = all_sensors,
     .parameters = added_noise,
     .has_axes = true},
    {.name = "stuck",
     .summary = "the last value before the fault is sent again and again",
     .targets = all_sensors,
     .has_axes = true,
     .is_ramped = false},
    {.name = "stuck_at",
     .summary = "a constant value is sent",
     .targets = all_sensors,
     .parameters = constant_value,
     .has_axes = true,
     .is_ramped = false},
    {.name = "dead", .summary = "the value is 0", .targets = all_sensors, .has_axes = true, .is_ramped = false},
    {.name = "inverted",
     .summary = "the sign is the opposite",
     .targets = triads,
     .has_axes = true,
     .is_ramped = false},
    {.name = "swapped",
     .summary = "the values of two axes are exchanged, those of three in a circle",
     .targets = triads,
     .has_axes = true,
     .is_ramped = false},
    {.name = "spike",
     .summary = "spikes are added at random",
     .targets = all_sensors,
     .parameters = random_spikes,
     .has_axes = true},
    {.name = "saturation",
     .summary = "the value is cut off early",
     .targets = triads,
     .parameters = limit_at,
     .has_axes = true,
     .is_ramped = false},
    {.name = "quantisation",
     .summary = "the value is rounded to a coarse LSB",
     .targets = all_sensors,
     .parameters = coarse_lsb,
     .has_axes = true,
     .is_ramped = false},
    {.name = "vibration",
     .summary = "a sine is added, with its integral in the increments",
     .targets = triads,
     .parameters = added_sine,
     .has_axes = true},
    {.name = "no_fix", .summary = "the position is not known", .targets = gnss, .is_ramped = false},
    {.name = "jump", .summary = "the position is off", .targets = gnss, .parameters = position_offset},
    {.name = "drift",
     .summary = "the position drifts away, as by slow spoofing, with a velocity that agrees",
     .targets = gnss,
     .parameters = drift_of_position,
     .is_ramped = false},
    {.name = "time_jump", .summary = "GPS time is off", .targets = gnss, .parameters = time_step, .is_ramped = false},
    {.name = "satellites",
     .summary = "the receiver uses another number of satellites",
     .targets = gnss,
     .parameters = satellites_left,
     .is_ramped = false},
    {.name = "accuracy",
     .summary = "the reported accuracies of position and velocity are wrong",
     .targets = gnss,
     .parameters = factor_on_accuracy},
};
static_assert(std::size(sensor_table) == static_cast<std::size_t>(SensorFault::count));

}  // namespace

std::span<const FaultKind> sensor_fault_kinds() noexcept { return sensor_table; }

SensorFault sensor_fault_of(const FaultKind& kind) noexcept { return static_cast<SensorFault>(&kind - sensor_table); }

}  // namespace imud
