// The values of the objects that are measurements.
#pragma once

#include <cstdint>
#include <optional>

#include "core/sample.hpp"
#include "protocols/canopen/object_dictionary.hpp"

namespace imud::canopen {

// The time of day at an instant of the device's clock, from a TIME message (1012).
struct TimeOfDay {
  DeviceTime at;
  std::int64_t ms_since_1984 = 0;  // since 1984-01-01 (CiA 301, 7.1.6.5)
};

struct Reading {
  const ObjectDictionary& dictionary;
  const Sample& sample;
  const Increments& increments;
  std::optional<TimeOfDay> time_of_day;  // nullopt: not known; reported as 0
};

// Returns the value of a mappable object, except 1001, in the low bits. Numbers are rounded to nearest, and saturate
// at the ends of their type.
std::uint64_t measure(const Object& object, const Reading& reading) noexcept;

// Returns the angle of axis x (longitudinal) or y (lateral) above the horizontal, rad, with the specific force as the
// reaction to gravity.
double slope_angle(bool is_lateral, const Vector3& specific_force) noexcept;

// Returns the offset (object `index` + 3) with which the slope at `index` would now have the value `preset`. `index`:
// one of `slopes`. The result and `preset` are in the bits of the slope's type.
std::uint64_t offset_of_preset(std::uint16_t index, std::uint64_t preset, const Reading& reading) noexcept;

}  // namespace imud::canopen
