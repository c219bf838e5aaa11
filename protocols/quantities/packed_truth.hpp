// PackedTruth: converts records of a PackedLayout to Truths.
#pragma once

#include <optional>
#include <stdexcept>
#include <utility>

#include "protocols/quantities/packed_layout.hpp"
#include "protocols/quantities/truth_assembly.hpp"
#include "protocols/truth_format.hpp"
#include "protocols/wire/wrapping_time.hpp"

namespace imud {

// The setting `time` of formats whose records may lack a usable time.
inline constexpr std::string_view time_choices[] = {"field", "arrival"};
inline constexpr Setting time_setting =
    text_setting("time", "where a truth's time comes from: the record, or its arrival, counted from the first",
                 "field", time_choices);

// Reads a record, unwraps its time, and assembles the Truth. The constructor may throw. One thread.
class PackedTruth {
 public:
  // `has_time`: true if the layout has a time, which is then used; false if the layout has no time: the time of a
  // record is then its arrival, relative to the first record's arrival. Throws std::invalid_argument, as
  // PackedLayout and TruthAssembly do.
  PackedTruth(PackedLayout layout, const TruthAssembly::Axes& axes, bool has_time = true)
      : layout_(std::move(layout)), assembly_(given(layout_, has_time), axes) {
    if (layout_.time_modulus()) wrapping_.emplace(*layout_.time_modulus());
  }

  const PackedLayout& layout() const noexcept { return layout_; }
  TruthFrame frame() const noexcept { return assembly_.frame(); }

  // Converts a record of layout().size() bytes or more. Returns ok, not_finite or out_of_range.
  TruthResult convert(std::span<const std::byte> record, HostTime arrival, Truth& truth) noexcept {
    if (!first_arrival_) first_arrival_ = arrival;
    return convert_at(record, (arrival - *first_arrival_).count(), truth);
  }
  // Does the same as convert(), with `ns` in place of the time of arrival.
  TruthResult convert_at(std::span<const std::byte> record, std::int64_t ns, Truth& truth) noexcept {
    if (!layout_.given()[time_ns_.quantity]) (void)reading_.set(time_ns_, ns);
    if (const TruthResult result = layout_.read(record, reading_); result != TruthResult::ok) return result;
    if (wrapping_) (void)reading_.set(time_ns_, wrapping_->of(reading_.time_ns()));
    return assembly_.convert(reading_, truth);
  }

  // Writes why the last record was refused.
  void describe(RemarkWriter& out) const noexcept {
    const std::size_t before = out.size();
    layout_.describe(out);
    if (out.size() == before) assembly_.describe(reading_, out);
  }

 private:
  static QuantitySet given(const PackedLayout& layout, bool has_time) {
    QuantitySet set = layout.given();
    const std::size_t time = quantity_group(TruthGroup::time).first;
    if (!has_time && set[time])
      throw std::invalid_argument(
          "the time is given twice, by a field and by time = \"arrival\"; omit the key time, or give padding, "
          "such as _:8, in place of the field");
    if (!has_time) set.set(time);
    return set;
  }

  PackedLayout layout_;
  TruthAssembly assembly_;
  TruthReading reading_;
  TruthField time_ns_ = find_truth_field("time_ns").value();
  std::optional<WrappingTime> wrapping_;
  std::optional<HostTime> first_arrival_;
};

}  // namespace imud
