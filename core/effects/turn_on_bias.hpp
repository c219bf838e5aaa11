#pragma once

#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// The bias that differs from one power on to the next, and stays until the power is off: data sheets' repeatability.
//   error += s n,  n ~ N(0, I), drawn for the number of the power on
class TurnOnBias {
 public:
  static constexpr std::string_view name = "turn-on bias";
  static constexpr EffectTraits traits = {};
  TurnOnBias(const TriadErrors& errors, Quantity quantity, double)
      : sigma_(errors.turn_on_bias), quantity_(quantity), on_(!errors.turn_on_bias.isZero(0.0)) {}
  bool is_on() const noexcept { return on_; }
  void apply(TriadStep& step) noexcept {
    if (!drawn_) {
      bias_ = sigma_.cwiseProduct(step.normals(quantity_, Process::turn_on_bias, number_));
      drawn_ = true;
    }
    step.constant_error += lanes(bias_);
  }
  void seek(const Normals&, std::uint64_t) noexcept {}
  void power_on(std::uint64_t number) noexcept {
    number_ = number;
    drawn_ = false;
  }
  // Keeps the bias of `before` if both have the same standard deviation. Otherwise the bias is drawn again.
  void continue_from(const TurnOnBias& before, const Normals&, std::uint64_t) noexcept {
    number_ = before.number_;
    drawn_ = before.drawn_ && before.sigma_ == sigma_;
    bias_ = before.bias_;
  }

 private:
  Vector3 sigma_;
  Quantity quantity_;
  bool on_;
  std::uint64_t number_ = 0;
  bool drawn_ = false;
  Vector3 bias_ = Vector3::Zero();
};

}  // namespace imud
