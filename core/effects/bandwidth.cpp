#include "core/effects/bandwidth.hpp"

#include <algorithm>

#include "core/numbers/dispatch.hpp"

namespace imud {

Bandwidth::Bandwidth(const TriadErrors& errors, Quantity, double period_s) : rate_hz_(1 / period_s) {
  sums_.fill(Vector3::Zero());
  if (!errors.filter.is_on()) return;
  if (errors.filter.length > 1)
    inputs_.resize(static_cast<std::size_t>(errors.filter.length) * static_cast<std::size_t>(errors.filter.stages));
  set(errors.filter);
}

void Bandwidth::reserve(int length) { inputs_.resize(std::max(inputs_.size(), static_cast<std::size_t>(length))); }

void Bandwidth::set(const SensorFilter& filter) noexcept {
  on_ = filter.is_on();
  is_settled_ = false;
  order_ = filter.order;
  stages_ = static_cast<std::size_t>(filter.stages);
  length_ = std::clamp<std::size_t>(static_cast<std::size_t>(filter.length), 1,
                                    std::max<std::size_t>(inputs_.size() / stages_, 1));
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    const bool passes = !(filter.cut_off_hz[axis] > 0);
    passes_[i] = passes ? -1 : 0;
    if (passes) continue;
    const double g = detail::prewarped(filter.cut_off_hz[axis], rate_hz_);
    const detail::Sections all = detail::sections(filter);
    if (all.count == 0) sections_[0].y_from_x[i] = g / (1 + g);
    for (std::size_t s = 0; s < static_cast<std::size_t>(all.count); ++s) {
      const double a = 1 / (1 + g * (g + all.damping[s]));
      sections_[s].from_u[i] = a;
      sections_[s].from_x[i] = g * a;
      sections_[s].y_from_x[i] = g * g * a;
    }
  }
}

void Bandwidth::continue_from(const Bandwidth& before, const Normals&, std::uint64_t) noexcept {
  const auto has_other = [&](std::size_t s) {
    return sections_[s].from_x != before.sections_[s].from_x || sections_[s].y_from_x != before.sections_[s].y_from_x;
  };
  if (!on_ || !before.on_ || rate_hz_ != before.rate_hz_ || order_ != before.order_ || length_ != before.length_ ||
      stages_ != before.stages_ || passes_ != before.passes_ || has_other(0) || has_other(1))
    return;
  is_settled_ = before.is_settled_;
  sections_ = before.sections_;
  oldest_ = before.oldest_;
  sums_ = before.sums_;
  std::copy_n(before.inputs_.begin(), length_ > 1 ? length_ * stages_ : 0, inputs_.begin());
}

void Bandwidth::settle(const Vector3& value) noexcept {
  for (Section& section : sections_) {
    section.u = {};
    section.w = {value[0], value[1], value[2], 0};
  }
  if (length_ == 1) return;
  std::fill(inputs_.begin(), inputs_.end(), value);
  sums_.fill(static_cast<double>(length_) * value);
  oldest_ = 0;
}

IMUD_DISPATCHED Vector3 Bandwidth::boxcars(const Vector3& value) noexcept {
  Vector3 x = value;
  const bool is_last = oldest_ + 1 == length_;
  for (std::size_t stage = 0; stage < stages_; ++stage) {
    Vector3* const inputs = &inputs_[stage * length_];
    sums_[stage] += x - inputs[oldest_];
    inputs[oldest_] = x;
    if (is_last) {  // so that rounding errors do not accumulate
      sums_[stage].setZero();
      for (std::size_t i = 0; i < length_; ++i) sums_[stage] += inputs[i];
    }
    x = sums_[stage] / static_cast<double>(length_);
  }
  oldest_ = is_last ? 0 : oldest_ + 1;
  return x;
}

}  // namespace imud
