// Two messages of a description whose frames look alike.
#include <fmt/format.h>

#include <chrono>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/protocols/frames/field_recording.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

std::string two_messages(std::string_view first, std::string_view second, std::string_view head = "",
                         std::string_view more = "") {
  return fmt::format(
      "frame_version = 1\nname = \"test\"\n{}\n[[message]]\nname = \"attitude\"\n{}\n[[message]]\nname = \"motion\"\n"
      "{}\n{}\n",
      head, first, second, more);
}

constexpr std::string_view
    attitude = "layout = ['@a', 'AA 01', 'roll_deg:i16', 'pitch_deg:i16']",
    motion = "layout = ['@a', 'AA 01', 'rate_x_deg_per_s:i16', 'rate_y_deg_per_s:i16']",
    longer = "layout = ['AA 01', 'rate_x_deg_per_s:i16', 'rate_y_deg_per_s:i16', '_:3']",
    three = "layout = ['AA 01', 'rate_x_deg_per_s:i16', 'rate_y_deg_per_s:i16', 'rate_z_deg_per_s:i16']",
    text = R"(text = "$A,{roll_deg:.1f},{pitch_deg:.1f}\r\n")";
constexpr std::string_view with_check =
    "layout = ['@a', 'AA 01', 'roll_deg:i16', 'pitch_deg:i16', 'check:crc16/modbus:@a..']";
constexpr std::string_view remedy =
    "; let the two differ in a constant, a length or a check, or send them with different values of a setting (when)";

TEST(FrameLookAlikes, AMessageThatWouldNeverBeDecodedIsRefused) {
  constexpr std::string_view setting = "[setting]\nMODE = ['a', 'b']";
  const std::pair<std::string, std::string> cases[] = {
      {two_messages(attitude, motion),
       "test.toml:7: message \"motion\": its frames fit message \"attitude\" in line 4, too, and are decoded as "
       "that"},
      {two_messages(attitude, longer),
       "test.toml:7: message \"motion\": its frames begin with bytes that are frames of message \"attitude\" in line "
       "4"},
      {two_messages(longer, attitude),
       "test.toml:7: message \"motion\": the frames of message \"attitude\" in line 4 begin with bytes that are "
       "frames "
       "of this one"},
      {two_messages(with_check, with_check, "", "divider = 2"), "are decoded as that"},
      {two_messages(three, with_check), "are decoded as that"},
      {two_messages(text, R"(text = "$A,{rate_x_deg_per_s:.1f},{rate_y_deg_per_s:.1f}\r\n")"), "are decoded as that"},
      // Every frame with 02 is one whose roll is 2.
      {two_messages("layout = ['AA', 'roll_deg:i8', 'pitch_deg:i8']", "layout = ['AA 02', 'rate_x_deg_per_s:i8']"),
       "are decoded as that"},
      {two_messages(attitude, motion, setting, "when = {MODE = 'b'}"), "are decoded as that"},
  };
  for (const auto& [description, wanted] : cases) {
    const std::string faults = faults_of(description);
    EXPECT_TRUE(contains(faults, wanted)) << description << faults;
    EXPECT_TRUE(contains(faults, remedy)) << faults;
  }
}

TEST(FrameLookAlikes, OthersAreNot) {
  const std::string modes = "[setting]\nMODE = ['a', 'b']";
  const std::string of_a = std::string(attitude) + "\nwhen = {MODE = 'a'}",
                    of_b = std::string(motion) + "\nwhen = {MODE = 'b'}";
  const std::string polled = std::string(motion) + "\npolled = true";
  const std::string cases[] = {
      two_messages(attitude, "layout = ['AA 02', 'rate_x_deg_per_s:i16', 'rate_y_deg_per_s:i16']"),
      two_messages(with_check, three),
      two_messages(with_check, longer),
      two_messages(attitude, longer, "escape = 'slip'"),
      two_messages(of_a, of_b, modes),
      two_messages(attitude, polled),
      two_messages(text, R"(text = "$B,{roll_deg:.1f},{pitch_deg:.1f}\r\n")"),
      two_messages(text, R"(text = "$A,{roll_deg:.1f},{pitch_deg:.1f},{yaw_deg:.1f}\r\n")"),
  };
  for (const std::string& description : cases) EXPECT_EQ(faults_of(description), "") << description;
}

// A KVH 1775 sends the temperature and the magnetic field at one place of its frames, by the low bits of a sequence
// number that counts all of them.
TEST(FrameLookAlikes, ASequenceNumberTellsMessagesApart) {
  Line line(protocol_named("frame"), frame_settings(read_frames("kvh1775")));
  FieldRecording recording(*line.decoder);
  Recording measurements;
  Sample sample;
  sample.magnetic_field = 1e-4 * Vector3(0.2, -0.05, 0.4);
  for (int k = 0; k < 260; ++k) {
    const std::vector<std::byte> bytes = bytes_of(line, sample);
    ASSERT_EQ(bytes.size(), 38U);
    EXPECT_EQ(bytes[33], static_cast<std::byte>(k % 128));
    line.decoder->feed({bytes}, measurements);
    ++sample.counter;
    sample.time = sample.time + std::chrono::milliseconds(1);
  }
  constexpr std::string_view names[] = {"C, temperature", "C, magnetic field x", "C, magnetic field y",
                                        "C, magnetic field z"};
  ASSERT_EQ(recording.rows.size(), 260U);
  for (std::size_t i = 0; i < recording.rows.size(); ++i) EXPECT_EQ(recording.rows[i].message, names[i % 4]);
  for (const Measurement& measurement : measurements.measurements)
    if ((measurement.fields & Measurement::temperature) != 0) {
      EXPECT_EQ(measurement.sample.temperature_c, 25);
    }
}

// Bytes that fit two messages are frames of the first in the file.
TEST(FrameLookAlikes, TheFirstOfTheFileIsDecoded) {
  const std::string description = two_messages("layout = ['AA 02', 'temperature_c:i8']",
                                               "layout = ['AA', 'temperature_c:i8', 'alive_counter:u8']");
  ASSERT_EQ(faults_of(description), "");
  Line line = frame_line(description);
  const auto kinds_of = [&](double temperature_c) {
    Sample sample;
    sample.temperature_c = temperature_c;
    const std::vector<std::byte> bytes = bytes_of(line, sample);
    FieldRecording recording(*line.decoder);
    Recording measurements;
    line.decoder->feed({bytes}, measurements);
    std::vector<std::string> kinds;
    for (const FieldRecording::Row& row : recording.rows) kinds.push_back(row.message);
    return kinds;
  };
  EXPECT_EQ(kinds_of(25), (std::vector<std::string>{"attitude", "motion"}));
  EXPECT_EQ(kinds_of(2), (std::vector<std::string>{"attitude", "attitude"}));
}

}  // namespace
}  // namespace imud
