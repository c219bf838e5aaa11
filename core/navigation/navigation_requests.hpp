// NavigationRequests: what the host of a unit has asked of the unit's own filter.
#pragma once

#include <cstdint>
#include <optional>

#include "core/units.hpp"
#include "core/vector.hpp"

namespace imud {

// How the filter uses its aids.
struct NavigationAids {
  std::uint16_t withheld = 0;  // bits of namespace aid: these aids are not used, as if they were missing
  bool waits = false;          // no alignment ends without a heading that the host has given
  // The scale factors are estimated, whatever NavigatorModel::estimates_scale_factors is.
  bool estimates_gyro_scale = false, estimates_accelerometer_scale = false;
  // Hard and soft iron: the filter uses the magnetic field gain * (measured - bias), in platform axes.
  Matrix3 field_gain = Matrix3::Identity();
  Vector3 field_bias = Vector3::Zero();  // T

  bool operator==(const NavigationAids&) const = default;
  bool compensates() const noexcept { return field_gain != Matrix3::Identity() || !field_bias.isZero(0.0); }
  // Returns the compensated field, T. A field of 0, which means that the field is unknown, is returned unchanged.
  Vector3 compensated(const Vector3& measured) const noexcept {
    if (!compensates() || measured.isZero(0.0)) return measured;
    return field_gain * (measured - field_bias);
  }
};

// A heading that the host gives: the azimuth of a direction which is fixed to the platform.
struct GivenHeading {
  double azimuth = 0;                  // rad, clockwise from north
  Vector3 ahead_P = Vector3::UnitX();  // not vertical
  bool only_in_alignment = false;      // a filter that is aligned ignores it
  // No document states the uncertainty that a unit takes for such a heading: chosen.
  static constexpr double sigma = 5 * units::degree;

  bool operator==(const GivenHeading&) const = default;
};

// A restart and a heading are events. They are counted, so that each one acts once.
struct NavigationRequests {
  NavigationAids aids;
  std::uint32_t restarts = 0;           // so far: with each further one the filter aligns again
  std::uint32_t headings = 0;           // so far: with each further one the filter takes `heading`
  std::optional<GivenHeading> heading;  // since the last restart or power on

  bool operator==(const NavigationRequests&) const = default;
  void restart() noexcept {
    ++restarts;
    heading.reset();
  }
  void give(const GivenHeading& given) noexcept {
    ++headings;
    heading = given;
  }
};

}  // namespace imud
