// Measured quantities: the names, with a unit, by which tables of signals and configurations refer to a sensor's
// measurements: `rate_x_deg_per_s`, `specific_force_z_g`, `temperature_c`. Frames: core/README.md.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/sample.hpp"
#include "core/units.hpp"
#include "protocols/protocol.hpp"
#include "protocols/quantities/key_units.hpp"

namespace imud {

// The newest sample, and the increments since the message to be encoded was last sent.
struct Reading {
  const Sample& sample;
  Vector3 delta_angle = Vector3::Zero();         // rad, the sum
  Vector3 delta_velocity = Vector3::Zero();      // m/s, the sum
  Quaternion rotation = Quaternion::Identity();  // of the platform: q_LP2 = q_LP1 * rotation
  double interval_s = 0;                         // 0: not known; the increments are then those in `sample`
  const OwnFigures* figures = nullptr;           // of the unit; nullptr: it has none
};

// Numbers that were read back from messages.
struct ReadBack {
  Measurement measurement;
  // Components that are present: bits 0 to 2 of the rate, 3 to 5 of the specific force, 6 to 8 of the delta-angle, 9
  // to 11 of the delta-velocity.
  std::uint32_t components = 0;
  double scratch = 0;  // passes a number from one signal of a message to the next

  // Adds to the measurement's fields each vector whose components are all present. `sent` are the components that the
  // sensor's messages have. Of a vector in the fields, a component that no message has becomes NaN.
  void complete_vectors(std::uint32_t sent) noexcept;
};

struct MeasuredQuantity {
  enum class Kind : std::uint8_t {
    number,   // a real number, which saturates
    time,     // the sensor's clock, whose low bits are sent
    counter,  // the sample counter's low bits
    status,   // Sample::status's low bits
  };

  std::string_view name;  // without the unit
  std::string_view help;
  std::span<const KeyUnit> units = {};                           // empty: a number without unit
  double (*get)(const Reading& reading) noexcept = nullptr;      // SI; of Kind::number only
  void (*set)(double value, ReadBack& read) noexcept = nullptr;  // inverse of get; nullptr: none
  Kind kind = Kind::number;
  bool is_increment = false;  // depends on the increments of the Reading
  // The condition for a meaningful value: the unit's place, the GPS time (Sample::timed()), a fix of the receiver, or
  // a heading of its antennas is known. If the condition is not met, a text format may omit the quantity.
  enum class Needs : std::uint8_t { nothing, place, time, fix, antennas } needs = Needs::nothing;
  // The instant of Kind::time: the sample's, the one of the receiver's fix, or the one of the line of its antennas. A
  // receiver's time is not read back.
  enum class Instant : std::uint8_t { sample, fix, antennas } instant = Instant::sample;
  bool is_known(const Sample& sample) const noexcept;
  // Returns the sensor's clock that a quantity of Kind::time reports.
  DeviceTime time_of(const Sample& sample) const noexcept {
    if (instant == Instant::fix) return sample.stamp() - sample.fix_age();
    return instant == Instant::antennas ? sample.stamp() - sample.antennas_age() : sample.stamp();
  }
  // Returns true if the time of a measurement follows from the quantity.
  bool is_clock() const noexcept { return kind == Kind::time && instant == Instant::sample; }
};

// A quantity in one of its units.
struct MeasuredIn {
  const MeasuredQuantity* quantity = nullptr;
  double factor = 1;  // SI = factor * number + offset
  double offset = 0;
};

// All quantities.
std::span<const MeasuredQuantity> measured_quantities() noexcept;

// Returns the quantity and unit of a name such as "rate_x_deg_per_s"; a minus before the name changes the sign.
// Returns nullopt if no quantity has the name.
std::optional<MeasuredIn> find_measured(std::string_view name) noexcept;

// Returns the names of all quantities, each with the first of its units, for messages to users.
std::string measured_names();

}  // namespace imud
