// FilterRequests: the commands and registers of a VectorNav by which its host acts on the unit's own filter.
// Sources: VN-100 user manual UM001 2.22, page 54 (reset), page 91 (disturbances), page 101 (the model of register
// 23); the parameters of VNSIH: VectorNav's SDK 0.99, Commands.hpp, SetInitialHeading; register 67: vnproglib 1.2,
// types.h.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "core/attitude.hpp"
#include "core/navigation/navigation_requests.hpp"
#include "core/sample.hpp"
#include "core/units.hpp"
#include "protocols/vectornav/vectornav.hpp"

namespace imud::vectornav {

class FilterRequests {
 public:
  // Call this at power-on, with which the filter begins by itself.
  void power_on() noexcept {
    requests_.heading.reset();
    withheld_ = 0;
  }
  // VNRST and VNRFS: "upon a reset the VN-100 will re-initialize its Kalman filter".
  void reset() noexcept {
    power_on();
    requests_.restart();
  }

  // Executes VNKMD, VNKAD or VNSIH; does nothing for other commands, or if `parameters` is empty. `q`: from the
  // host's axes, v_P = q * v. Returns false if the parameters are not valid for the command.
  bool execute(std::string_view name, std::string_view parameters, const Quaternion& q) noexcept {
    if (parameters.empty()) return true;
    if (name == "VNKMD") return set_disturbance(aid::magnetic_heading, parameters);
    if (name == "VNKAD") return set_disturbance(aid::gravity, parameters);
    if (name != "VNSIH") return true;
    const std::optional<double> yaw = yaw_in(parameters);
    if (yaw) requests_.give({.azimuth = *yaw, .ahead_P = q * Vector3::UnitX()});
    return yaw.has_value();
  }

  // Returns the requests to the unit's own filter. `magnetometer`: register 23, in the host's axes, gauss; `dcm`:
  // from the platform's axes to the host's; `scenario`: the first parameter of register 67.
  NavigationRequests requests(const Calibration& magnetometer, const Matrix3& dcm, double scenario) const noexcept {
    constexpr double without_pressure = 2;
    NavigationRequests all = requests_;
    all.aids.withheld = withheld_;
    if (scenario == without_pressure) all.aids.withheld |= aid::pressure;
    if (magnetometer.gain.matrix() != Matrix3::Identity())
      all.aids.field_gain = dcm.transpose() * magnetometer.gain.matrix() * dcm;
    all.aids.field_bias = units::gauss * (dcm.transpose() * magnetometer.bias);
    return all;
  }

 private:
  bool set_disturbance(std::uint16_t aid, std::string_view parameter) noexcept {
    if (parameter != "0" && parameter != "1") return false;
    withheld_ = static_cast<std::uint16_t>(parameter == "1" ? withheld_ | aid : withheld_ & ~aid);
    return true;
  }

  // Returns the yaw, rad, in parameters that are either a heading, or yaw, pitch and roll, in degrees, or a
  // quaternion with the scalar as the last number. Pitch and roll are not used. Returns nullopt for other parameters.
  static std::optional<double> yaw_in(std::string_view parameters) noexcept {
    const Words words(parameters);
    std::array<double, 4> numbers = {};
    if (words.count > numbers.size() || words.count == 2) return std::nullopt;
    for (std::size_t i = 0; i < words.count; ++i) {
      const auto number = real_in(words[i]);
      if (!number) return std::nullopt;
      numbers[i] = *number;
    }
    constexpr double largest = 360;  // degrees
    if (words.count != numbers.size())
      return std::abs(numbers[0]) <= largest ? std::optional(numbers[0] * units::degree) : std::nullopt;
    const Quaternion q(numbers[3], numbers[0], numbers[1], numbers[2]);
    constexpr double tolerance = 0.01;
    if (!(std::abs(q.norm() - 1) < tolerance)) return std::nullopt;
    return yaw_pitch_roll_from_dcm(q.normalized().conjugate().toRotationMatrix())[0];
  }

  NavigationRequests requests_;
  std::uint16_t withheld_ = 0;
};

}  // namespace imud::vectornav
