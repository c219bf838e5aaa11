#include "emulator/plan/fault_units.hpp"

#include "core/units.hpp"

namespace imud {

std::span<const FaultUnit> fault_units(std::string_view target) noexcept {
  constexpr double deg = units::degree, g = units::standard_gravity;
  static constexpr FaultUnit rate[] = {{"rad_per_s", 1}, {"deg_per_s", deg}, {"deg_per_hr", deg / 3600}};
  static constexpr FaultUnit force[] = {{"m_per_s2", 1}, {"g", g}, {"mg", 1e-3 * g}, {"ug", 1e-6 * g}};
  static constexpr FaultUnit field[] = {{"t", 1}, {"ut", 1e-6}, {"nt", 1e-9}};
  static constexpr FaultUnit pressure[] = {{"pa", 1}, {"hpa", 100}};
  static constexpr FaultUnit temperature[] = {{"c", 1}};
  static constexpr FaultUnit position[] = {{"m", 1}};
  static constexpr struct {
    std::string_view target;
    std::span<const FaultUnit> units;
  } all[] = {{"gyro", rate},          {"accelerometer", force},     {"magnetometer", field},
             {"barometer", pressure}, {"temperature", temperature}, {"gnss", position}};
  for (const auto& entry : all)
    if (entry.target == target) return entry.units;
  return {};
}

}  // namespace imud
