// The errors of barometers and navigation solutions in a configuration.
#include "core/units.hpp"
#include "emulator/config/config_parts.hpp"

namespace imud {
namespace {
constexpr double most = 1e6;
}

void read_barometer(TableReader table, BarometerErrors& errors) {
  errors.lag_s = table.real("lag_s", errors.lag_s, 0, most);
  errors.bias = table.real("bias_pa", errors.bias, -most, most);
  errors.drift = table.real("drift_pa", errors.drift, 0, most);
  errors.drift_correlation_s = table.real("drift_correlation_s", errors.drift_correlation_s, 1e-3, 1e9);
  errors.noise = table.real("noise_pa", errors.noise, 0, most);
  table.finish();
}

NavigationErrors read_navigation(TableReader table) {
  NavigationErrors errors;
  const auto correlation = [&table](std::string_view key, double& time_s) {
    time_s = table.real(key, time_s, 1e-3, 1e9);
  };
  errors.latency = nanoseconds(table.real("latency_s", 0, 0, 10));
  errors.time_s = table.real("time_s", errors.time_s, 0, 1);
  correlation("time_correlation_s", errors.time_correlation_s);
  errors.position = table.per_axis("position_m", errors.position, 0, most);
  correlation("position_correlation_s", errors.position_correlation_s);
  errors.position_noise = table.per_axis("position_noise_m", errors.position_noise, 0, most);
  errors.velocity = table.per_axis("velocity_m_per_s", errors.velocity, 0, most);
  correlation("velocity_correlation_s", errors.velocity_correlation_s);
  errors.velocity_noise = table.per_axis("velocity_noise_m_per_s", errors.velocity_noise, 0, most);
  const double roll_pitch = units::degree * table.real("roll_pitch_deg", 0, 0, 90);
  errors.attitude = {roll_pitch, roll_pitch, units::degree * table.real("heading_deg", 0, 0, 180)};
  correlation("attitude_correlation_s", errors.attitude_correlation_s);
  table.finish();
  return errors;
}

}  // namespace imud
