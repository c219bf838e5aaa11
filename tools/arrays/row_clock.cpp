#include "tools/arrays/row_clock.hpp"

#include <fmt/format.h>

#include <cmath>

namespace imud {

std::optional<std::uint64_t> RowClock::next(const MeasurementRow& row) noexcept {
  const std::uint64_t number = rows_++;
  if (row.time_ns == MeasurementRow::no_time) {
    if (rate_hz_) return static_cast<std::uint64_t>(std::llround(static_cast<double>(number) * 1e9 / *rate_hz_));
    ++without_;
    return {};
  }
  if (row.time_ns >= 0) return static_cast<std::uint64_t>(row.time_ns);
  ++negative_;
  return {};
}

std::string RowClock::fault() const {
  std::string text;
  if (without_ > 0)
    text = fmt::format("{} of {} measurements carry no time, and are left out; right would be --rate-hz HZ", without_,
                       rows_);
  if (negative_ > 0)
    text += fmt::format("{}{} of {} measurements are before time 0, which the format cannot state, and are left out",
                        text.empty() ? "" : "; ", negative_, rows_);
  return text;
}

}  // namespace imud
