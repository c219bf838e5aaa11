// The output of imu-decode --find-check for captures that are text, or whose frames are escaped.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/text.hpp"
#include "tests/tools/find/find_unit.hpp"
#include "tools/find/capture_kind.hpp"
#include "tools/find/frame_finder.hpp"

namespace imud {
namespace {

std::string escaped_description(const std::string& escape) {
  return "escape = \"" + escape + "\"\n" +
         one_message(
             "@begin\n91\nalive_counter:u8\nrate_x_deg_per_s:i16*0.02\nrate_y_deg_per_s:i16*0.02\n"
             "rate_z_deg_per_s:i16*0.02\nspecific_force_x_mg:i16\nspecific_force_y_mg:i16\n"
             "specific_force_z_mg:i16\ncheck:crc16/xmodem:@begin..");
}

TEST(FindCapture, RemovesEscapes) {
  for (const char* escape : {"slip", "hdlc", "dle", "cobs"}) {
    SCOPED_TRACE(escape);
    Line line = frame_line(escaped_description(escape));
    const Capture capture = capture_of(line, handled_samples(Handling::turned, 1500, 100));
    const auto found = find_escape(capture.bytes);
    ASSERT_TRUE(found);
    EXPECT_EQ(escape_names[static_cast<std::size_t>(*found)], escape);
    const auto contents = without_escape(capture.bytes, *found);
    EXPECT_EQ(contents.size(), 1500U * 16);
    const auto frames = find_frames(contents);
    ASSERT_TRUE(frames);
    ASSERT_EQ(frames->messages.size(), 1U);
    EXPECT_EQ(frames->messages[0].length, 16U);
    ASSERT_EQ(frames->messages[0].checks.size(), 1U);
    EXPECT_EQ(frames->messages[0].checks[0].forms[0].name, "crc16/xmodem");
  }
}

TEST(FindCapture, TakesNoOtherFramesForEscaped) {
  for (const std::string_view shipped : captured_descriptions)
    for (const Handling handling : {Handling::rest, Handling::turned})
      EXPECT_FALSE(find_escape(shipped_capture(shipped, handling).bytes)) << shipped;
  std::mt19937_64 random(2);
  EXPECT_FALSE(find_escape(random_bytes(200'000, random)));
  EXPECT_FALSE(find_escape(std::vector<std::byte>(100'000)));
}

// Letters of hexadecimal numbers do not make another kind of line.
TEST(FindCapture, DescribesLinesOfHexadecimalNumbers) {
  std::string text = "\n";
  for (unsigned k = 0; k < 400; ++k)
    text += fmt::format(":{:02X}{:04X}  0000H {:04d}\r\n", k * 37 % 256, k * 1237 % 65536, k);
  const auto bytes = std::as_bytes(std::span(text));
  const std::string lines = describe_lines(bytes, "test");
  EXPECT_TRUE(contains(lines, "# 400 lines such as")) << lines;
  EXPECT_TRUE(contains(lines, "# text = \":#  #H #\\r\\n\"")) << lines;
}

TEST(FindCapture, DescribesLines) {
  const Capture capture = shipped_capture("nmea-attitude", Handling::turned, 400);
  const std::string text = describe_lines(capture.bytes, "x.bin");
  EXPECT_TRUE(contains(text, "# The capture is text:")) << text;
  EXPECT_TRUE(contains(text, "{check:xor8}\\r\\n\"")) << text;
  EXPECT_EQ(describe_lines(shipped_capture("hipnuc", Handling::turned).bytes, "x.bin"), "");
  EXPECT_EQ(describe_lines({}, "x.bin"), "");
}

}  // namespace
}  // namespace imud
