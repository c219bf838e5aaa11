#include "core/environment/temperature.hpp"

#include <algorithm>

#include "core/numbers/elementary.hpp"
#include "core/numbers/piecewise_linear.hpp"
#include "core/numbers/round_to.hpp"

namespace imud {

// Returns w, the present share of warm_up_c.
double Temperature::warmth(double t) const noexcept {
  const double since = std::max(t - changed_s_, 0.0);
  if (has_power_) return 1.0 - (1.0 - share_) * elementary::exp(-since / model_.warm_up_s);
  return share_ * elementary::exp(-since / (model_.cool_down_s > 0 ? model_.cool_down_s : model_.warm_up_s));
}

void Temperature::power_off(double t) noexcept {
  share_ = warmth(t);
  changed_s_ = t;
  has_power_ = false;
}

void Temperature::power_on(double t) noexcept {
  share_ = warmth(t);
  changed_s_ = 0;
  has_power_ = true;
  updated_s_.reset();
  measurement_ = -1;
}

void Temperature::continue_from(const Temperature& before) noexcept {
  share_ = before.share_;
  changed_s_ = before.changed_s_;
  has_power_ = before.has_power_;
  updated_s_ = before.updated_s_;
  if (on_) sensor_c_ = before.sensor_c_;
}

double Temperature::at(double t, std::optional<double> truth_c) const noexcept {
  double temperature = truth_c.value_or(constant_c_);
  if (!model_.profile_s.empty() && !truth_c) temperature = piecewise_linear(model_.profile_s, model_.profile_c, t);
  if (model_.warm_up_c != 0.0) temperature += model_.warm_up_c * warmth(t);
  return temperature;
}

double Temperature::measured(double temperature) const noexcept {
  temperature += model_.offset_c;
  return model_.lsb_c > 0.0 ? round_to(temperature, model_.lsb_c) : temperature;
}

double Temperature::reported(double t) const noexcept {
  // measurement() adds a small number, because `t` at the instant of a measurement may be rounded down.
  return measured(at(model_.rate_hz > 0.0 ? measurement(t) / model_.rate_hz : t));
}

void Temperature::update(double t, std::optional<double> truth_c) noexcept {
  const double before_c = sensor_c_;
  sensor_c_ = at(t, truth_c);
  sensor_rate_ = updated_s_ && t > *updated_s_ ? (sensor_c_ - before_c) / (t - *updated_s_) : 0.0;
  updated_s_ = t;
  if (!truth_c) {
    reported_c_ = reported(t);
  } else if (model_.rate_hz == 0.0 || measurement(t) != measurement_) {
    measurement_ = measurement(t);
    reported_c_ = measured(sensor_c_);
  }
}

}  // namespace imud
