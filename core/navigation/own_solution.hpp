// OwnSolution: the solution that a unit computes, with a receiver's fixes or without.
#pragma once

#include <cstdint>
#include <optional>
#include <variant>

#include "core/navigation/attitude_reference.hpp"
#include "core/navigation/navigator.hpp"

namespace imud {

// A Navigator or an AttitudeReference, by NavigatorModel::kind. Nothing here allocates after construction, locks or
// throws; not thread-safe.
class OwnSolution {
 public:
  OwnSolution(const NavigatorModel& model, const ImuModel& imu) : of_(made(model, imu)) {}

  // Makes the next sample the first of a run, or of a power on: the alignment begins.
  void restart() noexcept {
    std::visit([](auto& of) { of.restart(); }, of_);
  }
  // Sets how the aids are used, until the next call.
  void set_aids(const NavigationAids& aids) noexcept {
    aids_ = aids;
    has_field_ = (aids.withheld & aid::magnetic_heading) == 0;
    compensates_ = aids.compensates();
    std::visit([&](auto& of) { of.set_aids(aids); }, of_);
  }
  // Sets the heading of the platform at the last sample.
  void give(const GivenHeading& heading) noexcept {
    std::visit([&](auto& of) { of.give(heading); }, of_);
  }
  // Replaces the solution of a sample (Navigator::take(), AttitudeReference::take()).
  void take(Sample& sample, TruthTime time, std::optional<double> earth_angle) noexcept {
    const Vector3 measured = compensate(sample);
    if (auto* navigator = std::get_if<Navigator>(&of_))
      navigator->take(sample, time, earth_angle);
    else if (auto* reference = std::get_if<AttitudeReference>(&of_))
      reference->take(sample);
    sample.magnetic_field = measured;
  }
  // Does the same as take() for a vehicle at rest before the first truth of a run.
  void take_at_rest(Sample& sample) noexcept {
    const Vector3 measured = compensate(sample);
    if (auto* navigator = std::get_if<Navigator>(&of_))
      navigator->take_at_rest(sample);
    else if (auto* reference = std::get_if<AttitudeReference>(&of_))
      reference->take(sample);
    sample.magnetic_field = measured;
  }

  // Returns the navigator; nullptr if the unit computes its attitude alone.
  const Navigator* navigator() const noexcept { return std::get_if<Navigator>(&of_); }
  // Headings that were used, and that were rejected.
  Navigator::Counts headings() const noexcept {
    return std::visit([](const auto& of) { return of.headings(); }, of_);
  }

 private:
  using Either = std::variant<Navigator, AttitudeReference>;
  static Either made(const NavigatorModel& model, const ImuModel& imu) {
    if (model.kind == NavigatorModel::Kind::attitude) return AttitudeReference(model, imu);
    return Navigator(model, imu);
  }
  // Gives the sample the magnetic field that the filter uses; returns the measured one.
  Vector3 compensate(Sample& sample) const noexcept {
    const Vector3 measured = sample.magnetic_field;
    if (!has_field_)
      sample.magnetic_field.setZero();
    else if (compensates_)
      sample.magnetic_field = aids_.compensated(measured);
    return measured;
  }

  Either of_;
  NavigationAids aids_;
  bool has_field_ = true, compensates_ = false;
};

}  // namespace imud
