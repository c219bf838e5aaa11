// The temperature of the sensor, true and as the sensor reports it.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

namespace imud {

// The default of every member switches its part off.
struct TemperatureModel {
  // The surroundings: linear between points, constant before the first and after the last. Times, s, ascend; as many
  // temperatures, degrees Celsius, as times. Empty: constant.
  std::vector<double> profile_s, profile_c;
  bool from_truth = false;  // the truth's temperature, where it has one, takes the place of these
  double warm_up_c = 0;     // by which the sensor becomes warmer than its surroundings
  double warm_up_s = 600;   // time constant, above 0
  // The sensor's own measurement.
  double offset_c = 0;
  double lsb_c = 0;    // not negative; 0: no rounding
  double rate_hz = 0;  // measurements per second, not negative; 0: one for each sample
};

// The temperature at the time t since power on:
//   T = profile(t) + warm_up (1 - exp(-t/time constant))
//   reported: lsb round((T + offset)/lsb), of the last whole multiple of 1/rate_hz; with the truth's temperature, of
//             the first sample since then
// Does not allocate once made, lock or throw; not thread-safe.
class Temperature {
 public:
  Temperature(const TemperatureModel& model, double constant_c)
      : model_(model),
        constant_c_(constant_c),
        on_(!model.profile_s.empty() || model.from_truth || model.warm_up_c != 0.0 || model.lsb_c > 0.0 ||
            model.offset_c != 0.0) {}
  // Returns false if sensor and measurement have the constant temperature.
  bool is_on() const noexcept { return on_; }
  bool follows_truth() const noexcept { return model_.from_truth; }
  // Computes the temperatures of the sample at `t`, s, later than the last; `truth_c`: of the surroundings.
  [[gnu::noinline]] void update(double t, std::optional<double> truth_c) noexcept;
  // Goes on from the temperature of `before` until the next update().
  void continue_from(const Temperature& before) noexcept {
    if (on_) sensor_c_ = before.sensor_c_;
  }
  // Return degrees Celsius, as update() has computed them.
  double sensor_c() const noexcept { return sensor_c_; }
  double reported_c() const noexcept { return reported_c_; }
  // Return degrees Celsius at `t`, s.
  double at(double t, std::optional<double> truth_c = {}) const noexcept;
  double reported(double t) const noexcept;

 private:
  double measurement(double t) const noexcept { return std::floor(t * model_.rate_hz + 1e-6); }
  double measured(double temperature) const noexcept;

  TemperatureModel model_;
  double constant_c_;
  bool on_;
  double sensor_c_ = constant_c_, reported_c_ = constant_c_;
  double measurement_ = -1;  // the number of the one that is reported
};

}  // namespace imud
