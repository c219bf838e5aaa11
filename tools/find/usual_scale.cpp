#include "tools/find/usual_scale.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <span>

#include "protocols/quantities/key_units.hpp"

namespace imud {
namespace {

template <class Units, class... Suffixes>
constexpr auto chosen(const Units& units, Suffixes... suffixes) {
  return std::to_array({*find_unit(units, suffixes)...});
}

// The units in which manuals state an LSB; the two most usual units come first.
constexpr auto forces = chosen(key_units::acceleration, "_g", "_m_per_s2", "_mg", "_ft_per_s2", "_cm_per_s2", "_ug");
constexpr auto rates = chosen(key_units::rate, "_deg_per_s", "_rad_per_s", "_mrad_per_s", "_deg_per_hr");
constexpr auto velocities = chosen(key_units::speed, "_m_per_s", "_ft_per_s");
constexpr auto angles = chosen(key_units::angle, "_rad", "_deg");

std::string name_of(const KeyUnit& unit) { return std::string(unit.suffix.substr(1)); }

std::span<const KeyUnit> units_of(VectorQuantity quantity) {
  switch (quantity) {
    case VectorQuantity::rate:
      return rates;
    case VectorQuantity::delta_velocity:
      return velocities;
    case VectorQuantity::delta_angle:
      return angles;
    case VectorQuantity::specific_force:
      break;
  }
  return forces;
}

constexpr double float_tolerance = 0.05;  // of a float, whose unit is one of a few
constexpr double most_by_chance = 0.5;    // usual figures: with more of them, none is taken

// Ranges of sensors in g, or in deg/s, other than powers of two.
constexpr double force_ranges[] = {3, 5, 6, 10, 12, 20, 24, 30, 40, 80};
constexpr double rate_ranges[] = {125, 150, 250, 300, 350, 400, 450, 500, 1000, 2000, 4000};

// Returns all figures within a factor.
std::vector<UsualScale> figures(VectorQuantity quantity, bool is_float, std::size_t bytes, double si, double factor) {
  std::vector<UsualScale> all;
  const auto add = [&](const KeyUnit& unit, double value, std::string text) {
    const double scale = value * unit.factor;
    if (scale <= si * factor && si <= scale * factor) all.push_back({name_of(unit), std::move(text), value, scale});
  };
  if (is_float) {
    for (const KeyUnit& unit : units_of(quantity)) add(unit, 1, "1");
    return all;
  }
  // Other units are decimal multiples of these.
  const std::span<const KeyUnit> main_units = units_of(quantity).first(2);
  for (const int digit : {1, 2, 4, 5})
    for (int power = -9; power <= 0; ++power)
      for (const KeyUnit& unit : main_units) {
        const std::string text = power < -5 ? fmt::format("{}e{}", digit, power)
                                            : fmt::format("{:.{}f}", digit * std::pow(10, power), -power);
        add(unit, std::strtod(text.c_str(), nullptr), text);
      }
  for (int power = 1; power <= 40; ++power)
    for (const KeyUnit& unit : main_units) add(unit, std::ldexp(1, -power), fmt::format("2^-{}", power));
  if (bytes != 2) return all;
  if (quantity == VectorQuantity::specific_force)
    for (const double range : force_ranges) add(forces[0], range / 32768, fmt::format("{}/32768", range));
  if (quantity == VectorQuantity::rate)
    for (const double range : rate_ranges) add(rates[0], range / 32768, fmt::format("{}/32768", range));
  return all;
}

// Returns the mean number of figures that are equally near to a number by chance.
double usual_by_chance(VectorQuantity quantity, bool is_float, std::size_t bytes, double si, double tolerance) {
  // The density of figures in the decade about the number.
  const auto count = static_cast<double>(figures(quantity, is_float, bytes, si, std::sqrt(10.0)).size());
  return count * 2 * std::log10(1 + tolerance);
}

// Returns the measured figure in the quantity's first unit, with as many digits as the tolerance leaves.
UsualScale measured_scale(VectorQuantity quantity, double si, double tolerance) {
  const KeyUnit& unit = units_of(quantity).front();
  const int digits = std::clamp(static_cast<int>(std::ceil(-std::log10(tolerance))) + 1, 2, 6);
  const std::string text = fmt::format("{:.{}g}", si / unit.factor, digits);
  const double value = std::strtod(text.c_str(), nullptr);
  return {name_of(unit), text, value, value * unit.factor};
}

}  // namespace

std::string_view quantity_name(VectorQuantity quantity) {
  switch (quantity) {
    case VectorQuantity::rate:
      return "rate";
    case VectorQuantity::delta_velocity:
      return "delta_velocity";
    case VectorQuantity::delta_angle:
      return "delta_angle";
    case VectorQuantity::specific_force:
      break;
  }
  return "specific_force";
}

VectorScale scale_of(VectorQuantity quantity, const FrameNumber& type, double si, double tolerance) {
  VectorScale scale;
  scale.measured = si;
  scale.tolerance = tolerance;
  const double within = type.is_float() ? std::max(tolerance, float_tolerance) : tolerance;
  std::vector<UsualScale> usual = figures(quantity, type.is_float(), type.bytes, si, 1 + within);
  scale.by_chance = usual_by_chance(quantity, type.is_float(), type.bytes, si, within);
  scale.is_usual = !usual.empty() && scale.by_chance < most_by_chance;
  if (!scale.is_usual) {
    scale.taken = measured_scale(quantity, si, tolerance);
    scale.others = std::move(usual);
    return scale;
  }
  std::ranges::stable_sort(usual, {}, [si](const UsualScale& one) { return std::abs(one.si / si - 1); });
  scale.taken = usual.front();
  scale.others.assign(usual.begin() + 1, usual.end());
  return scale;
}

std::string scale_text(VectorQuantity quantity, const VectorScale& scale) {
  const UsualScale measured = measured_scale(quantity, scale.measured, scale.tolerance / 10);
  std::string text = fmt::format("LSB {} {} +- {:.1f} %", measured.lsb, measured.unit, 100 * scale.tolerance);
  const auto add = [&text](const UsualScale& one) { text += fmt::format(" {} {}", one.lsb, one.unit); };
  if (scale.is_usual) {
    text += ", taken as";
    add(scale.taken);
    text += fmt::format(" (a usual figure is so near by chance in {:.0f} %)", std::min(99.0, 100 * scale.by_chance));
  } else if (scale.others.empty()) {
    text += "; no usual figure is within that";
  }
  for (std::size_t i = 0; i < scale.others.size() && i < 4; ++i) {
    text += i == 0 ? (scale.is_usual ? "; as good:" : "; usual figures within that are frequent:") : ",";
    add(scale.others[i]);
  }
  return text;
}

}  // namespace imud
