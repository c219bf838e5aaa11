// Triad: three sensors of a kind on the platform axes, with their errors.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <type_traits>
#include <utility>

#include "core/effects/acceleration_sensitivity.hpp"
#include "core/effects/add_errors.hpp"
#include "core/effects/bandwidth.hpp"
#include "core/effects/bias.hpp"
#include "core/effects/exponentially_correlated.hpp"
#include "core/effects/flicker.hpp"
#include "core/effects/gauss_markov.hpp"
#include "core/effects/increment_rounding.hpp"
#include "core/effects/misalignment.hpp"
#include "core/effects/nonlinearity.hpp"
#include "core/effects/ramp.hpp"
#include "core/effects/random_walk.hpp"
#include "core/effects/rare/cross_sensitivity.hpp"
#include "core/effects/rare/dead_zone.hpp"
#include "core/effects/rare/fir_filter.hpp"
#include "core/effects/rare/popcorn_noise.hpp"
#include "core/effects/rare/quantization_noise.hpp"
#include "core/effects/rare/thermal_drift.hpp"
#include "core/effects/saturation.hpp"
#include "core/effects/scale_factor.hpp"
#include "core/effects/temperature_bias.hpp"
#include "core/effects/temperature_scale.hpp"
#include "core/effects/turn_on_bias.hpp"
#include "core/effects/value_rounding.hpp"
#include "core/effects/vibration_rectification.hpp"
#include "core/effects/white_noise.hpp"

namespace imud {

// All effects, in the order in which they act. Effects on the truth are first, because bias and noise arise behind
// the input axes and are not scaled by them. The filter acts on the motion and the noise alike, before the
// converter rounds. Saturation is last, as in the memo, so that no value is beyond the range. The increments
// are rounded after Saturation.
using TriadEffects = std::tuple<Misalignment, DeadZone, ScaleFactor, Nonlinearity, TemperatureScale,  // on the truth
                                Bias, TemperatureBias, ThermalDrift, GaussMarkov, TurnOnBias, Ramp,   // added
                                AccelerationSensitivity, CrossSensitivity, VibrationRectification,    // added
                                WhiteNoise, Flicker, ExponentiallyCorrelated, PopcornNoise,           // added
                                RandomWalk, QuantizationNoise, AddErrors,       // added, and their sum
                                FirFilter, Bandwidth,                           // of the value
                                ValueRounding, Saturation, IncrementRounding>;  // at the output

// The names of the effects, in that order.
inline constexpr auto triad_effect_names = []<class... Effect>(std::tuple<Effect...>*) {
  return std::array{Effect::name...};
}(static_cast<TriadEffects*>(nullptr));

// The three sensors. Does not allocate, lock or throw; not thread-safe.
class Triad {
 public:
  // `period_s` is the nominal sample period, by which densities become standard deviations of samples; above 0.
  Triad(const TriadErrors& errors, Quantity quantity, double period_s)
      : effects_(make(errors, quantity, period_s, static_cast<TriadEffects*>(nullptr))) {
    note_what_is_on();
  }

  // Turns the true value and increment into the measured ones. Where only effects of the memo are on, the others cost
  // one test together. Without `Rare`, the rare effects must be off, and cost nothing.
  template <bool Rare = true>
  [[gnu::always_inline]] void apply(TriadStep& step) noexcept {
    if (is_memos_)
      each([&step]<class Effect>(Effect & effect) __attribute__((always_inline)) {
        if constexpr (Effect::traits.is_of_memo)
          if (effect.is_on()) effect.apply(step);
      });
    else
      each([&step]<class Effect>(Effect & effect) __attribute__((always_inline)) {
        if constexpr (Rare || !Effect::traits.is_rare)
          if (effect.is_on()) effect.apply(step);
      });
  }
  bool has_rare() const noexcept { return has_rare_; }
  // Makes the next sample number k, with the errors that sample k has in the sequence from sample 0, except for the
  // remainders of rounding. The run time is proportional to k where an effect has a memory.
  void seek(const Normals& normals, std::uint64_t k) noexcept {
    each([&normals, k](auto& effect) { effect.seek(normals, k); });
  }
  // `number` is the number of this power on, from 0.
  void power_on(std::uint64_t number) noexcept {
    each([number](auto& effect) { effect.power_on(number); });
  }
  // Calls visit(NormalSequence&, std::uint64_t stride = 1) for each sequence of the effects that are on
  // (triad_step.hpp).
  template <class Visit>
  void each_sequence(Visit visit) noexcept {
    each([&visit](auto& effect) {
      if constexpr (requires { effect.each_sequence(visit); })
        if (effect.is_on()) effect.each_sequence(visit);
    });
  }
  // Makes sample k the next, with the memory of `before`, whose parameters may be others (triad_step.hpp).
  void continue_from(const Triad& before, const Normals& normals, std::uint64_t k) noexcept {
    const auto go_on = [&]<class Effect>(Effect& effect) {
      constexpr bool goes_on = requires(const Effect& other) { effect.continue_from(other, normals, k); };
      static_assert(goes_on || std::is_base_of_v<StatelessEffect, Effect>, "an effect with a memory goes on with it");
      if constexpr (goes_on) effect.continue_from(std::get<Effect>(before.effects_), normals, k);
    };
    each(go_on);
  }
  // Replaces the constant errors of the inputs, of the bias by temperature, and of the vibration, from the next
  // sample on. Effects with a state have set_constants().
  void set_constants(const TriadErrors& errors, Quantity quantity) noexcept {
    each([&]<class Effect>(Effect& effect) {
      static_assert(!Effect::traits.is_constant || std::is_base_of_v<StatelessEffect, Effect>);
      if constexpr (Effect::traits.is_constant)
        effect = Effect(errors, quantity, 0);
      else if constexpr (requires { effect.set_constants(errors); })
        effect.set_constants(errors);
    });
    note_what_is_on();
  }
  // Bias::set().
  void set_bias(const Vector3& bias) noexcept { std::get<Bias>(effects_).set(bias); }
  // Bandwidth::reserve() and set().
  void reserve_filter(int length) { std::get<Bandwidth>(effects_).reserve(length); }
  void set_filter(const SensorFilter& filter) noexcept {
    std::get<Bandwidth>(effects_).set(filter);
    note_what_is_on();
  }

 private:
  template <class... Effect>
  static TriadEffects make(const TriadErrors& errors, Quantity quantity, double period_s, std::tuple<Effect...>*) {
    return TriadEffects(Effect(errors, quantity, period_s)...);
  }
  void note_what_is_on() noexcept {
    is_memos_ = true;
    has_rare_ = false;
    each([this]<class Effect>(Effect& effect) {
      is_memos_ = is_memos_ && (Effect::traits.is_of_memo || !effect.is_on());
      has_rare_ = has_rare_ || (Effect::traits.is_rare && effect.is_on());
    });
  }
  // Inline, so that apply() is compiled for the processor of its caller (core/numbers/dispatch.hpp).
  template <class Visit>
  [[gnu::always_inline]] void each(Visit visit) noexcept {
    [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
      (visit(std::get<I>(effects_)), ...);
    }
    (std::make_index_sequence<std::tuple_size_v<TriadEffects>>());
  }

  TriadEffects effects_;
  bool is_memos_ = true;  // no other effect is on
  bool has_rare_ = false;
};

}  // namespace imud
