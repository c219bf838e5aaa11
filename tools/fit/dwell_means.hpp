// The means of a recording over the dwells of a plan.
#pragma once

#include <string>
#include <vector>

#include "tools/allan/still_recording.hpp"
#include "tools/fit/dwell_plan.hpp"
#include "tools/fit/sensor_fit.hpp"

namespace imud {

// Returns the means of the gyros, or of the accelerometers, over the dwells in which their input is known; empty
// if the recording does not have three gyros, or three accelerometers. Temperatures are relative to `reference_c`.
// The variance of a mean includes the white noise, estimated from the scatter of 16 blocks in every dwell, and the
// resolution where the noise is smaller than the digits. Throws std::runtime_error if a dwell is not within the
// recording, or has fewer than 32 samples.
std::vector<DwellMean> dwell_means(const StillRecording& recording, const std::vector<Dwell>& dwells, bool is_rate,
                                   double reference_c);

// Returns the mean of the temperatures that the dwells state, degrees Celsius; 25 if no dwell states one.
double reference_temperature(const std::vector<Dwell>& dwells);

}  // namespace imud
