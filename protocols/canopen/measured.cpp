#include "protocols/canopen/measured.hpp"

#include <cmath>

#include "core/numbers/elementary.hpp"
#include "core/units.hpp"
#include "protocols/wire/wire.hpp"

namespace imud::canopen {
namespace {

// Rounds to the nearest integer of `bits` bits.
std::uint64_t rounded(double value, int bits, bool is_signed = true) noexcept {
  const double end = std::ldexp(1.0, is_signed ? bits - 1 : bits);
  if (std::isnan(value)) value = 0;
  return static_cast<std::uint64_t>(to_integer(std::clamp(value, is_signed ? -end : 0.0, end - 1)));
}

std::uint64_t as_float(double value) noexcept { return std::bit_cast<std::uint32_t>(to_float(value)); }

std::int64_t rounded_division(std::int64_t value, std::int64_t divisor) noexcept {
  const std::int64_t floor = value / divisor - (value % divisor < 0);
  return floor + (value - floor * divisor >= (divisor + 1) / 2);
}

double of_axis(Quantity quantity, int axis, const Reading& reading) noexcept {
  switch (quantity) {
    case Quantity::rate:
      return reading.sample.rate[axis];
    case Quantity::specific_force:
      return reading.sample.specific_force[axis];
    case Quantity::delta_angle:
      return reading.increments.delta_angle[axis];
    case Quantity::delta_velocity:
      return reading.increments.delta_velocity[axis];
    case Quantity::magnetic_field:
      break;
  }
  return reading.sample.magnetic_field[axis];
}

std::uint64_t time_of_day(const Reading& reading) noexcept {
  if (!reading.time_of_day) return 0;
  constexpr std::int64_t ms_per_day = 86'400'000;
  const std::int64_t ms = reading.time_of_day->ms_since_1984 +
                          rounded_division((reading.sample.stamp() - reading.time_of_day->at).count(), 1'000'000);
  if (ms < 0) return 0;
  return static_cast<std::uint64_t>(ms % ms_per_day) | static_cast<std::uint64_t>(ms / ms_per_day & 0xFFFF) << 32;
}

std::uint64_t time(unsigned sub, const Reading& reading) noexcept {
  const std::int64_t ns = reading.sample.stamp().ns;
  switch (sub) {
    case 1:
      return static_cast<std::uint64_t>(rounded_division(ns, 100'000));
    case 2:
      return static_cast<std::uint64_t>(rounded_division(ns, 1000));
    case 3:
      return static_cast<std::uint64_t>(ns);
    default:
      return time_of_day(reading);
  }
}

// slope_value() returns the angle of a slope, signed_parameter() a parameter of a slope; both in units of 6000.
double slope_value(std::uint16_t index, const Reading& reading) noexcept {
  const bool is_lateral = (index & 0xF0U) == 0x20;
  const bool is_inverted = (reading.dictionary[find_object(static_cast<std::uint16_t>(index + 1), 0)] & 1U) != 0;
  const double unit = 1e-3 * units::degree * static_cast<double>(reading.dictionary[at(0x6000)]);
  const double value = slope_angle(is_lateral, reading.sample.specific_force) / unit;
  return is_inverted ? -value : value;
}
double signed_parameter(std::uint16_t index, bool is_long, const Reading& reading) noexcept {
  const std::uint64_t bits = reading.dictionary[find_object(index, 0)];
  return is_long ? static_cast<double>(static_cast<std::int32_t>(bits))
                 : static_cast<double>(static_cast<std::int16_t>(bits));
}

std::uint64_t slope(std::uint16_t index, const Reading& reading) noexcept {
  const bool is_long = index >= 0x6100;
  double value = slope_value(index, reading);
  if ((reading.dictionary[find_object(static_cast<std::uint16_t>(index + 1), 0)] & 2U) != 0)
    value += signed_parameter(static_cast<std::uint16_t>(index + 3), is_long, reading) +
             signed_parameter(static_cast<std::uint16_t>(index + 4), is_long, reading);
  return rounded(value, is_long ? 32 : 16);
}

}  // namespace

double slope_angle(bool is_lateral, const Vector3& specific_force) noexcept {
  const double largest = specific_force.cwiseAbs().maxCoeff();
  if (!(largest > 0) || !std::isfinite(largest)) return 0;
  const Vector3 f = specific_force / largest;
  const double along = is_lateral ? f.y() : f.x(), across = is_lateral ? f.x() : f.y();
  return elementary::atan2(along, std::sqrt(across * across + f.z() * f.z()));
}

std::uint64_t offset_of_preset(std::uint16_t index, std::uint64_t preset, const Reading& reading) noexcept {
  const bool is_long = index >= 0x6100;
  const double wanted = is_long ? static_cast<double>(static_cast<std::int32_t>(preset))
                                : static_cast<double>(static_cast<std::int16_t>(preset));
  const double differential = signed_parameter(static_cast<std::uint16_t>(index + 4), is_long, reading);
  const std::uint64_t bits = rounded(wanted - slope_value(index, reading) - differential, is_long ? 32 : 16);
  return is_long ? static_cast<std::uint32_t>(bits) : static_cast<std::uint16_t>(bits);
}

std::uint64_t measure(const Object& object, const Reading& reading) noexcept {
  const Sample& sample = reading.sample;
  switch (object.index) {
    case 0x1002:
    case 0x2190:
      return sample.status;
    case 0x2150:
      return object.sub == 1 ? rounded(100 * sample.pressure, 32, false) : as_float(sample.pressure);
    case 0x2160:
      return object.sub == 1 ? rounded(100 * sample.temperature_c, 16) : as_float(sample.temperature_c);
    case 0x2170:
      return time(object.sub, reading);
    case 0x2180:
      return sample.counter;
    default:
      break;
  }
  if (object.index >= slopes.front()) return slope(object.index, reading);
  const auto q = static_cast<unsigned>(object.index - first_quantity) / 0x10;
  const double value = of_axis(static_cast<Quantity>(q), object.sub - 1, reading);
  const auto lsbs = static_cast<std::uint16_t>(object.index | 3U);
  switch (object.type) {
    case Type::i16:
      return rounded(value / reading.dictionary.real(find_object(lsbs, 1)), 16);
    case Type::i32:
      return rounded(value / reading.dictionary.real(find_object(lsbs, 2)), 32);
    default:
      return as_float(value);
  }
}

}  // namespace imud::canopen
