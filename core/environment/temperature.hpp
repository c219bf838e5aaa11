// The temperature of the sensor: the true one, and the one that the sensor reports.
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
  bool from_truth = false;  // the truth's temperature, where there is one, replaces the profile
  double warm_up_c = 0;     // the final warming of the sensor above its surroundings
  double warm_up_s = 600;   // time constant, above 0
  double cool_down_s = 0;   // time constant without power, not negative; 0: warm_up_s
  // The sensor's own measurement.
  double offset_c = 0;
  double lsb_c = 0;    // not negative; 0: no rounding
  double rate_hz = 0;  // measurements per second, not negative; 0: one for each sample
};

// The temperature at the time t since power on:
//   T = profile(t) + warm_up w
//   w = 1 - (1 - w0) exp(-t/warm_up_s) with power, w0 exp(-t/cool_down_s) without
// where t counts from the last change of the power and w0 is w there, 0 at the first power on.
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
  // Computes the temperatures of the sample at `t`, s, which must be after the last `t`. `truth_c` is the truth's
  // temperature of the surroundings.
  [[gnu::noinline]] void update(double t, std::optional<double> truth_c) noexcept;
  // Switch the power off, or on, at `t`, s. After power_on() the times of later calls count from that instant.
  void power_off(double t) noexcept;
  void power_on(double t) noexcept;
  // Takes over the warm-up of `before`, and its temperature until the next update().
  void continue_from(const Temperature& before) noexcept;
  // Return the temperatures that the last update() has computed, degrees Celsius, and the mean derivative of the
  // sensor's temperature between the last two updates, K/s.
  double sensor_c() const noexcept { return sensor_c_; }
  double sensor_rate() const noexcept { return sensor_rate_; }
  double reported_c() const noexcept { return reported_c_; }
  // Return the sensor's temperature and the reported one at `t`, s, in degrees Celsius.
  double at(double t, std::optional<double> truth_c = {}) const noexcept;
  double reported(double t) const noexcept;

 private:
  double warmth(double t) const noexcept;
  double measurement(double t) const noexcept { return std::floor(t * model_.rate_hz + 1e-6); }
  double measured(double temperature) const noexcept;

  TemperatureModel model_;
  double constant_c_;
  bool on_;
  double sensor_c_ = constant_c_, reported_c_ = constant_c_;
  double measurement_ = -1;  // the number of the measurement that is reported
  double sensor_rate_ = 0;
  std::optional<double> updated_s_;  // the time of the last update() since power on
  double share_ = 0;                 // reached part of warm_up_c at the last change of the power
  double changed_s_ = 0;             // the time of that change
  bool has_power_ = true;
};

}  // namespace imud
