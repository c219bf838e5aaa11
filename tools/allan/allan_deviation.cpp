#include "tools/allan/allan_deviation.hpp"

#include <array>
#include <cmath>

namespace imud {
namespace {

// Neumaier's compensated sum.
class CompensatedSum {
 public:
  void add(double x) noexcept {
    const double sum = sum_ + x;
    lost_ += std::abs(sum_) >= std::abs(x) ? (sum_ - sum) + x : (x - sum) + sum_;
    sum_ = sum;
  }
  double value() const noexcept { return sum_ + lost_; }

 private:
  double sum_ = 0, lost_ = 0;
};

// Returns the sum of the squares of difference(i) for i from `begin` up to `end` in steps of `stride`. Four sums at
// once keep the processor's pipeline busy, which a single one does not.
template <class Difference>
double sum_of_squares(std::size_t begin, std::size_t end, std::size_t stride, Difference difference) noexcept {
  std::array<double, 4> sums{};
  std::size_t i = begin;
  for (; end - begin > 3 * stride && i < end - 3 * stride; i += 4 * stride) {
    for (std::size_t k = 0; k < sums.size(); ++k) {
      const double d = difference(i + k * stride);
      sums[k] += d * d;
    }
  }
  for (; i < end; i += stride) sums[0] += difference(i) * difference(i);
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

// The sum of squared second differences of the phase's averages over m points: SP1065 (13).
double modified_sum(const double* x, std::size_t m, std::size_t count) noexcept {
  CompensatedSum window;
  for (std::size_t i = 0; i < m; ++i) {
    window.add(x[i + 2 * m] - x[i + m]);
    window.add(x[i] - x[i + m]);
  }
  double sum = 0;
  for (std::size_t j = 0;; ++j) {
    const double d = window.value() / static_cast<double>(m);
    sum += d * d;
    if (j + 1 == count) return sum;
    window.add((x[j + 3 * m] - x[j + 2 * m]) - 2 * (x[j + 2 * m] - x[j + m]) + (x[j + m] - x[j]));
  }
}

// The sum of squared second differences about every inner point, where the phase is continued beyond its ends by
// reflection: SP1065 (25).
double total_sum(std::span<const double> x, std::size_t m) noexcept {
  const std::size_t last = x.size() - 1;
  const auto before = [&](std::size_t i) { return i >= m ? x[i - m] : 2 * x[0] - x[m - i]; };
  const auto after = [&](std::size_t i) { return i + m <= last ? x[i + m] : 2 * x[last] - x[2 * last - i - m]; };
  return sum_of_squares(1, last, 1, [&](std::size_t i) { return before(i) - 2 * x[i] + after(i); });
}

std::size_t stride_of(AllanKind kind, std::size_t factor) noexcept {
  return kind == AllanKind::allan || kind == AllanKind::hadamard ? factor : 1;
}

}  // namespace

std::string_view name_of(AllanKind kind) noexcept {
  switch (kind) {
    case AllanKind::allan:
      return "allan";
    case AllanKind::overlapping:
      return "overlapping";
    case AllanKind::modified:
      return "modified";
    case AllanKind::hadamard:
      return "hadamard";
    case AllanKind::overlapping_hadamard:
      return "overlapping-hadamard";
    case AllanKind::total:
      break;
  }
  return "total";
}

std::vector<double> phase_of(std::span<const double> rates) {
  if (rates.empty()) return {};
  CompensatedSum sum;
  for (const double rate : rates) sum.add(rate);
  const double mean = sum.value() / static_cast<double>(rates.size());
  std::vector<double> phase;
  phase.reserve(rates.size() + 1);
  CompensatedSum angle;
  phase.push_back(0);
  for (const double rate : rates) {
    angle.add(rate - mean);
    phase.push_back(angle.value());
  }
  return phase;
}

std::size_t largest_factor(AllanKind kind, std::size_t points) noexcept {
  if (points < 3) return 0;
  if (kind == AllanKind::modified) return points / 3;
  return kind == AllanKind::total ? points - 1 : (points - 1) / order_of(kind);
}

std::size_t difference_count(AllanKind kind, std::size_t points, std::size_t factor) noexcept {
  if (factor < 1 || factor > largest_factor(kind, points)) return 0;
  if (kind == AllanKind::modified) return points - 3 * factor + 1;
  return kind == AllanKind::total ? points - 2 : (points - 1 - order_of(kind) * factor) / stride_of(kind, factor) + 1;
}

double allan_deviation(AllanKind kind, std::span<const double> phase, std::size_t factor) noexcept {
  const double* x = phase.data();
  const std::size_t m = factor;
  const std::size_t count = difference_count(kind, phase.size(), m);
  if (count == 0) return 0;
  double sum = 0;
  if (kind == AllanKind::modified)
    sum = modified_sum(x, m, count);
  else if (kind == AllanKind::total)
    sum = total_sum(phase, m);
  else if (is_hadamard(kind))
    sum = sum_of_squares(0, phase.size() - 3 * m, stride_of(kind, m), [=](std::size_t i) {
      return (x[i + 3 * m] - x[i + 2 * m]) - 2 * (x[i + 2 * m] - x[i + m]) + (x[i + m] - x[i]);
    });
  else
    sum = sum_of_squares(0, phase.size() - 2 * m, stride_of(kind, m),
                         [=](std::size_t i) { return (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i]); });
  const double divisor = is_hadamard(kind) ? 6 : 2;
  return std::sqrt(sum / (divisor * static_cast<double>(count))) / static_cast<double>(m);
}

std::vector<std::size_t> averaging_factors(std::size_t largest, unsigned per_decade) {
  std::vector<std::size_t> factors;
  for (unsigned k = 0;; ++k) {
    const double factor =
        per_decade == 0 ? std::exp2(k) : std::round(std::pow(10.0, k / static_cast<double>(per_decade)));
    if (factor > static_cast<double>(largest)) return factors;
    const auto whole = static_cast<std::size_t>(factor);
    if (factors.empty() || whole > factors.back()) factors.push_back(whole);
  }
}

}  // namespace imud
