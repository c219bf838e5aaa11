// WrappingTime: a simulator's time from a counter that wraps to zero.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <optional>

namespace imud {

// Counts the wraps of a counter. A step of less than a minute in either direction continues the time, even across
// a wrap, so that reordered records keep their own times. After any other step backwards the simulator is assumed
// to have restarted, with no wrap yet. Allocates nothing. One thread.
class WrappingTime {
 public:
  // `modulus`: the time from wrap to wrap, ns.
  explicit WrappingTime(std::int64_t modulus) noexcept : modulus_(modulus) {}

  // Returns the time, ns, for a counter reading of `ns`.
  std::int64_t of(std::int64_t ns) noexcept {
    constexpr std::int64_t most_step = 60'000'000'000;
    if (last_) {
      const std::int64_t step = ns - *last_;
      const std::int64_t over_the_end = step < 0 ? step + modulus_ : step - modulus_;
      if (std::abs(over_the_end) < most_step && std::abs(over_the_end) < std::abs(step))
        round_ += step < 0 ? 1 : -1;
      else if (step <= -most_step)
        round_ = 0;
    }
    last_ = ns;
    return round_ * modulus_ + ns;
  }

 private:
  std::int64_t modulus_;
  std::int64_t round_ = 0;
  std::optional<std::int64_t> last_;
};

}  // namespace imud
