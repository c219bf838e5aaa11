#include "emulator/faults/sensor_fault_kinds.hpp"

#include <algorithm>
#include <iterator>

#include "emulator/faults/fault_kinds.hpp"

namespace imud {
namespace {

constexpr std::string_view triads[] = {"gyro", "accelerometer", "magnetometer", "inclinometer"};
constexpr std::string_view all_sensors[] = {"gyro",         "accelerometer", "magnetometer",
                                            "inclinometer", "barometer",     "temperature"};
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
    {.key = "value", .meaning = "the number of satellites", .min = 0, .max = 99, .is_whole = true}};
constexpr FaultParameter factor_on_accuracy[] = {
    {.key = "factor", .meaning = "on the accuracies; below 1 they promise too much", .min = 0, .max = 1e6}};
constexpr FaultParameter time_step[] = {{.key = "value_s", .meaning = "by which GPS time is off"}};

// Return a kind whose effect has a weight, and a kind whose effect is on or off. The sensors have axes, GNSS has
// none.
constexpr FaultKind ramped(SensorFault code, std::string_view name, std::string_view summary,
                           std::span<const std::string_view> targets,
                           std::span<const FaultParameter> parameters = {}) {
  return {.code = code,
          .name = name,
          .summary = summary,
          .targets = targets,
          .parameters = parameters,
          .has_axes = targets.data() != gnss};
}
constexpr FaultKind sudden(SensorFault code, std::string_view name, std::string_view summary,
                           std::span<const std::string_view> targets,
                           std::span<const FaultParameter> parameters = {}) {
  FaultKind kind = ramped(code, name, summary, targets, parameters);
  kind.is_ramped = false;
  return kind;
}

constexpr FaultKind of_two_axes(FaultKind kind) {
  kind.least_axes = 2;
  return kind;
}

constexpr FaultKind sensor_table[] = {
    ramped(SensorFault::bias, "bias", "a constant is added", all_sensors, added_value),
    sudden(SensorFault::drift, "drift", "an error grows in proportion to time", all_sensors, per_second),
    ramped(SensorFault::scale, "scale", "the value is multiplied", all_sensors, value_factor),
    ramped(SensorFault::more_noise, "noise", "white noise is added", all_sensors, added_noise),
    sudden(SensorFault::stuck, "stuck", "the last value before the fault is sent again and again", all_sensors),
    sudden(SensorFault::stuck_at, "stuck_at", "a constant value is sent", all_sensors, constant_value),
    sudden(SensorFault::dead, "dead", "the value is 0", all_sensors),
    sudden(SensorFault::inverted, "inverted", "the sign is the opposite", triads),
    of_two_axes(sudden(SensorFault::swapped, "swapped",
                       "the values of two axes are exchanged, those of three in a circle", triads)),
    ramped(SensorFault::spike, "spike", "spikes are added at random", all_sensors, random_spikes),
    sudden(SensorFault::saturation, "saturation", "the value is cut off early", triads, limit_at),
    sudden(SensorFault::quantisation, "quantisation", "the value is rounded to a coarse LSB", all_sensors,
           coarse_lsb),
    ramped(SensorFault::vibration, "vibration", "a sine is added, with its integral in the increments", triads,
           added_sine),
    sudden(SensorFault::no_fix, "no_fix", "the position is not known", gnss),
    ramped(SensorFault::position_jump, "jump", "the position is off", gnss, position_offset),
    sudden(SensorFault::position_drift, "drift",
           "the position drifts away, as by slow spoofing, with a velocity that agrees", gnss, drift_of_position),
    sudden(SensorFault::gps_time_jump, "time_jump", "GPS time is off", gnss, time_step),
    sudden(SensorFault::satellites, "satellites", "the receiver uses another number of satellites", gnss,
           satellites_left),
    ramped(SensorFault::accuracy, "accuracy", "the reported accuracies of position and velocity are wrong", gnss,
           factor_on_accuracy),
};
static_assert(has_every_code(sensor_table, static_cast<std::size_t>(SensorFault::count)),
              "the rows stand in the order of the enumeration, one for each value");
static_assert(has_own_names(sensor_table), "a target has two kinds of one name");
static_assert(std::all_of(std::begin(sensor_table), std::end(sensor_table),
                          [](const FaultKind& kind) {
                            return (kind.targets.data() == gnss) ==
                                   (kind.code.as<SensorFault>() >= SensorFault::no_fix);
                          }),
              "from no_fix on the kinds are of gnss, and none before");

}  // namespace

std::span<const FaultKind> sensor_fault_kinds() noexcept { return sensor_table; }

}  // namespace imud
