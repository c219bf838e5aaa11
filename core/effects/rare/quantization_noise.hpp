#pragma once

#include <cstdint>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// Noise that is white in the angle or velocity, such as the noise of reading an angle, and of rounding (IEEE Std
// 952-1997, C.1.6). With samples of period T:
//   error += Q (n(k) - n(k - 1))/T,  n ~ N(0, I)
// so that the sum of the increments has the error Q n(k) of one reading. Its Allan variance is 3 Q^2/tau^2.
class QuantizationNoise {
 public:
  static constexpr std::string_view name = "quantization noise";
  static constexpr EffectTraits traits = {.is_rare = true};
  QuantizationNoise(const TriadErrors& errors, Quantity quantity, double period_s)
      : rate_(errors.quantization_noise / period_s),
        on_(!errors.quantization_noise.isZero(0.0)),
        readings_(quantity, Process::quantization_noise) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept {
    // Reading k is number k + 1.
    if (last_number_ != step.k) last_ = step.normals(readings_.quantity(), Process::quantization_noise, step.k);
    const Vector3 reading = readings_.at(step.normals, step.k + 1);
    step.constant_error += lanes(rate_) * (lanes(reading) - lanes(last_));
    last_ = reading;
    last_number_ = step.k + 1;
  }
  void seek(const Normals&, std::uint64_t) noexcept {}
  void power_on(std::uint64_t) noexcept {}
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    visit(readings_);
  }
  void continue_from(const QuantizationNoise& before, const Normals&, std::uint64_t) noexcept {
    last_ = before.last_;
    last_number_ = before.last_number_;
  }

 private:
  Vector3 rate_;
  bool on_;
  NormalSequence readings_;
  Vector3 last_ = Vector3::Zero();
  std::uint64_t last_number_ = ~std::uint64_t{0};  // of last_
};

}  // namespace imud
