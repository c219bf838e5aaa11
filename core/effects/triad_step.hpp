// TriadStep: one sample of three sensors of a kind, on its way through the effects.
#pragma once

#include <cstdint>

#include "core/numbers/lanes.hpp"
#include "core/numbers/random.hpp"
#include "core/vector.hpp"

namespace imud {

// The surroundings of a sensor that act on its errors.
struct Surroundings {
  double temperature_c = 25;    // degrees Celsius, of the sensor
  double temperature_rate = 0;  // K/s, its mean derivative over the step
  double vibration_power = 1;   // of Vibration: the factor on its mean square
};

// The properties of an effect by which Triad chooses its calls.
struct EffectTraits {
  bool is_of_memo = false;   // the memo has the effect
  bool is_rare = false;      // hardly any sensor has the effect: Triad::apply<false>() leaves it out
  bool is_constant = false;  // constant while the power is on, without a state: its parameters may be replaced
};

// TriadErrors defines the unit u. An effect is a class with
//   static constexpr std::string_view name     from the table in core/README.md
//   static constexpr EffectTraits traits
//   Effect(const TriadErrors&, Quantity, double period_s)
//   bool is_on() const noexcept
//   void apply(TriadStep&) noexcept            called only if it is on
//   void seek(const Normals&, std::uint64_t k) noexcept
//                                              after which apply() of sample k does as in the sequence from sample 0
//   void power_on(std::uint64_t number) noexcept
// The last two are empty in StatelessEffect. An effect with NormalSequences also has
//   template <class Visit> void each_sequence(Visit visit) noexcept
//                                              which calls visit(sequence) for each of them, or visit(sequence,
//                                              stride) if it takes a number only for each `stride` samples
// An effect with a memory also has
//   void continue_from(const Effect& before, const Normals&, std::uint64_t k) noexcept
//                                              after which apply() of sample k goes on from that effect, which has
//                                              other parameters and was applied last to sample k - 1
struct TriadStep {
  const Normals& normals;
  std::uint64_t k;                // number of the sample
  double dt;                      // s, the step of the increments; 0 if they are 0
  double since_power_on;          // s, at the end of the step: the samples taken since then, times their period
  const Vector3& specific_force;  // m/s^2, without errors, in platform axes, at the end of the step
  const Vector3& delta_velocity;  // m/s, its integral over the step
  const Surroundings& surroundings = ordinary;  // at the end of the step

  Lanes value;      // u, at the end of the step
  Lanes increment;  // u s, its integral over the step

  // AddErrors adds these sums of the additive errors, u: the constant errors of the step, and the other errors, at
  // the step's end and as their mean.
  Lanes constant_error = {};
  Lanes error = {}, mean_error = {};

  bool begins_run = false;      // there is no value before this one
  std::uint32_t saturated = 0;  // bit i: axis i

  static constexpr Surroundings ordinary{};
};

struct StatelessEffect {
  void seek(const Normals&, std::uint64_t) noexcept {}
  void power_on(std::uint64_t) noexcept {}
};

}  // namespace imud
