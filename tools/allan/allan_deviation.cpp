#include "tools/allan/allan_deviation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "core/numbers/dispatch.hpp"

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

// Returns the sum of the squares of difference(i) for i from `begin` up to `end` in steps of `stride`. Several
// sums at once keep the processor's pipeline busy; a single sum does not.
template <class Difference>
inline double sum_of_squares(std::size_t begin, std::size_t end, std::size_t stride, Difference difference) noexcept {
  constexpr std::size_t lanes = 8;
  std::array<double, lanes> sums{};
  std::size_t i = begin;
  for (; end > (lanes - 1) * stride && i < end - (lanes - 1) * stride; i += lanes * stride) {
    for (std::size_t k = 0; k < lanes; ++k) {
      const double d = difference(i + k * stride);
      sums[k] += d * d;
    }
  }
  for (; i < end; i += stride) {
    const double d = difference(i);
    sums[0] += d * d;
  }
  return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}

// The differences of the phase from point i on, m points apart.
inline double second_difference(const double* x, std::size_t m, std::size_t i) noexcept {
  return (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i]);
}
inline double third_difference(const double* x, std::size_t m, std::size_t i) noexcept {
  return (x[i + 3 * m] - x[i + 2 * m]) - 2 * (x[i + 2 * m] - x[i + m]) + (x[i + m] - x[i]);
}

// If the stride is known to be 1, the compiler uses vector registers.
IMUD_DISPATCHED double second_differences(const double* x, std::size_t m, std::size_t begin, std::size_t end,
                                          std::size_t stride) {
  const auto difference = [=](std::size_t i) { return second_difference(x, m, i); };
  return stride == 1 ? sum_of_squares(begin, end, 1, difference) : sum_of_squares(begin, end, stride, difference);
}
IMUD_DISPATCHED double third_differences(const double* x, std::size_t m, std::size_t begin, std::size_t end,
                                         std::size_t stride) {
  const auto difference = [=](std::size_t i) { return third_difference(x, m, i); };
  return stride == 1 ? sum_of_squares(begin, end, 1, difference) : sum_of_squares(begin, end, stride, difference);
}

// The sum of squared second differences of the phase's averages over m points: SP1065 (13). The sum is updated
// from point to point.
class ModifiedSum {
 public:
  ModifiedSum(const double* x, std::size_t m, const ResidentPages& resident) noexcept : x_(x), m_(m) {
    constexpr std::size_t points = 4096;
    for (std::size_t i = 0; i < m; ++i) {
      window_.add(x[i + 2 * m] - x[i + m]);
      window_.add(x[i] - x[i + m]);
      if (i % points == 0) resident.touched(3 * points * sizeof(double));
    }
  }
  // Returns the sum over the points from `begin`, where the last call ended, up to `end`.
  double next(std::size_t begin, std::size_t end) noexcept {
    const double* x = x_;
    const std::size_t m = m_;
    double sum = 0;
    for (std::size_t j = begin; j < end; ++j) {
      if (j > 0) window_.add(third_difference(x, m, j - 1));
      const double d = window_.value() / static_cast<double>(m);
      sum += d * d;
    }
    return sum;
  }

 private:
  const double* x_;
  std::size_t m_;
  CompensatedSum window_;
};

// The sum of squared second differences about the inner points from `begin` to `end`, where the phase is continued
// beyond its ends by reflection: SP1065 (25).
double total_sum(std::span<const double> x, std::size_t m, std::size_t begin, std::size_t end) noexcept {
  const std::size_t last = x.size() - 1;
  const auto before = [&](std::size_t i) { return i >= m ? x[i - m] : 2 * x[0] - x[m - i]; };
  const auto after = [&](std::size_t i) { return i + m <= last ? x[i + m] : 2 * x[last] - x[2 * last - i - m]; };
  return sum_of_squares(begin, end, 1, [&](std::size_t i) { return before(i) - 2 * x[i] + after(i); });
}

std::size_t stride_of(AllanKind kind, std::size_t factor) noexcept {
  return kind == AllanKind::allan || kind == AllanKind::hadamard ? factor : 1;
}

// Sums the squares of a deviation's differences in pieces, in ascending order.
class Differences {
 public:
  Differences(AllanKind kind, std::span<const double> phase, std::size_t m, const ResidentPages& resident)
      : kind_(kind), phase_(phase), m_(m), count_(difference_count(kind, phase.size(), m)) {
    if (kind == AllanKind::modified && count_ > 0) modified_.emplace(phase.data(), m, resident);
  }

  // Adds the differences that begin (total: whose middle is) at the points from `begin` up to `end`.
  void add(std::size_t begin, std::size_t end) noexcept {
    const double* x = phase_.data();
    const std::size_t m = m_, stride = stride_of(kind_, m);
    if (count_ == 0) return;
    if (kind_ == AllanKind::total) {
      begin = std::max<std::size_t>(begin, 1);
      end = std::min(end, phase_.size() - 1);
      if (begin < end) sum_.add(total_sum(phase_, m, begin, end));
      return;
    }
    begin = (begin + stride - 1) / stride * stride;
    end = std::min(end, (count_ - 1) * stride + 1);
    if (begin >= end) return;
    if (kind_ == AllanKind::modified)
      sum_.add(modified_->next(begin, end));
    else if (is_hadamard(kind_))
      sum_.add(third_differences(x, m, begin, end, stride));
    else
      sum_.add(second_differences(x, m, begin, end, stride));
  }
  double deviation() const noexcept {
    if (count_ == 0) return 0;
    const double divisor = is_hadamard(kind_) ? 6 : 2;
    return std::sqrt(sum_.value() / (divisor * static_cast<double>(count_))) / static_cast<double>(m_);
  }

 private:
  AllanKind kind_;
  std::span<const double> phase_;
  std::size_t m_, count_;
  CompensatedSum sum_;
  std::optional<ModifiedSum> modified_;
};

// Four sums at once keep the processor's pipeline busy.
double mean_of(std::span<const double> rates, const ResidentPages& resident) {
  constexpr std::size_t points = 4096, lanes = 4;
  std::array<CompensatedSum, lanes> sums;
  for (std::size_t begin = 0; begin < rates.size(); begin += points) {
    const std::span<const double> piece = rates.subspan(begin, std::min(points, rates.size() - begin));
    std::size_t i = 0;
    for (; i + lanes <= piece.size(); i += lanes)
      for (std::size_t k = 0; k < lanes; ++k) sums[k].add(piece[i + k]);
    for (; i < piece.size(); ++i) sums[0].add(piece[i]);
    resident.touched(points * sizeof(double));
  }
  for (std::size_t k = 1; k < lanes; ++k) sums[0].add(sums[k].value());
  return sums[0].value() / static_cast<double>(rates.size());
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

SampleStore phase_of(SampleStore rates) {
  constexpr std::size_t points = 4096;
  const std::size_t count = rates.size();
  if (count == 0) return rates;
  rates.extend();
  double* const x = &rates[0];
  const ResidentPages resident = rates.pages();
  const double mean = mean_of(std::span(x, count), resident);
  CompensatedSum angle;
  for (std::size_t i = 0; i < count; ++i) {
    const double rate = std::exchange(x[i], angle.value());
    angle.add(rate - mean);
    if (i % points == 0) resident.touched(points * sizeof(double));
  }
  x[count] = angle.value();
  return rates;
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

std::vector<double> allan_deviations(AllanKind kind, std::span<const double> phase,
                                     std::span<const std::size_t> factors, const ResidentPages& resident) {
  constexpr std::size_t piece = 1U << 14U;  // points: the differences of short factors stay in the second-level cache
  std::vector<Differences> all;
  for (const std::size_t factor : factors) all.emplace_back(kind, phase, factor, resident);
  for (std::size_t begin = 0; begin < phase.size(); begin += piece)
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i].add(begin, begin + piece);
      const bool is_far = factors[i] > piece || i == 0;
      if (is_far) resident.touched((order_of(kind) + 1) * piece * sizeof(double));
    }
  std::vector<double> deviations;
  for (const Differences& differences : all) deviations.push_back(differences.deviation());
  return deviations;
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
