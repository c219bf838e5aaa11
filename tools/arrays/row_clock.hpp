// RowClock: the time of measurements, for files whose format needs one.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "protocols/measurements/measurement_row.hpp"

namespace imud {

class RowClock {
 public:
  // `rate_hz`: row k is at k/rate_hz if its measurement carries no time; nullopt: such a row has no time.
  explicit RowClock(std::optional<double> rate_hz) : rate_hz_(rate_hz) {}

  // Returns the time of the next measurement in ns, from 0; nullopt if the measurement has no time, or a negative
  // one.
  std::optional<std::uint64_t> next(const MeasurementRow& row) noexcept;
  // Returns the faults for which next() has returned nullopt, each with the number of its measurements; empty
  // otherwise.
  std::string fault() const;

 private:
  const std::optional<double> rate_hz_;
  std::uint64_t rows_ = 0, without_ = 0, negative_ = 0;
};

}  // namespace imud
