#include "emulator/plan/fault_units.hpp"

namespace imud {

std::span<const KeyUnit> fault_units(std::string_view target) noexcept {
  static constexpr struct {
    std::string_view target;
    std::span<const KeyUnit> units;
  } all[] = {{"gyro", key_units::rate},
             {"accelerometer", key_units::acceleration},
             {"magnetometer", key_units::magnetic_field},
             {"inclinometer", key_units::acceleration},
             {"barometer", key_units::pressure},
             {"temperature", std::span(key_units::temperature).first(1)},
             {"gnss", std::span(key_units::length).first(1)}};
  for (const auto& entry : all)
    if (entry.target == target) return entry.units;
  return {};
}

}  // namespace imud
