// Measured: the internal samples of a unit since its last transmission.
#pragma once

#include <array>
#include <optional>

#include "core/sample.hpp"
#include "protocols/stim300/stim300.hpp"

namespace imud::stim300 {

class Measured {
 public:
  // Adds a sample, with the configured g-compensation and the bias trim offsets; records overloads in the errors of
  // `memory`. In a sample without inclinometers, which is of a run that was recorded before they had errors of their
  // own, the accelerometers take their place. `g_sensitivity` is the gyros' sensitivity to acceleration by the
  // unit's calibration, rad/s/(m/s^2).
  void add(const Sample& sample, bool is_starting, const Matrix3& g_sensitivity, Memory& memory) noexcept;
  // Restarts the sums. Call this after a transmission.
  void begin_sums() noexcept {
    for (Axes& axes : axes_) axes.begin();
  }

  const std::array<Axes, 3>& axes() const noexcept { return axes_; }
  // The time of the newest sample; nullopt before the first sample.
  std::optional<DeviceTime> time() const noexcept { return time_; }
  // Returns the fields that the clusters share. `latency` is the time from the newest sample to the datagram's time
  // of validity.
  Reading reading(std::uint32_t pps, Nanoseconds latency) const noexcept;

  // See Device::step_clock().
  void step_clock(Nanoseconds by) noexcept {
    if (time_) time_ = *time_ + by;
  }

 private:
  // Returns the bias to subtract from each gyro, rad/s. `sources`: g; measured by the accelerometers, and by the
  // inclinometers.
  Vector3 g_compensation(const Configuration& c, const Matrix3& g_sensitivity,
                         const std::array<Vector3, 2>& sources) noexcept;

  std::array<Axes, 3> axes_;  // index: Cluster
  std::optional<DeviceTime> time_;
  unsigned status_ = 0;  // status bits common to all clusters
  unsigned counter_ = 0;
  double temperature_c_ = 0;
  std::array<Vector3, 2> filtered_;  // the sources of the g-compensation, if has_filtered_
  bool has_filtered_ = false;
};

}  // namespace imud::stim300
