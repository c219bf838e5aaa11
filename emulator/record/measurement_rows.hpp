// Measurements as rows of arrays of NumPy: the decoded messages of a product, and the truth beside them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "emulator/plan/config.hpp"
#include "protocols/measurements/measurement_row.hpp"
#include "protocols/protocol.hpp"
#include "transports/port.hpp"

namespace imud {

// The truth at a measurement, without errors, by truth_columns(). The increments count from the measurement
// before.
struct TrueRow {
  std::int64_t time_ns;  // of the sample, by the sensor's own clock
  TrueValues values;
};

// A port that decodes a device's frames. Within send() it calls `receive`, which must not throw, for each
// measurement.
std::unique_ptr<Port> decoding_port(const ImuConfig& imu, std::function<void(const Measurement&)> receive);

}  // namespace imud
