#pragma once

#include <limits>
#include <string_view>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"
#include "core/numbers/lanes.hpp"

namespace imud {

// Returns the floor, nearest or ceiling integer of magnitudes, which are not negative. `least` is the least fraction
// that is rounded up (least_rounded_up()).
[[gnu::always_inline]] inline Lanes round_magnitude(Lanes magnitude, double least) noexcept {
  constexpr double integers = 0x1p52;  // every double from here on is an integer
  const Lanes nearest = (magnitude + integers) - integers;
  const Lanes floor = nearest - select(nearest > magnitude, all_lanes(1.0), all_lanes(0.0));
  const Lanes rounded = floor + select(magnitude - floor >= least, all_lanes(1.0), all_lanes(0.0));
  return select(magnitude < integers, rounded, magnitude);
}

constexpr double least_rounded_up(Rounding rounding) noexcept {
  switch (rounding) {
    case Rounding::nearest:
      return 0.5;
    case Rounding::away_from_zero:
      return std::numeric_limits<double>::denorm_min();
    case Rounding::toward_zero:
    default:
      return 2.0;  // none
  }
}

// The rounding of the value to its LSB (memo Eq. 19), and the change of the increment by that rounding:
//   m' = m + carried,  m <- lsb round(m'/lsb),  increment <- increment - dt (m' - m - carried)
// With `carry`, the remainder m' - m is added to the next sample. Increments that have an LSB of their own
// (IncrementRounding) are not changed by the rounding of the values.
class ValueRounding {
 public:
  static constexpr std::string_view name = "rounding";
  static constexpr EffectTraits traits = {.is_of_memo = true};
  ValueRounding(const TriadErrors& errors, Quantity, double)
      : lsb_(errors.lsb),
        least_(least_rounded_up(errors.rounding)),
        carry_(errors.carry),
        share_(errors.increment_lsb > 0.0 ? 0.0 : 1.0) {}
  bool is_on() const noexcept { return lsb_ > 0.0; }
  void apply(TriadStep& step) noexcept {
    const Lanes carried = carry_ ? lanes(remainder_) : all_lanes(0.0);
    const Lanes m = step.value + carried;
    const Lanes rounded = with_sign_of(m, lsb_ * round_magnitude(magnitude(m / lsb_), least_));
    const Lanes remainder = m - rounded;
    step.increment -= share_ * step.dt * (remainder - carried);
    remainder_ = vector_of(remainder);
    step.value = rounded;
  }
  void seek(const Normals&, std::uint64_t) noexcept {}  // the remainder is not known without the sequence
  void power_on(std::uint64_t) noexcept {}
  void continue_from(const ValueRounding& before, const Normals&, std::uint64_t) noexcept {
    remainder_ = before.remainder_;
  }

 private:
  double lsb_;
  double least_;
  bool carry_;
  double share_;  // 1: the rounding of the value changes the increment; 0: it does not
  Vector3 remainder_ = Vector3::Zero();
};

}  // namespace imud
