// DrawnTerms: the constant errors that were drawn for a sensor, for the summary and the labels of a run.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/imu.hpp"

namespace imud {

// One layer of one triad, the mounting, the barometer or the causes of correlations.
struct DrawnTerms {
  // "gyro", "accelerometer", "magnetometer", "inclinometer", "mounting", "barometer" or "cause"
  std::string_view sensor;
  std::string_view layer;  // "unit" or "turn_on"
  // In SI, by the names of the members of TriadErrors, ImuModel and BarometerErrors: a number, three numbers, or the
  // nine of a matrix, row by row. Of a mounting the rotation vector, rad. Of a cause, by its name, the deviate in
  // units of the standard deviation, or the deviates of the three axes.
  std::vector<std::pair<std::string, std::vector<double>>> terms;

  // Returns "bias=1e-05,-2e-06,3e-06 scale_factor=0.0001,0,0".
  std::string text() const;
};

// Returns what is drawn for an imu of this name until its second power on; without the terms whose standard
// deviations are 0.
std::vector<DrawnTerms> drawn_terms(const ImuModel& model, std::uint64_t seed, std::string_view imu_name);

}  // namespace imud
