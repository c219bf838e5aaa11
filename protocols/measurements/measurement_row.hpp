// MeasurementRow: a measurement as a row of a NumPy or HDF5 array.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "protocols/protocol.hpp"

namespace imud {

// The true values of a sample's measured values, without sensor errors: at the sensor's place, in the sensor's
// axes, and in the units of Sample. NaN: no true value.
struct TrueValues {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 3> gyro{none, none, none}, accel{none, none, none}, dtheta{none, none, none},
      dvel{none, none, none};
};

// Units: measurement_columns(). A quantity that the measurement does not carry is NaN; a missing `time_ns` is
// NumPy's NaT, a missing `counter` the greatest value of its type, and a missing `status` 0. `fields` has the bits
// of the carried quantities (Measurement::Field). There is no padding.
struct MeasurementRow {
  static constexpr std::int64_t no_time = std::numeric_limits<std::int64_t>::min();
  static constexpr std::uint64_t no_counter = std::numeric_limits<std::uint64_t>::max();

  std::int64_t time_ns = no_time;
  std::uint64_t counter = no_counter;
  std::array<double, 3> gyro, accel, dtheta, dvel;
  double temperature = TrueValues::none;
  std::uint32_t status = 0;
  std::uint32_t fields = 0;
  TrueValues truth;  // only where the truth is known beside the measurement

  explicit MeasurementRow(const Measurement& measurement) noexcept;
};

struct MeasurementColumn {
  std::string_view name;
  std::string_view type;   // of NumPy, without the byte order: "i8"
  std::size_t values = 1;  // in a row
  std::string_view unit, frame, meaning;
  constexpr std::size_t size() const { return values * static_cast<std::size_t>(type[1] - '0'); }
};

// Returns the members of MeasurementRow in their order, the last four only `with_truth`.
std::span<const MeasurementColumn> measurement_columns(bool with_truth) noexcept;
// Returns the columns of the truth alone: `time_ns`, then the members of TrueValues in their order.
std::span<const MeasurementColumn> truth_columns() noexcept;
// Returns the number of bytes of a row.
std::size_t row_size(bool with_truth) noexcept;

}  // namespace imud
