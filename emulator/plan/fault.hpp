// Fault: what fails, how, and when. A fault is a [[fault]] of a configuration or a scenario, or begins by control.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>

namespace imud {

// The place on the way from truth to bytes at which a fault acts.
enum class FaultSeam : std::uint8_t {
  truth,    // between the simulator and the sensors
  sensor,   // the sample that a sensor takes
  message,  // the sample that the device receives, and the frames that it makes of it
  wire,     // the frames on the line or the bus
  power,    // the device's supply
};

// The name and the number of truth, used in place of an imu's.
inline constexpr std::string_view fault_of_truth = "truth";
inline constexpr std::uint16_t truth_number = 0xFFFF;

// A number that a fault has beside its times, such as its magnitude.
struct FaultParameter {
  static constexpr double required = std::numeric_limits<double>::quiet_NaN();

  std::string_view key;  // "value"; with the unit, if the target has another one: "jitter_ms"
  std::string_view meaning;
  double initial = required;
  double min = -1e9, max = 1e9;
  // The key is in the target's unit, SI, or has the unit as its suffix: value_deg_per_s.
  bool has_targets_unit = false;
  bool is_per_s = false;  // the number is a rate, per second
  bool is_whole = false;  // the number is whole; a drawn one is rounded to the nearest
};

// The enumerator of a kind of fault in the enum of the kind's seam, such as SensorFault::bias.
class FaultCode {
 public:
  constexpr FaultCode() noexcept = default;
  template <class Enum>
  requires std::is_enum_v<Enum>
  constexpr FaultCode(Enum value) noexcept : value_(static_cast<std::uint8_t>(value)) {}

  constexpr std::size_t value() const noexcept { return value_; }
  // `Enum` must be the enumeration of the seam.
  template <class Enum>
  constexpr Enum as() const noexcept {
    return static_cast<Enum>(value_);
  }

 private:
  std::uint8_t value_ = 0;
};

// A way to fail. Each seam declares its kinds in a table (fault_kinds.hpp).
struct FaultKind {
  static constexpr std::size_t max_parameters = 4;

  FaultCode code;
  std::string_view name;     // of the key `kind`: "bias"
  std::string_view summary;  // follows the target in a sentence: "gyro.x: a constant is added"
  FaultSeam seam = FaultSeam::sensor;
  std::span<const std::string_view> targets;  // of the key `target`, without axes: "gyro"
  std::span<const FaultParameter> parameters = {};
  bool has_axes = false;  // the target may be one axis: "gyro.x"
  std::size_t least_axes = 1;
  bool is_ramped = true;  // the effect is proportional to a weight; false: the effect is on or off
  bool is_event = false;  // the fault acts at its begin, and has no duration
  // The state that stays after the end, and how long: "the counter stays ahead to the end of the run". Empty: bytes
  // after the end equal a run without the fault.
  std::string_view stays = {};
  bool acts_on_frames = false;   // changes frames that are made, or their transmission; false: acts before
  bool in_lockstep = true;       // false: the simulator would wait for ever
  bool has_settings = false;     // the fault has a product's settings: FaultConfig::settings
  bool needs_self_test = false;  // the product must have a self test
};

// Returns true if no target has two kinds of one name.
constexpr bool has_own_names(std::span<const FaultKind> table) noexcept {
  for (std::size_t i = 0; i < table.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      if (table[i].name == table[k].name)
        for (const std::string_view target : table[i].targets)
          for (const std::string_view other : table[k].targets)
            if (target == other) return false;
  return true;
}

// Returns true if `table`, the kinds of one seam, has exactly one kind for each of the `count` codes of that seam, in
// their order, and no kind has more parameters than there is room for.
constexpr bool has_every_code(std::span<const FaultKind> table, std::size_t count) noexcept {
  for (std::size_t i = 0; i < table.size(); ++i)
    if (table[i].code.value() != i || table[i].parameters.size() > FaultKind::max_parameters) return false;
  return table.size() == count;
}

// A fault during one sample.
struct ActiveFault {
  const FaultKind* kind = nullptr;
  std::uint32_t number = 0;  // the fault's number in the configuration
  std::uint8_t target = 0;   // index into FaultKind::targets
  std::uint8_t axes = 7;     // bits of x, y and z
  // The kind's parameters, in order, as drawn for this occurrence.
  std::array<double, FaultKind::max_parameters> parameters = {};
  double weight = 1;             // from 0 to 1: below 1 during the ramps
  std::uint64_t since = 0;       // samples since the occurrence began; 0 in its first sample
  double since_s = 0;            // the sum of the nominal periods of these samples, which a reload may change; s
  std::uint64_t occurrence = 0;  // number of the occurrence of a repeated fault, from 0
  bool is_last = false;          // the sample is the occurrence's last, as far as the configured times show
};

}  // namespace imud
