#include "core/temperature.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/elementary.hpp"

namespace imud {

double Temperature::at(double t) const noexcept {
  double temperature = constant_c_;
  const std::vector<double>&time = model_.profile_s, &value = model_.profile_c;
  if (!time.empty()) {
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

double Temperature::reported(double t) const noexcept {
  // The small number: t of the instant itself may be rounded down.
  if (model_.rate_hz > 0.0) t = std::floor(t * model_.rate_hz + 1e-6) / model_.rate_hz;
  const double measured = at(t) + model_.offset_c;
  return model_.lsb_c > 0.0 ? model_.lsb_c * std::floor(measured / model_.lsb_c + 0.5) : measured;
}

}  // namespace imud
