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

// The truth at a measurement, without errors, by truth_columns(). The increments count from the previous
// measurement. If only some measurements carry increments, the increments count from the previous measurement with
// increments, and are NaN in measurements without.
struct TrueRow {
  std::int64_t time_ns;  // the time of the sample by the sensor's own clock
  TrueValues values;
};

// Returns whether a measurement with these Measurement::fields carries increments.
constexpr bool carries_increments(std::uint32_t fields) noexcept {
  return (fields & (Measurement::delta_angle | Measurement::delta_velocity)) != 0;
}

// Returns a port that decodes a device's frames. Within send() the port calls `receive`, which must not throw, for
// each measurement.
std::unique_ptr<Port> decoding_port(const ImuConfig& imu, std::function<void(const Measurement&)> receive);
// Returns a port like the first function, which also gives `receive` the instant of the measurement's first frame.
// Each send() calls `now` for the instant. A measurement may be complete only when the next measurement begins
// (CollectingDecoder).
std::unique_ptr<Port> decoding_port(const ImuConfig& imu,
                                    std::function<void(const Measurement&, std::int64_t instant)> receive,
                                    std::function<std::int64_t()> now);

}  // namespace imud
