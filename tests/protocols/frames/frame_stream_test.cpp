// The frames of a stream that a decoder passes on, and the numbers of its samples.
#include <algorithm>

#include "tests/protocols/frames/field_recording.hpp"

namespace imud {
namespace {

// The frames here make no sample, and bytes of no frame precede some of them.
TEST(FrameStream, FramesHaveTheirOffset) {
  for (const char* name : {"none", "slip", "hdlc", "dle", "cobs"}) {
    SCOPED_TRACE(name);
    Line line = frame_line("escape = \"" + std::string(name) + "\"\n" +
                           one_message("@b\n41 43\nsample_counter:u32\ncheck:crc32/iso-hdlc:@b.."));
    const std::string_view escape = name;
    const std::uint64_t mark = escape == "slip" || escape == "hdlc" ? 1 : 0;
    std::vector<std::byte> bytes;
    std::vector<std::uint64_t> wanted;
    for (std::uint64_t k = 0; k < 300; ++k) {
      Sample sample;
      sample.counter = 0x7D7E10C000 + k;
      if (k % 7 == 0 && k > 0) bytes.insert(bytes.end(), k % 3 + 1, std::byte{0x55});
      // With COBS, bytes without a mark at their end would be part of the next frame.
      if (k % 7 == 0 && k > 0 && escape == "cobs") bytes.push_back(std::byte{0});
      wanted.push_back(bytes.size() + mark);
      const std::vector<std::byte> frame = bytes_of(line, sample);
      bytes.insert(bytes.end(), frame.begin(), frame.end());
    }
    Recording recording;
    FieldRecording frames(*line.decoder);
    for (std::size_t at = 0; at < bytes.size(); at += 13)
      line.decoder->feed({std::span(bytes).subspan(at, std::min<std::size_t>(13, bytes.size() - at))}, recording);
    line.decoder->finish(recording);
    ASSERT_EQ(frames.rows.size(), wanted.size());
    for (std::size_t k = 0; k < wanted.size(); ++k) EXPECT_EQ(frames.rows[k].offset, wanted[k]) << k;
  }
}

// The settings decide between messages that look alike, with escapes and without.
TEST(FrameStream, PassesTheMessageThatIsSwitchedOn) {
  for (const char* escape : {"none", "cobs"})
    for (const char* form : {"RATE", "ANGLE"}) {
      SCOPED_TRACE(std::string(escape) + " " + form);
      Settings settings = frame_settings(frames_of_text(
          "escape = \"" + std::string(escape) + "\"\n" +
              "frame_version = 1\nname = \"test\"\n[setting]\nFORM = [\"RATE\", \"ANGLE\"]\n"
              "[[message]]\nname = \"rate\"\nwhen = {FORM = \"RATE\"}\nlayout = [\"A1 A2\", "
              "\"rate_x_rad_per_s:f32\"]\n"
              "[[message]]\nname = \"angle\"\nwhen = {FORM = \"ANGLE\"}\nlayout = [\"A1 A2\", \"yaw_rad:f32\"]\n",
          "test.toml"));
      settings.set("settings", std::vector<std::string>{"FORM=" + std::string(form)});
      Line line(protocol_named("frame"), settings);
      Recording recording;
      FieldRecording frames(*line.decoder);
      const std::vector<std::byte> bytes = bytes_of(line, {});
      line.decoder->feed({bytes}, recording);
      ASSERT_EQ(frames.rows.size(), 1U);
      EXPECT_EQ(frames.rows[0].message, std::string_view(form) == "RATE" ? "rate" : "angle");
    }
}

// The messages of a sample together have the rates about x and z, and all of the specific force.
TEST(FrameStream, ComponentThatNoMessageHasIsNaN) {
  Line line = frame_line(
      one_message("A1\nrate_x_rad_per_s:f32\nspecific_force_x_m_per_s2:f32\nspecific_force_y_m_per_s2:f32") +
      "[[message]]\nname = \"other\"\nlayout = [\"A2\", \"rate_z_rad_per_s:f32\", "
      "\"specific_force_z_m_per_s2:f32\"]\n");
  Recording recording;
  Sample sample;
  sample.rate = {1, 2, 3};
  sample.specific_force = {4, 5, 6};
  line.decoder->feed({bytes_of(line, sample)}, recording);
  ASSERT_EQ(recording.measurements.size(), 1U);
  const auto& [read, fields] = recording.measurements[0];
  EXPECT_EQ(fields, Measurement::rate | Measurement::specific_force);
  EXPECT_EQ(read.rate.x(), 1);
  EXPECT_TRUE(std::isnan(read.rate.y()));
  EXPECT_EQ(read.rate.z(), 3);
  EXPECT_EQ(read.specific_force, sample.specific_force);
}

// --- Gaps by the counter of all messages ---
std::vector<std::uint64_t> counters_of(const std::string& second, std::string_view time) {
  Line line = frame_line(one_message("A5 01\nframe_counter:u8\nrate_x_deg_per_s:i16\n" + std::string(time)) +
                         "[[message]]\nname = \"ahrs\"\n" + second +
                         "layout = [\"A5 02\", \"frame_counter:u8\", \"yaw_deg:i16\"]\n");
  Recording recording;
  Sample sample;
  for (int k = 0; k < 300; ++k) {
    const std::vector<std::byte> bytes = bytes_of(line, sample);
    if (k != 200 && k != 201) line.decoder->feed({bytes}, recording);
    ++sample.counter;
    sample.time = sample.time + std::chrono::milliseconds(10);
  }
  line.decoder->finish(recording);
  std::vector<std::uint64_t> counters;
  for (const Measurement& measurement : recording.measurements)
    if ((measurement.fields & Measurement::counter) != 0) counters.push_back(measurement.sample.counter);
  return counters;
}

TEST(FrameStream, ACounterOfAllMessagesCountsSamplesThatHaveNothingElse) {
  const std::vector<std::uint64_t> counters = counters_of("", "");
  ASSERT_EQ(counters.size(), 298U);
  for (std::uint64_t k = 0; k < 298; ++k) EXPECT_EQ(counters[k], 2 * (k < 200 ? k : k + 2)) << k;
  EXPECT_TRUE(counters_of("divider = 3\n", "").empty()) << "its steps differ";
  EXPECT_TRUE(counters_of("", "time_ms:u16").empty()) << "the time shows gaps";
}

}  // namespace
}  // namespace imud
