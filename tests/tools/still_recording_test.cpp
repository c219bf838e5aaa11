#include "tools/allan/still_recording.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace imud {
namespace {

TEST(Columns, NamesSelectTheChannels) {
  using Columns = std::vector<std::optional<std::size_t>>;
  EXPECT_EQ(parse_columns("", 3), (Columns{0, 1, 2}));
  EXPECT_EQ(parse_columns("", 6).size(), 6U);
  EXPECT_EQ(parse_columns("-,accel_z,gyro_x", 3), (Columns{std::nullopt, 5, 0}));
  for (const auto& [text, columns] : {std::pair("", 7U), std::pair("gyro_x", 2U), std::pair("gyro_x,gyro_x", 2U),
                                      std::pair("-", 1U), std::pair("gyro", 1U), std::pair("gyro_x,", 2U)})
    EXPECT_THROW(parse_columns(text, columns), std::invalid_argument) << text;
}

// A table may lack a number. The channels follow from the first sample.
TEST(StillRecorder, SampleWithOtherComponentsIsInvalid) {
  StillRecorder recorder(*find_protocol("csv"), {.rate_hz = {}, .increments = false, .largest_missing = 10}, 1000);
  const double none = std::numeric_limits<double>::quiet_NaN();
  Measurement measurement{.sample = {}, .fields = Measurement::time | Measurement::rate};
  for (int k = 0; k < 100; ++k) {
    measurement.sample.time.ns = 10'000'000 * k;
    measurement.sample.rate = {none, 1.0 * k, 2};
    if (k == 40) measurement.sample.rate.z() = none;
    if (k == 60) measurement.sample.rate.x() = 7;
    if (k == 70) measurement.sample.rate = {7, none, 2};
    recorder.on_measurement(measurement);
  }
  const StillRecording recording = recorder.finish();
  EXPECT_EQ(recording.invalid, 3U);
  ASSERT_EQ(recording.channels.size(), 2U);
  EXPECT_EQ(recording.channels[0].name(), "gyro_y");
  EXPECT_EQ(recording.samples(), 97U);
}

}  // namespace
}  // namespace imud
