// The confidence interval of a pass rate.
#pragma once

#include <cstdint>

namespace imud {

// Bounds of a probability, from 0 to 1.
struct Interval {
  double low = 0, high = 1;
};

// Returns Wilson's score interval, two-sided and without continuity correction, for the probability of success if
// `passes` of `runs` have passed: with p = passes/runs and z such that a standard normal deviate lies within -z and z
// with the probability `confidence` (1.96 for 95 %), the roots of (p - x)^2 = z^2 x(1 - x)/runs.
// Without runs nothing is known: 0 to 1. Source: SciPy 1.10, scipy/stats/_binomtest.py,
// proportion_ci(method="wilson"), which names E. B. Wilson, J. Amer. Stat. Assoc. 22 (1927) 209-212, and R. G.
// Newcombe, Statistics in Medicine 17 (1998) 857-872; neither paper was at hand.
Interval wilson_interval(std::uint64_t passes, std::uint64_t runs, double confidence = 0.95) noexcept;

}  // namespace imud
