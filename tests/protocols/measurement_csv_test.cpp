// The measurement CSV: the row itself, and the device and decoder "csv" around it.
#include "protocols/measurements/measurement_csv.hpp"

#include <gtest/gtest.h>

#include "tests/protocols/recording.hpp"

namespace imud {
namespace {

std::string row_of(const Measurement& measurement) {
  std::array<char, measurement_csv_row_max> row;
  return {row.data(), write_measurement_csv(measurement, row)};
}

Measurement known_measurement(std::uint32_t fields) {
  Measurement measurement;
  measurement.fields = fields;
  Sample& sample = measurement.sample;
  sample.time.ns = 5000000;
  sample.counter = 1;
  sample.rate = {0.1, -0.0, 1e-9};
  sample.specific_force = {1.0 / 3.0, -9.80665, 1e22};
  sample.delta_angle = {1, 2, 3};
  sample.delta_velocity = {0.5, 0.25, 0.125};
  sample.temperature_c = 25;
  sample.status = 4294967295;
  return measurement;
}

TEST(MeasurementCsv, RowIsAsInTheContract) {
  EXPECT_EQ(measurement_csv_header,
            "time_ns,counter,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,dtheta_x,dtheta_y,dtheta_z,"
            "dvel_x,dvel_y,dvel_z,temperature,status\n");
  EXPECT_EQ(row_of(known_measurement(Measurement::all)),
            "5000000,1,0.1,-0,1e-09,0.3333333333333333,-9.80665,1e+22,1,2,3,0.5,0.25,0.125,25,4294967295\n");
  EXPECT_EQ(row_of(known_measurement(Measurement::counter | Measurement::specific_force | Measurement::status)),
            ",1,,,,0.3333333333333333,-9.80665,1e+22,,,,,,,,4294967295\n");
  EXPECT_EQ(row_of(known_measurement(0)), ",,,,,,,,,,,,,,,\n");
}

TEST(MeasurementCsv, DigitsLimitRealNumbersAlone) {
  Measurement measurement = known_measurement(Measurement::all);
  measurement.sample.time.ns = 123'456'789;
  std::array<char, measurement_csv_row_max> row;
  const std::string text(row.data(), write_measurement_csv(measurement, row, false, 4));
  EXPECT_EQ(text, "123456789,1,0.1,-0,1e-09,0.3333,-9.807,1e+22,1,2,3,0.5,0.25,0.125,25,4294967295\n");
}

TEST(MeasurementCsv, TheDeviceSendsAsManyDigitsAsItsSettingHas) {
  const Protocol& csv = protocol_named("csv");
  Settings settings(csv.settings);
  settings.set("digits", std::int64_t{6});
  Sample sample;
  sample.rate = {1.0 / 3, 0, 0};
  FrameBuffer frames;
  const auto device = csv.make(settings);
  device->sample(sample, frames);
  ASSERT_EQ(frames.frames().size(), 2U);
  const auto bytes = frames.frames()[1].bytes;
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()),
            "0,0,0.333333,0,0,0,0,0,0,0,0,0,0,0,25,0\n");
  EXPECT_THROW(settings.set("digits", std::int64_t{0}), std::invalid_argument);
  EXPECT_THROW(settings.set("digits", std::int64_t{18}), std::invalid_argument);
}

TEST(MeasurementCsv, LongestRowFits) {
  Measurement measurement;
  measurement.fields = Measurement::all;
  Sample& sample = measurement.sample;
  sample.time.ns = std::numeric_limits<std::int64_t>::min();
  sample.counter = ~std::uint64_t{0};
  sample.rate = sample.specific_force = sample.delta_angle = sample.delta_velocity =
      Vector3::Constant(-2.2250738585072014e-308);
  sample.temperature_c = -2.2250738585072014e-308;
  sample.status = ~0U;
  EXPECT_EQ(row_of(measurement).size(), 378U);
  sample.inclination = sample.rate;
  std::array<char, measurement_csv_row_max> row;
  EXPECT_EQ(write_measurement_csv(measurement, row, true), 453U);
}

TEST(MeasurementCsv, EverySetOfFieldsComesBack) {
  for (std::uint32_t fields = 0; fields <= Measurement::all; ++fields) {
    std::string row = row_of(known_measurement(fields));
    row.pop_back();
    Measurement measurement;
    ASSERT_TRUE(read_measurement_csv(row, measurement)) << row;
    EXPECT_EQ(measurement.fields, fields);
    EXPECT_EQ(row_of(measurement), row + "\n");
  }
}

// The columns of the inclinometers follow the sixteen, and are empty where a measurement has no inclination.
TEST(MeasurementCsv, AnInclinationComesBack) {
  EXPECT_EQ(
      measurement_csv_header_with_inclination,
      std::string(measurement_csv_header.substr(0, measurement_csv_header.size() - 1)) + ",incl_x,incl_y,incl_z\n");
  Measurement measurement = known_measurement(Measurement::counter);
  std::array<char, measurement_csv_row_max> row;
  const auto text = [&] { return std::string(row.data(), write_measurement_csv(measurement, row, true)); };
  EXPECT_EQ(text(), ",1,,,,,,,,,,,,,,,,,\n");
  measurement.sample.inclination = Vector3(0.1, -9.75, 0);
  EXPECT_EQ(text(), ",1,,,,,,,,,,,,,,,0.1,-9.75,0\n");
  Measurement read;
  ASSERT_TRUE(read_measurement_csv(text().substr(0, text().size() - 1), read));
  EXPECT_EQ(read.sample.inclination, Vector3(0.1, -9.75, 0));
  EXPECT_EQ(read.fields, unsigned{Measurement::counter});
  ASSERT_TRUE(read_measurement_csv("1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,,,", read));
  EXPECT_FALSE(read.sample.inclination);
}

TEST(MeasurementCsv, RefusesWhatIsNoRow) {
  const std::string good = "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16";
  Measurement measurement;
  EXPECT_TRUE(read_measurement_csv(good, measurement));
  EXPECT_TRUE(read_measurement_csv(" 1, 2,+3,4e0,5,6,7,8,9,10,11,12,13,14,15,16 ", measurement));
  for (const std::string bad :
       {"", "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15", "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17",
        "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,", "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18",
        "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,,19", "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20",
        "1,2,nan,4,5,6,7,8,9,10,11,12,13,14,15,16", "1,2,3,inf,5,6,7,8,9,10,11,12,13,14,15,16",
        "1,2,3,4,x,6,7,8,9,10,11,12,13,14,15,16", "1,2,3,4,5 6,6,7,8,9,10,11,12,13,14,15,16",
        "1.5,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16", "1,-2,3,4,5,6,7,8,9,10,11,12,13,14,15,16",
        "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,4294967296", "1,2,1e999,4,5,6,7,8,9,10,11,12,13,14,15,16"})
    EXPECT_FALSE(read_measurement_csv(bad, measurement)) << bad;
}

TEST(MeasurementCsv, ComponentThatIsNotCarriedIsEmptyAndReadAsNaN) {
  const std::string text = "1,2,,4,5,6,7,8,,,,,,,15,16";
  Measurement read;
  ASSERT_TRUE(read_measurement_csv(text, read));
  EXPECT_EQ(read.fields, Measurement::all & ~(Measurement::delta_angle | Measurement::delta_velocity));
  EXPECT_TRUE(std::isnan(read.sample.rate.x()));
  EXPECT_EQ(read.sample.rate.y(), 4);
  EXPECT_EQ(read.sample.delta_angle, Vector3::Zero());
  std::array<char, measurement_csv_row_max> row;
  EXPECT_EQ(std::string_view(row.data(), write_measurement_csv(read, row)), text + "\n");
}

class CsvDecoding : public testing::Test {
 protected:
  void feed(std::string_view text) { line_.decoder->feed({std::as_bytes(std::span(text))}, recording_); }
  std::size_t count() const { return recording_.measurements.size(); }
  const DecodeErrors& errors() const { return line_.decoder->errors(); }

  static constexpr std::string_view row = "1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16";
  Line line_{protocol_named("csv")};
  Recording recording_;
};

TEST_F(CsvDecoding, HeaderIsSentOnceInItsOwnFrame) {
  const std::vector<StoredFrame> frames = line_.encode_all(std::vector<Sample>(2));
  ASSERT_EQ(frames.size(), 3U);
  const auto text = [](const StoredFrame& frame) {
    return std::string_view(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
  };
  EXPECT_EQ(text(frames[0]), measurement_csv_header);
  EXPECT_EQ(text(frames[1]), "0,0,0,0,0,0,0,0,0,0,0,0,0,0,25,0\n");
  EXPECT_EQ(text(frames[2]), text(frames[1]));
}

TEST_F(CsvDecoding, ASensorWithInclinometersHasTheirColumns) {
  Sample sample;
  sample.inclination = Vector3(1, -2, 0.5);
  const std::vector<StoredFrame> frames = line_.encode_all(std::vector<Sample>(2, sample));
  ASSERT_EQ(frames.size(), 3U);
  const auto text = [](const StoredFrame& frame) {
    return std::string(reinterpret_cast<const char*>(frame.bytes.data()), frame.bytes.size());
  };
  EXPECT_EQ(text(frames[0]), measurement_csv_header_with_inclination);
  EXPECT_EQ(text(frames[1]), "0,0,0,0,0,0,0,0,0,0,0,0,0,0,25,0,1,-2,0.5\n");
  for (const StoredFrame& frame : frames) feed(text(frame));
  ASSERT_EQ(count(), 2U);
  EXPECT_EQ(recording_.measurements[1].sample.inclination, sample.inclination);
  EXPECT_EQ(errors().malformed, 0U);
}

TEST_F(CsvDecoding, TakesHeadersBlankLinesAndCarriageReturns) {
  feed("\n\r\n");
  feed(measurement_csv_header);
  feed(std::string(row) + "\r\n" + std::string(measurement_csv_header.substr(0, 10)));
  feed(measurement_csv_header.substr(10));
  feed(std::string(row) + "\n");
  EXPECT_EQ(count(), 2U);
  EXPECT_EQ(errors().malformed + errors().skipped_bytes, 0U);
}

TEST_F(CsvDecoding, CountsBadLines) {
  feed("what is this\n");
  EXPECT_EQ(errors().malformed, 1U);
  EXPECT_EQ(errors().skipped_bytes, 13U);
  feed(std::string(row) + "\n");
  EXPECT_EQ(count(), 1U);
  feed(std::string(5000, '1'));
  feed(std::string(5000, '1') + "\n" + std::string(row) + "\n");
  EXPECT_EQ(errors().malformed, 2U);
  EXPECT_EQ(errors().skipped_bytes, 13U + 10001U);
  EXPECT_EQ(count(), 2U);
}

TEST_F(CsvDecoding, ARowWithoutItsEndIsRefused) {
  feed(row);
  EXPECT_EQ(count(), 0U);
  line_.decoder->finish(recording_);
  EXPECT_EQ(count(), 0U);
  EXPECT_EQ(errors().malformed, 1U);
  line_.decoder->finish(recording_);
  EXPECT_EQ(errors().malformed, 1U);
}

}  // namespace
}  // namespace imud
