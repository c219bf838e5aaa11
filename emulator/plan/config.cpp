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

bool has_live_truth(const Config& config) noexcept {
  return config.clock == ClockMode::realtime && !is_capture(config.truth.port);
}

Epoch epoch_of(const Config& config) noexcept { return has_live_truth(config) ? config.realtime.epoch : Epoch::none; }

std::vector<std::pair<std::string_view, std::string>> ports_of(const ImuConfig& imu) {
  std::vector<std::pair<std::string_view, std::string>> ports = {{"port", imu.port},
                                                                 {"second_port", imu.second_port}};
  for (const std::string& copy : imu.also) ports.emplace_back("also", copy);
  return ports;
}

std::vector<std::string> names_of(std::span<const ImuConfig> imus) {
  std::vector<std::string> names;
  for (const ImuConfig& imu : imus) names.push_back(imu.name);
  return names;
}

TriadErrors ideal(const TriadErrors& errors) noexcept {
  TriadErrors none;
  none.max = errors.max;
  none.limits = errors.limits;
  return none;
}

ImuConfig ideal(const ImuConfig& imu) {
  ImuConfig same = imu;
  same.device_filters = false;
  same.errors_model = model_without_errors;
  ImuModel& model = same.model;
  model.internal_samples = 1;
  model.gyro = ideal(model.gyro);
  model.accelerometer = ideal(model.accelerometer);
  model.magnetometer = ideal(model.magnetometer);
  if (model.inclinometer) model.inclinometer = ideal(*model.inclinometer);
  model.accelerometer_positions.setZero();
  model.sampling_jitter = model.sampling_delay = Nanoseconds{0};
  model.stamp_error = StampErrorModel{};
  model.current_field.setZero();
  model.current_field_sigma.setZero();
  model.barometer = BarometerErrors{};
  model.navigation = NavigationErrors{};
  same.navigator.is_on = false;
  return same;
}

ImuConfig without_errors(const ImuConfig& imu) {
  ImuConfig truth = ideal(imu);
  truth.protocol = find_protocol("native");
  truth.settings = Settings(truth.protocol->settings);
  truth.second_port.clear();
  truth.also.clear();
  truth.also_settings.clear();
  truth.errors_model = model_of_truth;
  truth.model.gyro = truth.model.accelerometer = truth.model.magnetometer = TriadErrors{};
  truth.model.inclinometer.reset();
  return truth;
}

}  // namespace imud
