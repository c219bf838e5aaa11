// Temperature: that of the sensor, and what the sensor reports of it.
#pragma once

#include <vector>

namespace imud {

// The default of every member switches its part off.
struct TemperatureModel {
  // The surroundings: linear between points, constant before the first and after the last. Times, s, ascend; as many
  // temperatures, degrees Celsius, as times. Empty: constant.
  std::vector<double> profile_s, profile_c;
  double warm_up_c = 0;    // by which the sensor becomes warmer than its surroundings
  double warm_up_s = 600;  // time constant, above 0
  // The sensor's own measurement.
  double offset_c = 0;
  double lsb_c = 0;    // not negative; 0: no rounding
  double rate_hz = 0;  // measurements per second, not negative; 0: one for each sample
};

// The temperature at the time t since power on, by the device's clock:
//   T = profile(t) + warm_up (1 - exp(-t/time constant))
//   reported: lsb round((T + offset)/lsb), of the last whole multiple of 1/rate_hz
// Does not allocate once made, lock or throw; immutable.
class Temperature {
 public:
  Temperature(const TemperatureModel& model, double constant_c)
      : model_(model),
        constant_c_(constant_c),
        on_(!model.profile_s.empty() || model.warm_up_c != 0.0 || model.lsb_c > 0.0 || model.offset_c != 0.0) {}
  // Returns false if sensor and measurement have the constant temperature.
  bool is_on() const noexcept { return on_; }
  // Return degrees Celsius at `t`, s.
  [[gnu::noinline]] double at(double t) const noexcept;
  [[gnu::noinline]] double reported(double t) const noexcept;

 private:
  TemperatureModel model_;
  double constant_c_;
  bool on_;
};

}  // namespace imud
