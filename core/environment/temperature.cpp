#include "core/environment/temperature.hpp"

#include <algorithm>
#include <cstddef>

#include "core/numbers/elementary.hpp"
#include "core/numbers/round_to.hpp"

namespace imud {

double Temperature::at(double t, std::optional<double> truth_c) const noexcept {
  double temperature = truth_c.value_or(constant_c_);
  const std::vector<double>&time = model_.profile_s, &value = model_.profile_c;
  if (!time.empty() && !truth_c) {
    const auto next = static_cast<std::size_t>(std::upper_bound(time.begin(), time.end(), t) - time.begin());
    if (next == 0)
      temperature = value.front();
    else if (next == time.size())
      temperature = value.back();
    else
      temperature =
          value[next - 1] + (t - time[next - 1]) / (time[next] - time[next - 1]) * (value[next] - value[next - 1]);
  }
  if (model_.warm_up_c != 0.0)
    temperature += model_.warm_up_c * (1.0 - elementary::exp(-std::max(t, 0.0) / model_.warm_up_s));
  return temperature;
}

double Temperature::measured(double temperature) const noexcept {
  temperature += model_.offset_c;
  return model_.lsb_c > 0.0 ? round_to(temperature, model_.lsb_c) : temperature;
}

double Temperature::reported(double t) const noexcept {
  // measurement() adds a small number, because t of the instant itself may be rounded down.
  return measured(at(model_.rate_hz > 0.0 ? measurement(t) / model_.rate_hz : t));
}

void Temperature::update(double t, std::optional<double> truth_c) noexcept {
  sensor_c_ = at(t, truth_c);
  if (!truth_c) {
    reported_c_ = reported(t);
  } else if (model_.rate_hz == 0.0 || measurement(t) != measurement_) {
    measurement_ = measurement(t);
    reported_c_ = measured(sensor_c_);
  }
}

}  // namespace imud
