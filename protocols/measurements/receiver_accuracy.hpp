// ReceiverAccuracy: the accuracy that a GNSS receiver reports with its fix.
#pragma once

#include "core/sample.hpp"
#include "protocols/measurements/measured_quantities.hpp"
#include "protocols/protocol.hpp"

namespace imud {

// Standard deviations, north, east, down; 0 without a fix.
struct ReceiverAccuracy {
  Vector3 position = Vector3::Zero(), velocity = Vector3::Zero();  // m, m/s
};

// Returns the accuracy of a fix: the standard deviations of the receiver's errors, times Navigation::accuracy_factor.
// Where the receiver has no errors, the deviations are for an open sky, and chosen.
inline ReceiverAccuracy receiver_accuracy(const Navigation& fix, const OwnFigures& figures) noexcept {
  if (!fix.is_known) return {};
  const double factor = double{fix.accuracy_factor};
  return {factor * figure_or(figures.position, Vector3(0.85, 0.85, 1.8)),
          factor * figure_or(figures.velocity, Vector3::Constant(0.03))};
}

// The same of the fix of a reading.
inline ReceiverAccuracy receiver_accuracy(const Reading& reading) noexcept {
  return receiver_accuracy(reading.sample.fix(), reading.figures != nullptr ? *reading.figures : OwnFigures{});
}

}  // namespace imud
