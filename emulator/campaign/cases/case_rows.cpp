#include "emulator/campaign/cases/case_rows.hpp"

#include "emulator/campaign/shards/shard_arrays.hpp"
#include "protocols/measurements/measurement_row.hpp"

namespace imud {

CaseRows::CaseRows(std::uint64_t count) : count_(count) { rows_.reserve(count * row_size(false)); }

void CaseRows::add(const Measurement& measurement) noexcept {
  if (++measurements_ > count_) return;
  const MeasurementRow row(measurement);
  const auto bytes = std::as_bytes(std::span(&row, 1)).first(row_size(false));
  rows_.insert(rows_.end(), bytes.begin(), bytes.end());
}

std::span<const std::byte> CaseRows::finish() {
  if (measurements_ < count_) {
    const std::vector<std::byte> none = rows_without_value(count_ - measurements_);
    rows_.insert(rows_.end(), none.begin(), none.end());
  }
  return rows_;
}

}  // namespace imud
