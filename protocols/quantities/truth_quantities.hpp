// Truth quantities: the names of all quantities of truth. A name is a quantity and its unit, such as "p_deg_per_s"
// or "latitude_rad"; the name of a dimensionless number has no unit, for example "q_NB_w". Frames: core/README.md.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/truth_format.hpp"

namespace imud {

enum class QuantityKind : std::uint8_t {
  number,
  time,
  text,  // a date and time as text
  angle,
  length,
  speed,
  rate,
  angular_acceleration,
  acceleration,
  temperature,
  magnetic_field,
  pressure,
  current,
};

// The quantities that belong together, in the order of quantity_groups(). A body rate, for example, is one group of
// three quantities.
enum class TruthGroup : std::uint8_t {
  // clang-format off
  time, unix_time, gps_time_of_week, time_of_day, utc, gps_week, day,
  q_NB, q_BN, q_LB, q_BL, q_EB, q_BE, sigma_BN, sigma_BL, sigma_BE,
  dcm_BN, dcm_NB, dcm_BL, dcm_LB, dcm_BE, dcm_EB, euler_L, euler_N, euler_E,
  r_BN_N, r_BE_E, geodetic, height, horizontal, down, up,
  v_BN_N, v_BE_E, v_BE_B, v_horizontal, v_down, v_up,
  rate_N, rate_E, euler_rate, angular_acceleration,
  specific_force, acceleration_B, acceleration_N, acceleration_horizontal, acceleration_down, acceleration_up,
  accumulated_dv, temperature, magnetic_field, pressure, rotor_speed, throttle, airspeed,
  dynamic_pressure, current, earth_angle, vehicle, sequence,
  // clang-format on
};
inline constexpr std::size_t truth_group_count = static_cast<std::size_t>(TruthGroup::sequence) + 1;

// Return true if the group is an attitude relative to the Earth, relative to the local level, or in Euler angles.
constexpr bool is_relative_to_earth(TruthGroup group) noexcept {
  using enum TruthGroup;
  return group == q_EB || group == q_BE || group == sigma_BE || group == dcm_BE || group == dcm_EB ||
         group == euler_E;
}
constexpr bool is_relative_to_level(TruthGroup group) noexcept {
  using enum TruthGroup;
  return group == q_LB || group == q_BL || group == sigma_BL || group == dcm_BL || group == dcm_LB ||
         group == euler_L;
}
constexpr bool is_euler(TruthGroup group) noexcept {
  using enum TruthGroup;
  return group == euler_L || group == euler_N || group == euler_E;
}

struct QuantityGroup {
  std::span<const std::string_view> names;  // without their units
  QuantityKind kind;
  std::string_view help;
  std::size_t first = 0;  // index of its first quantity
};

// Returns all groups, by TruthGroup.
std::span<const QuantityGroup, truth_group_count> quantity_groups() noexcept;
inline const QuantityGroup& quantity_group(TruthGroup group) noexcept {
  return quantity_groups()[static_cast<std::size_t>(group)];
}

inline constexpr std::size_t quantity_count = 173;
using QuantitySet = std::bitset<quantity_count>;

// Returns the name of a quantity, without its unit.
std::string_view quantity_name(std::size_t quantity) noexcept;
// Returns the largest magnitude of the numbers of a kind, SI. A time has truth_limit::time_ns instead.
double largest_number_of(QuantityKind kind) noexcept;
// Returns the suffixes of the units of a kind, the SI unit first: "_rad_per_s", "_deg_per_s", ... Empty if the
// kind has no units.
std::span<const std::string_view> unit_suffixes(QuantityKind kind) noexcept;

// A quantity in a unit: its value in SI is factor * number + offset.
struct TruthField {
  std::size_t quantity = 0;
  QuantityKind kind = QuantityKind::number;
  double factor = 1, offset = 0;
  int exponent = 0;  // of a time: a power of ten, ns
};

// Returns the field of a name such as "p_deg_per_s"; nullopt if there is none.
std::optional<TruthField> find_truth_field(std::string_view name) noexcept;
// Expands a name in a source file, which may have alternatives in braces: returns two names for
// "v_{north,east}_m_per_s".
std::vector<std::string> names_in(std::string_view name);
// Returns a message for a `name` that is no field, with the valid units if only the unit is missing or wrong:
// "unknown quantity \"p_degs\"; ...".
std::string unknown_quantity(std::string_view name);

// The form of a text quantity, for remarks.
inline constexpr std::string_view date_form = "; a date is UTC, in the form 2026-01-31T12:00:00.5Z";

// The numbers of one record, in SI. The setters return ok, or the fault. No allocation.
class TruthReading {
 public:
  TruthResult set(const TruthField& field, double number) noexcept;
  TruthResult set(const TruthField& field, std::int64_t number) noexcept;
  // Parses `text` as a number, or for a text quantity as a date: "2026-01-31T12:00:00.5Z", with "+00:00" or nothing
  // in place of the Z, or "2026-031-12:00:00.5". A decimal time is exact to the nanosecond.
  TruthResult set(const TruthField& field, std::string_view text) noexcept;

  double operator[](std::size_t quantity) const noexcept { return values_[quantity]; }
  std::int64_t time_ns() const noexcept { return time_ns_; }

 private:
  std::array<double, quantity_count> values_ = {};
  std::int64_t time_ns_ = 0;
};

}  // namespace imud
