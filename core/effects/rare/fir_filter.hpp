#pragma once

#include <string_view>
#include <vector>

#include "core/effects/triad_errors.hpp"
#include "core/effects/triad_step.hpp"

namespace imud {

// A filter by its taps. It filters the value alone, as Bandwidth does, and acts before Bandwidth:
//   m(k) <- sum over i of h(i) m(k - i)
// It settles on the first value of a run, and on the next value after seek() and power_on(), as if the input had been
// constant before.
class FirFilter {
 public:
  static constexpr std::string_view name = "filter by taps";
  static constexpr EffectTraits traits = {.is_rare = true};
  FirFilter(const TriadErrors& errors, Quantity, double)
      : taps_(errors.fir_taps), inputs_(taps_ != nullptr ? taps_->size() : 0, Vector3::Zero()) {}
  bool is_on() const noexcept { return !inputs_.empty(); }
  void apply(TriadStep& step) noexcept {
    const Vector3 input = vector_of(step.value);
    if (step.begins_run || !is_settled_) inputs_.assign(inputs_.size(), input);
    is_settled_ = true;
    newest_ = newest_ == 0 ? inputs_.size() - 1 : newest_ - 1;
    inputs_[newest_] = input;
    Vector3 sum = Vector3::Zero();
    std::size_t i = newest_;
    for (const double tap : *taps_) {
      sum += tap * inputs_[i];
      if (++i == inputs_.size()) i = 0;
    }
    is_settled_ = sum.allFinite();  // otherwise it would not be finite for as many samples as there are taps
    step.value = lanes(sum);
  }
  void seek(const Normals&, std::uint64_t) noexcept { is_settled_ = false; }
  void power_on(std::uint64_t) noexcept { is_settled_ = false; }
  // Continues the state of `before` if both filters have the same taps. Otherwise the filter settles on its next
  // value.
  void continue_from(const FirFilter& before, const Normals&, std::uint64_t) noexcept {
    if (!is_on() || !before.is_on() || *taps_ != *before.taps_) return;
    inputs_.assign(before.inputs_.begin(), before.inputs_.end());
    newest_ = before.newest_;
    is_settled_ = before.is_settled_;
  }

 private:
  FirTaps taps_;                 // h
  std::vector<Vector3> inputs_;  // as many as taps: ring, the newest first
  std::size_t newest_ = 0;
  bool is_settled_ = false;
};

}  // namespace imud
