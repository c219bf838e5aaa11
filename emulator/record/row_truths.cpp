#include "emulator/record/row_truths.hpp"

#include <algorithm>
#include <functional>
#include <string_view>

namespace imud {

MadeRow::MadeRow(const MeasurementRow& row, std::uint64_t number) noexcept
    : hash(std::hash<std::string_view>()({reinterpret_cast<const char*>(&row), row_size(false)})),
      time_ns(row.time_ns),
      counter(row.counter),
      sample(number),
      has_increments(carries_increments(row.fields)) {}

TrueRow no_truth() noexcept { return {MeasurementRow::no_time, {}}; }

// Returns the number of the made row; the number of all made rows if there is none.
std::size_t RowTruths::find(const MadeRow& row) const noexcept {
  constexpr std::size_t farthest = 65'536;
  const auto search = [&](const auto& is_same) {
    for (std::size_t i = next_; i < std::min(made_.size(), next_ + farthest); ++i)
      if (is_same(made_[i])) return i;
    for (std::size_t i = next_; i-- > next_ - std::min(next_, farthest);)
      if (is_same(made_[i])) return i;
    return made_.size();
  };
  const std::size_t found = search([&](const MadeRow& made) { return made.hash == row.hash; });
  const bool has_identity = row.time_ns != MeasurementRow::no_time || row.counter != MeasurementRow::no_counter;
  if (found < made_.size() || !has_identity) return found;
  return search([&](const MadeRow& made) { return made.time_ns == row.time_ns && made.counter == row.counter; });
}

TrueRow RowTruths::of(const MeasurementRow& row) noexcept {
  const std::size_t found = find(MadeRow(row, 0)), i = found < made_.size() ? found : next_;
  if (i >= made_.size() || made_[i].sample >= samples_.size()) return no_truth();
  next_ = i + 1;
  std::size_t begin = i;  // the sums begin after the row before this one
  while (begin > 0 && has_increments_ && !made_[begin - 1].has_increments) --begin;
  const std::uint64_t last = made_[i].sample, first = begin == 0 ? 0 : made_[begin - 1].sample + 1;
  TrueRow truth = samples_[last];
  const bool is_known = (begin > 0 || last == 0) && made_[i].has_increments == has_increments_;
  truth.values.dtheta.fill(is_known ? 0 : TrueValues::none);
  truth.values.dvel = truth.values.dtheta;
  for (std::uint64_t k = first; k <= last; ++k)
    for (std::size_t axis = 0; axis < truth.values.dtheta.size(); ++axis) {
      truth.values.dtheta[axis] += samples_[k].values.dtheta[axis];
      truth.values.dvel[axis] += samples_[k].values.dvel[axis];
    }
  return truth;
}

}  // namespace imud
