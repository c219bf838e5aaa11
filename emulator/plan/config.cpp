#include "emulator/plan/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace imud {

ConfigError::ConfigError(std::vector<std::string> all)
    : std::runtime_error(fmt::format("{}", fmt::join(all, "\n"))), faults(std::move(all)) {}

bool is_capture(const std::string& truth_port) noexcept {
  const Transport* transport = transport_of(truth_port);
  return transport != nullptr && transport->ends;
}

ImuConfig without_errors(const ImuConfig& imu) {
  ImuConfig ideal = imu;
  ideal.protocol = find_protocol("native");
  ideal.settings = Settings(ideal.protocol->settings);
  ideal.second_port.clear();
  ideal.also.clear();
  ideal.also_settings.clear();
  ideal.device_filters = false;
  ideal.errors_model = model_of_truth;
  ImuModel& model = ideal.model;
  model.internal_samples = 1;
  model.gyro = model.accelerometer = model.magnetometer = TriadErrors{};
  model.accelerometer_positions.setZero();
  model.sampling_jitter = Nanoseconds{0};
  model.barometer = BarometerErrors{};
  model.navigation = NavigationErrors{};
  return ideal;
}

}  // namespace imud
