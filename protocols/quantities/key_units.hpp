// Key units: the suffix of the name of a key, column or signal is the unit of its number: "_deg_per_s" in
// "p_deg_per_s". The suffixes are the same for truth and for a sensor's measurements, errors and faults.
#pragma once

#include <cstddef>
#include <string_view>

#include "core/units.hpp"

namespace imud {

// SI = factor * number + offset.
struct KeyUnit {
  std::string_view suffix;
  double factor = 1, offset = 0;
  int exponent = 0;  // of a time: a power of ten, ns
};

// The units of each kind; the SI unit (for temperatures, degrees Celsius) is the first.
namespace key_units {
inline constexpr double deg = units::degree, foot = units::foot, standard_gravity = units::standard_gravity;
inline constexpr double nautical_mile = 1852, mile = 1609.344, hour = 3600, inch_of_mercury = 3386.389;
inline constexpr double zero_celsius = 273.15;
// T. The "arbitrary unit" of magnetometers is assumed to be about the Earth's field.
inline constexpr double arbitrary_field = 50e-6;

inline constexpr KeyUnit time[] = {{"_s", 1, 0, 9}, {"_ms", 1e-3, 0, 6}, {"_us", 1e-6, 0, 3}, {"_ns", 1e-9, 0, 0}};
inline constexpr KeyUnit angle[] = {
    {"_rad"}, {"_deg", deg}, {"_mrad", 1e-3}, {"_arcsec", deg / 3600}, {"_deg_e7", 1e-7 * deg}};
inline constexpr KeyUnit length[] = {{"_m"}, {"_ft", foot}, {"_km", 1e3}, {"_cm", 1e-2}, {"_mm", 1e-3}};
inline constexpr KeyUnit speed[] = {{"_m_per_s"},         {"_ft_per_s", foot},           {"_km_per_s", 1e3},
                                    {"_cm_per_s", 1e-2},  {"_kn", nautical_mile / hour}, {"_km_per_h", 1 / 3.6},
                                    {"_mph", mile / hour}};
inline constexpr KeyUnit rate[] = {
    {"_rad_per_s"}, {"_deg_per_s", deg}, {"_mrad_per_s", 1e-3}, {"_deg_per_hr", deg / hour}, {"_rpm", 6 * deg}};
inline constexpr KeyUnit angular_acceleration[] = {{"_rad_per_s2"}, {"_deg_per_s2", deg}};
inline constexpr KeyUnit acceleration[] = {{"_m_per_s2"},
                                           {"_ft_per_s2", foot},
                                           {"_g", standard_gravity},
                                           {"_mg", 1e-3 * standard_gravity},
                                           {"_ug", 1e-6 * standard_gravity},
                                           {"_cm_per_s2", 1e-2}};
inline constexpr KeyUnit temperature[] = {{"_c"}, {"_k", 1, -zero_celsius}, {"_f", 5.0 / 9.0, -160.0 / 9.0}};
inline constexpr KeyUnit magnetic_field[] = {{"_t"},           {"_ut", 1e-6},     {"_nt", 1e-9},
                                             {"_gauss", 1e-4}, {"_mgauss", 1e-7}, {"_au", arbitrary_field}};
inline constexpr KeyUnit pressure[] = {{"_pa"},        {"_hpa", 1e2}, {"_kpa", 1e3}, {"_inhg", inch_of_mercury},
                                       {"_mbar", 1e2}, {"_bar", 1e5}};
inline constexpr KeyUnit current[] = {{"_a"}, {"_ma", 1e-3}};
}  // namespace key_units

// Returns true if two names are the same but for the spelling of their units: an hour is `hr` or `h`, a knot `kn` or
// `kt`.
constexpr bool is_same_key(std::string_view a, std::string_view b) noexcept {
  const auto spelling = [](std::string_view word) { return word == "h" ? "hr" : word == "kt" ? "kn" : word; };
  for (;;) {
    const std::size_t end_a = a.find('_'), end_b = b.find('_');
    if (spelling(a.substr(0, end_a)) != spelling(b.substr(0, end_b))) return false;
    if (end_a == a.npos || end_b == b.npos) return end_a == end_b;
    a.remove_prefix(end_a + 1);
    b.remove_prefix(end_b + 1);
  }
}

// Returns the unit of that suffix, in any spelling; nullptr if `units` has none.
template <class Units>
constexpr const KeyUnit* find_unit(const Units& units, std::string_view suffix) noexcept {
  for (const KeyUnit& unit : units)
    if (is_same_key(unit.suffix, suffix)) return &unit;
  return nullptr;
}

}  // namespace imud
