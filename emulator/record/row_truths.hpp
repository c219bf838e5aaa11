// RowTruths: finds the truth of an arrived measurement, although messages are lost, late or damaged.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "emulator/record/measurement_rows.hpp"

namespace imud {

// A measurement that a device has made, before the faults of its messages and its wire.
struct MadeRow {
  std::uint64_t hash = 0;  // of all its bytes
  std::int64_t time_ns = 0;
  std::uint64_t counter = 0;
  std::uint64_t sample = 0;  // its number among the samples of the sensor
  bool has_increments = false;

  MadeRow(const MeasurementRow& row, std::uint64_t sample) noexcept;
};

// One imu and one run.
class RowTruths {
 public:
  // `samples`: the truth at each sample, with the increments since the sample before; it must outlive this.
  RowTruths(std::span<const TrueRow> samples, std::vector<MadeRow> made)
      : samples_(samples),
        made_(std::move(made)),
        has_increments_(std::ranges::any_of(made_, &MadeRow::has_increments)) {}

  // Returns the truth at the sample of the next arrived row. That row is identified by its bytes, or else by its time
  // and number. A damaged row without both is taken as the made row after its predecessor. True increments are sums
  // as in TrueRow, since made rows. They are NaN for the first made row if samples without a row precede it. All
  // values are NaN if there is no such row.
  TrueRow of(const MeasurementRow& row) noexcept;

 private:
  std::size_t find(const MadeRow& row) const noexcept;

  const std::span<const TrueRow> samples_;
  const std::vector<MadeRow> made_;
  const bool has_increments_;  // of a made row
  std::size_t next_ = 0;
};

// Returns a row of the truth without any value.
TrueRow no_truth() noexcept;

}  // namespace imud
