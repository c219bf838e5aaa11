// imu-decode --fields: the frames of a description as CSV.
#include <gtest/gtest.h>

#include <fstream>
#include <memory>

#include "emulator/frames/frame_file.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/support/hex_bytes.hpp"
#include "tests/support/text.hpp"
#include "tests/tools/run_program.hpp"
#include "tests/transports/scratch_folder.hpp"
#include "transports/port.hpp"

namespace imud {
namespace {

constexpr std::string_view two_messages = R"(
frame_version = 1
name = "mine"
[[message]]
name = "imu"
layout = ["A5 01", "frame_counter:u8", "time_us:u32", "-rate_y_deg_per_s:i16*0.01", "magnetic_field_x_mgauss:i16"]
[[message]]
name = "ahrs, fast"
layout = ["A5 02", "frame_counter:u8", "roll_deg:f32", "bits:u8:0=!not_valid"]
)";
constexpr std::string_view two_frames = "A5 01 07 40 42 0F 00 2C FF 38 FF A5 02 08 CD CC CC 3D 01";

constexpr std::string_view fields_header =
    "message,offset,imu.frame_counter,imu.time_us,imu.rate_y_deg_per_s,imu.magnetic_field_x_mgauss,"
    "\"ahrs, fast.frame_counter\",\"ahrs, fast.roll_deg\",\"ahrs, fast.not_valid\"\n";

std::string text_of_bytes(std::string_view hexadecimal) {
  std::string text;
  for (const std::byte byte : hex_bytes(hexadecimal)) text += static_cast<char>(byte);
  return text;
}

std::string file_of(const ScratchFolder& folder, const std::string& name, std::string_view content) {
  std::ofstream(folder / name, std::ios::binary) << content;
  return folder / name;
}

TEST(ImuDecodeFields, AreARowForEachFrame) {
  const ScratchFolder folder;
  const std::string file = file_of(folder, "mine.toml", two_messages);
  const std::string capture = file_of(folder, "bytes.bin", text_of_bytes("00 A5 " + std::string(two_frames)));
  const std::string first = std::string(fields_header) + "imu,2,7,1000000,2.12,-200,,,\n";
  const auto all = run_program("imu-decode", {"frame", "file:" + capture, "--frame-file", file, "--fields"});
  EXPECT_EQ(all.exit_code, 0) << all.errors;
  EXPECT_EQ(all.output, first + "\"ahrs, fast\",13,,,,,8,0.1,0\n");
  EXPECT_TRUE(contains(all.errors, "samples    1\n")) << all.errors;
  EXPECT_TRUE(contains(all.errors, "gaps       unknown: they are between samples, and there are not two\n"))
      << all.errors;
  EXPECT_TRUE(contains(all.errors, "frames     1 imu, 1 \"ahrs, fast\"\n")) << all.errors;
  const auto one =
      run_program("imu-decode", {"frame", "file:" + capture, "--frame-file", file, "--fields", "--count", "1"});
  EXPECT_EQ(one.output, first);
}

TEST(ImuDecodeFields, OfALivePtyComeAtOnce) {
  const ScratchFolder folder;
  const std::string file = file_of(folder, "mine.toml", two_messages);
  auto device = open_port("pty:" + (folder / "imu"), Role::device);
  Program decode("imu-decode");
  decode.start({"frame", "pty:" + (folder / "imu"), "--frame-file", file, "--fields"});
  ASSERT_TRUE(decode.wait_for_output(fields_header));
  Settings settings(protocol_named("frame").settings);
  settings.attach(read_frames(file));
  Line line(protocol_named("frame"), settings);
  Sample sample;
  sample.rate.y() = -0.5;
  for (int k = 0; k < 3; ++k, ++sample.counter) device->send(line.encode(sample));
  EXPECT_TRUE(decode.wait_for_output("\nimu,38,4,0,-28.65,0,,,\n"));
  EXPECT_TRUE(decode.wait_for_output("\n\"ahrs, fast\",49,,,,,5,0,0\n"));
  device.reset();
  EXPECT_EQ(decode.wait(), 0) << decode.errors();
}

// Sentences that carry no measurement are frames nevertheless.
TEST(ImuDecodeFields, OfTextThatIsLeftOutAreEmpty) {
  const std::string lines =
      "$GPGGA,,,,,,0,00,0.9,,M,0.000,M,,*6F\r\n"
      "$GPGGA,085335.25,4807.038000,N,01131.000000,W,1,08,0.9,545.400,M,0.000,M,,*42\r\n";
  const auto result = run_program("imu-decode", {"frame", "-", "--frame-file", "nmea", "--fields"}, lines);
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  EXPECT_TRUE(
      result.output.starts_with("message,offset,GGA.time_of_day_s,GGA.latitude_deg,GGA.longitude_deg,"
                                "GGA.position_quality,GGA.gnss_satellites,GGA.height_m,RMC.time_of_day_s,"))
      << result.output;
  EXPECT_TRUE(contains(result.output, "\nGGA,0,,,,0,0,,,")) << result.output;
  EXPECT_TRUE(contains(result.output, "\nGGA,38,32015.25,48.1173,-11.5166666666667,2,8,545.4,,")) << result.output;
}

TEST(ImuDecodeFields, NeedADescription) {
  const auto native = run_program("imu-decode", {"native", "file:/dev/null", "--fields"});
  EXPECT_EQ(native.exit_code, 2);
  EXPECT_TRUE(contains(native.errors, "--fields is for protocol frame: native has no description")) << native.errors;
  const auto quiet = run_program("imu-decode", {"frame", "file:/dev/null", "--fields", "--quiet"});
  EXPECT_EQ(quiet.exit_code, 2);
  EXPECT_TRUE(contains(quiet.errors, "--quiet")) << quiet.errors;
  for (const char* other : {"--fields", "--quiet"}) {
    const auto columns = run_program("imu-decode", {"frame", "file:/dev/null", "--inclination", other});
    EXPECT_EQ(columns.exit_code, 2);
    EXPECT_TRUE(contains(columns.errors, std::string("--inclination excludes ") + other)) << columns.errors;
  }
  const auto none = run_program("imu-decode", {"frame", "file:/dev/null", "--fields"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_TRUE(contains(none.errors, "no frame was decoded")) << none.errors;
}

}  // namespace
}  // namespace imud
