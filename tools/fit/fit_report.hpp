// FitReport: the errors of a unit, estimated from its dwells, as text, JSON and a preset.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "tools/fit/sensor_fit.hpp"

namespace imud {

struct FitReport {
  struct Sensor {
    std::size_t dwells = 0;
    std::array<AxisFit, 3> axes;
  };
  std::string protocol, port, plan;
  std::size_t samples = 0, dwells = 0;
  double rate_hz = 0, reference_c = 25;
  std::optional<Sensor> gyro, accelerometer;  // nullopt: the sensor was not recorded, or no dwell states its input

  std::string text() const;
  std::string json() const;
  // Returns the text of a model for imud; a comment marks each term that was not fitted.
  std::string preset() const;
};

}  // namespace imud
