// CaseRows: the measurements of an imu in a case, as rows of an array of the campaign.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "protocols/protocol.hpp"

namespace imud {

class CaseRows {
 public:
  // `count` is the number of rows of each case. Allocates all memory.
  explicit CaseRows(std::uint64_t count);

  // Adds the row of a measurement, as `imud replay --npy` writes it. After `count` rows, further rows are cut off.
  void add(const Measurement& measurement) noexcept;
  // Returns how many rows were cut off.
  std::uint64_t cut() const noexcept { return measurements_ > count_ ? measurements_ - count_ : 0; }
  // Returns all `count` rows. Rows behind the last measurement have no value.
  std::span<const std::byte> finish();

 private:
  const std::uint64_t count_;
  std::uint64_t measurements_ = 0;
  std::vector<std::byte> rows_;
};

}  // namespace imud
