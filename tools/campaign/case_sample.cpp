#include "tools/campaign/case_sample.hpp"

#include <Random123/philox.h>

#include <algorithm>
#include <cmath>

namespace imud {
namespace {

// Returns random bits for a case, because the choice of cases must not depend on their order in the plan.
std::uint64_t scattered(std::uint64_t index) noexcept { return r123::Philox2x64()({{index, 0}}, {{0}})[0]; }

}  // namespace

void Moments::add(double number) noexcept {
  ++runs;
  passes += number != 0 ? 1U : 0U;
  const double before = number - mean;
  mean += before / static_cast<double>(runs);
  squares += before * (number - mean);
  min = std::min(min, number);
  max = std::max(max, number);
}

double Moments::deviation() const noexcept {
  return runs < 2 ? std::numeric_limits<double>::quiet_NaN() : std::sqrt(squares / static_cast<double>(runs - 1));
}

Moments Moments::zeros(std::uint64_t count) noexcept {
  Moments moments;
  if (count == 0) return moments;
  moments.runs = count;
  moments.min = moments.max = 0;
  return moments;
}

double percentile(const std::vector<double>& sorted, double share) noexcept {
  if (sorted.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(place), sorted.size() - 1);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (place - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

bool CaseSample::wants(std::uint64_t index) const noexcept {
  return halvings_ == 0 || scattered(index) >> (64 - halvings_) == 0;
}

void CaseSample::add(std::uint64_t index, const std::vector<double>& numbers, const std::vector<std::uint32_t>& at) {
  const auto size_of = [](const Case& one) {
    return sizeof one + sizeof(double) * one.numbers.capacity() + sizeof(std::uint32_t) * one.at.capacity();
  };
  cases_.push_back({index, numbers, at});
  used_ += size_of(cases_.back());
  while (used_ > bytes_ && halvings_ < 60) {
    ++halvings_;
    std::erase_if(cases_, [&](const Case& one) { return !wants(one.index); });
    used_ = 0;
    for (const Case& one : cases_) used_ += size_of(one);
  }
}

double CaseSample::number(std::size_t row, std::size_t figure, double absent) const noexcept {
  const std::vector<double>& numbers = cases_[row].numbers;
  return figure < numbers.size() ? numbers[figure] : absent;
}

std::uint32_t CaseSample::at(std::size_t row, std::size_t axis) const noexcept {
  const std::vector<std::uint32_t>& at = cases_[row].at;
  return axis < at.size() ? at[axis] : std::numeric_limits<std::uint32_t>::max();
}

}  // namespace imud
