#include "tools/allan/model_terms.hpp"

#include <algorithm>
#include <stdexcept>

#include "emulator/config/load_config.hpp"
#include "emulator/ground/error_text.hpp"

namespace imud {

ModelTerms model_terms(const std::string& model, double rate_hz) {
  // A rate at which every preset is possible; averaging a recording does not change the densities.
  const double least_rate_hz = 100, greatest_rate_hz = 10'000;
  try {
    const ImuModel imu = model_named(model, std::clamp(rate_hz, least_rate_hz, greatest_rate_hz));
    const auto sensors = triad_terms(imu);
    ModelTerms terms{model, {}};
    for (std::size_t i = 0; i < terms.of.size(); ++i) {
      terms.of[i] = sensors.at(i / channels_per_sensor).axes[i % channels_per_sensor];
      terms.flicker_from_s[i] = (i < channels_per_sensor ? imu.gyro : imu.accelerometer).flicker_from_s;
    }
    return terms;
  } catch (const ConfigError& error) {
    const std::string& fault = error.faults.front();
    const std::size_t key = fault.find(".model: ");
    throw std::invalid_argument(key == std::string::npos ? fault : fault.substr(key + 8));
  }
}

}  // namespace imud
