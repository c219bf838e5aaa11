// Elements that are sent only while a setting has a bit or a value.
#include <set>

#include "protocols/frame_seal.hpp"
#include "tests/protocols/frames/field_recording.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;

struct OptionalElement {
  unsigned bit;
  std::string_view text;
};
// Bit 8: always sent.
constexpr unsigned always = 8;
constexpr OptionalElement optional_elements[] = {
    {always, "3A"},
    {always, "length:u16/2:@data..@end+1"},
    {always, "@data"},
    {always, "sample_counter:u16"},
    {0, "rate_x_rad_per_s:f32"},
    {0, "rate_y_rad_per_s:f32"},
    {1, "C0 DE"},
    {1, "specific_force_x_m_per_s2:i16*0.01 carry"},
    {always, "@middle"},
    {2, "_:4"},
    {3, "bits:u16:0-3=alive_counter,8=1,15=!not_valid"},
    {2, "temperature_c:i16*0.01"},
    {always, "check:xor8:@data..@middle"},
    {0, "rate_z_rad_per_s:f32"},
    {4, "delta_angle_x_rad:f64"},
    {always, "00"},
    {always, "@end"},
    {always, "check:crc16/xmodem:@data..@end"},
    {always, "length:u8:@data..@middle"},
    {always, "0D 0A"},
};

std::string optional_file(std::string_view layout) {
  return "frame_version = 1\nname = \"t\"\nsetting.MASK = {min = 0, max = 31, delivered = 31}\n"
         "[[message]]\nname = \"m\"\nlayout = [" +
         std::string(layout) + "]\n[[request]]\nlayout = [\"F0\", \"{MASK}:u8\"]\nset = true\nanswer = \"AC\"\n";
}

std::string all_elements() {
  std::string layout;
  for (const auto& [bit, text] : optional_elements)
    layout += "'" + (bit == always ? "" : "MASK." + std::to_string(bit) + "? ") + std::string(text) + "',\n";
  return layout;
}
// The elements that are sent with a mask, as if there were no others.
std::string sent_elements(unsigned mask) {
  std::string layout;
  for (const auto& [bit, text] : optional_elements)
    if (bit == always || (mask >> bit & 1U) != 0) layout += "'" + std::string(text) + "',\n";
  return layout;
}

Settings with_mask(const std::string& file, unsigned mask) {
  Settings settings = frame_settings(frames_of_text(file, "test.toml"));
  settings.set("settings", std::vector<std::string>{"MASK=" + std::to_string(mask)});
  return settings;
}

Sample moving(int number) {
  Sample sample;
  sample.counter = static_cast<std::uint64_t>(number);
  sample.time.ns = 10'000'000LL * number;
  sample.rate = Vector3(0.1, -0.2, 0.01 * number);
  sample.specific_force = Vector3(0.123456 * number, 1, 2);
  sample.delta_angle = Vector3(0.5, 0, 0);
  sample.temperature_c = 20 + number;
  return sample;
}

// Each mask sends the bytes of the description that has the same elements without conditions, and they are decoded.
TEST(FrameOptional, FramesAreThoseOfTheElementsThatAreSent) {
  const std::string file = optional_file(all_elements());
  std::set<std::size_t> sizes;
  for (unsigned mask = 0; mask < 32; ++mask) {
    SCOPED_TRACE(mask);
    Line line(protocol_named("frame"), with_mask(file, mask));
    Line plain(protocol_named("frame"), with_mask(optional_file(sent_elements(mask)), mask));
    Recording got, wanted;
    FieldRecording fields(*line.decoder);
    for (int k = 0; k < 4; ++k) {
      const std::vector<std::byte> bytes = bytes_of(line, moving(k));
      ASSERT_EQ(hex_text(bytes), hex_text(bytes_of(plain, moving(k)))) << k;
      sizes.insert(bytes.size());
      line.decoder->feed({bytes}, got);
      plain.decoder->feed({bytes}, wanted);
    }
    line.decoder->finish(got);
    plain.decoder->finish(wanted);
    ASSERT_EQ(got.measurements.size(), 4U);
    EXPECT_EQ(line.decoder->errors().skipped_bytes, 0U);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(got.measurements[k].fields, wanted.measurements[k].fields);
      EXPECT_EQ(got.measurements[k].sample.rate, wanted.measurements[k].sample.rate);
      EXPECT_EQ(got.measurements[k].sample.temperature_c, wanted.measurements[k].sample.temperature_c);
      EXPECT_EQ((got.measurements[k].fields & Measurement::rate) != 0, (mask & 1U) != 0);
    }
    ASSERT_EQ(fields.rows.size(), 4U);
    EXPECT_EQ(fields.rows[3].fields.at("sample_counter").magnitude, 3U);
    const bool has_temperature = fields.rows[3].fields.at("temperature_c").kind != FieldValue::Kind::left_out;
    EXPECT_EQ(has_temperature, (mask & 4U) != 0);
    if (has_temperature) {
      EXPECT_DOUBLE_EQ(fields.rows[3].fields.at("temperature_c").real, 23);
    }
  }
  EXPECT_GE(sizes.size(), 10U);
}

// A host changes the mask of a unit, without an allocation; increments and remainders go on.
TEST(FrameOptional, AHostSwitchesThem) {
  const std::string file = optional_file(all_elements());
  Line line(protocol_named("frame"), with_mask(file, 31));
  const auto buffer = std::make_unique<FrameBuffer>();
  for (unsigned mask = 0; mask < 32; ++mask) {
    const std::byte request[] = {std::byte{0xF0}, static_cast<std::byte>(mask)};
    const std::uint64_t before = allocations();
    buffer->clear();
    line.device->receive({request}, moving(static_cast<int>(mask)).time, *buffer);
    ASSERT_EQ(buffer->frames().size(), 1U);
    buffer->clear();
    line.device->sample(moving(static_cast<int>(mask)), *buffer);
    ASSERT_EQ(allocations(), before);
    ASSERT_EQ(buffer->frames().size(), 1U);
    Line same(protocol_named("frame"), with_mask(file, mask));
    Recording recording;
    same.decoder->feed(buffer->frames()[0], recording);
    ASSERT_EQ(recording.measurements.size(), 1U) << mask;
    EXPECT_EQ(recording.measurements[0].sample.counter, mask);
  }
}

TEST(FrameOptional, IncrementsAreThoseSinceTheMessageWasSent) {
  Line slow(
      protocol_named("frame"),
      with_mask("frame_version = 1\nname = \"t\"\nsetting.MASK = {min = 0, max = 31}\n[[message]]\ndivider = 4\n"
                "layout = [\"@a\", \"A1\", \"length:u8:@a..@\", \"MASK.0? delta_angle_x_rad:f32 "
                "be\"]\n[[request]]\nlayout = [\"F0\", "
                "\"{MASK}:u8\"]\nset = true\n",
                0));
  std::vector<std::string> sent;
  for (int k = 0; k < 9; ++k) {
    if (k == 6) hex_answer(slow, "F0 01");
    sent.push_back(hex_text(bytes_of(slow, moving(k))));
  }
  EXPECT_EQ(sent, (std::vector<std::string>{"A1 02", "", "", "", "A1 02", "", "", "", "A1 06 40 00 00 00"}));
}

// The frames of other settings are not decoded, unless they have the same length.
TEST(FrameOptional, ADecoderHasTheSettingsThatItIsGiven) {
  const std::string file = optional_file(all_elements());
  int skipped = 0;
  for (unsigned mask = 0; mask < 32; ++mask) {
    Line line(protocol_named("frame"), with_mask(file, mask));
    const std::vector<std::byte> bytes = bytes_of(line, moving(1));
    for (unsigned other = 0; other < 32; ++other) {
      Line decoding(protocol_named("frame"), with_mask(file, other));
      const bool is_as_long = bytes_of(decoding, moving(1)).size() == bytes.size();
      Recording recording;
      decoding.decoder->feed({bytes}, recording);
      decoding.decoder->finish(recording);
      if (!is_as_long || other == mask) {
        ASSERT_EQ(recording.measurements.size(), other == mask ? 1U : 0U) << mask << " by " << other;
        ASSERT_EQ(decoding.decoder->errors().skipped_bytes, other == mask ? 0U : bytes.size());
        ++skipped;
      }
    }
  }
  EXPECT_GT(skipped, 500);
}

// The checks of frames with any elements are written again, whatever the settings of the seal are.
TEST(FrameOptional, FramesAreSealed) {
  const std::string file = optional_file(R"("3A", "@h", "length:u8:@d..@e", "@d", "MASK.0? rate_x_rad_per_s:f32",
      "MASK.1? temperature_c:i16", "alive_counter:u8", "@e", "check:sum8:@h..@e", "0A")");
  const auto seal = make_seal(protocol_named("frame"), with_mask(file, 3));
  ASSERT_NE(seal, nullptr);
  for (unsigned mask = 0; mask < 4; ++mask) {
    Line line(protocol_named("frame"), with_mask(file, mask));
    const std::vector<std::byte> good = bytes_of(line, moving(1));
    std::vector<std::byte> frame = good;
    frame[frame.size() - 2] ^= std::byte{0x55};  // the check
    ASSERT_EQ(seal->reseal(frame, {}).size(), good.size()) << mask;
    EXPECT_EQ(frame, good);
    frame[frame.size() - 3] ^= std::byte{1};  // the counter
    ASSERT_FALSE(seal->reseal(frame, {}).empty());
    Recording recording;
    line.decoder->feed({frame}, recording);
    EXPECT_EQ(recording.measurements.size(), 1U);
    for (const std::size_t constant : {std::size_t{0}, std::size_t{1}, frame.size() - 1}) {
      std::vector<std::byte> wrong = good;
      wrong[constant] ^= std::byte{1};
      EXPECT_TRUE(seal->reseal(wrong, {}).empty()) << constant;
    }
  }
}

TEST(FrameOptional, ConditionsAreBitsAndValues) {
  const std::string file =
      "frame_version = 1\nname = \"t\"\n[setting]\nFORM = [\"A\", \"B\", \"C\"]\nFLAGS = {values = [\"none\", "
      "\"both\"], "
      "codes = [0, 5]}\n[[message]]\nlayout = [\"A1\", \"length:u8:@d..@\", \"@d\", \"FORM=A? 0A\", \"FORM=C? 0C\", "
      "\"FLAGS.2? 02\", \"!FLAGS.0? 00\"]\n";
  const auto sent = [&](const std::vector<std::string>& values) {
    Settings settings = frame_settings(frames_of_text(file, "test.toml"));
    settings.set("settings", values);
    Line line(protocol_named("frame"), settings);
    return hex_text(bytes_of(line, {}));
  };
  EXPECT_EQ(sent({}), "A1 02 0A 00");
  EXPECT_EQ(sent({"FORM=B"}), "A1 01 00");
  EXPECT_EQ(sent({"FORM=C", "FLAGS=both"}), "A1 02 0C 02");
}

TEST(FrameOptional, EscapedFramesHaveThem) {
  const std::string file = "escape = \"slip\"\n" + [] {
    std::string text = optional_file(all_elements());
    return text.substr(0, text.find("[[request]]"));
  }();
  for (const unsigned mask : {0U, 5U, 31U}) {
    Line line(protocol_named("frame"), with_mask(file, mask));
    Recording recording;
    for (int k = 0; k < 3; ++k) {
      const std::vector<std::byte> bytes = bytes_of(line, moving(k));
      line.decoder->feed({bytes}, recording);
    }
    EXPECT_EQ(recording.measurements.size(), 3U);
  }
}

TEST(FrameOptional, TestFramesHaveTheSettingsWithWhichTheyWereSent) {
  const auto with = [](const std::string& keys) {
    return "frame_version = 1\nname = \"t\"\nsetting.MASK = {min = 0, max = 31, delivered = 9}\n[[message]]\nname = "
           "\"m\"\nlayout = [\"A1\", \"length:u8:@d..@e\", \"@d\", \"MASK.0? alive_counter:u8\", \"MASK.3? "
           "temperature_c:i16\", \"@e\", \"check:sum8:@d..@e\"]\n" +
           keys;
  };
  EXPECT_EQ(
      faults_of(with("test_frame = \"A1 03 07 19 00 20\"\ntest_values = {alive_counter = 7, temperature_c = 25}")),
      "");
  EXPECT_EQ(
      faults_of(with("test_frame = [\"A1 02 19 00 19\", \"A1 00 00\"]\ntest_values = [{temperature_c = 25}, {}]\n"
                     "test_settings = [{MASK = 8}, {MASK = 0}]")),
      "");
  EXPECT_EQ(faults_of(with(
                "test_frame = [\"A1 01 05 05\"]\ntest_values = {alive_counter = 5}\ntest_settings = {MASK = 1}")),
            "");
  const std::pair<std::string, const char*> cases[] = {
      {"test_frame = \"A1 02 19 00 19\"\ntest_values = {temperature_c = 25}",
       "has 5 bytes, but the layout 6; they agree up to"},
      {"test_frame = \"A1 02 19 00 19\"\ntest_values = {temperature_c = 26}\ntest_settings = {MASK = 8}",
       "differs at byte 2, in temperature_c (i16 le at 2)"},
      {"test_frame = \"A1 02 19 00 19\"\ntest_values = {alive_counter = 26}\ntest_settings = {MASK = 8}",
       "the message does not carry it; its fields are temperature_c"},
      {"test_frame = \"A1 02 19 00 19\"\ntest_settings = {MASK = 32}", "test_settings: 32 is no value of MASK"},
      {"test_frame = \"A1 02 19 00 19\"\ntest_settings = {MAS = 8}", "did you mean \"MASK\"?"},
      {"test_frame = \"A1 02 19 00 19\"\ntest_settings = [{MASK = 8}, {}]", "there are 2 tables for 1 frames"},
      {"test_frame = \"A1 02 19 00 19\"\ntest_settings = 8", "give settings with their values"},
  };
  for (const auto& [keys, wanted] : cases)
    EXPECT_TRUE(contains(faults_of(with(keys)), wanted)) << faults_of(with(keys));
  EXPECT_TRUE(
      contains(faults_of("setting.A = [1]\n" + one_message("A1", "test_frame = \"A1\"\ntest_settings = {A = 1}")),
               "test_settings: no element is optional"));
}

// A bit is in a range if the range has a value with this bit: 4 alone has bit 2, and 5 to 7 have bits 0, 1 and 2.
TEST(FrameOptional, ABitMustBeOfAValueInTheRange) {
  const auto faults = [](int lowest, int highest, int bit) {
    return faults_of("frame_version = 1\nname = \"t\"\nsetting.S = {min = " + std::to_string(lowest) +
                     ", max = " + std::to_string(highest) + ", delivered = " + std::to_string(lowest) +
                     "}\n[[message]]\nname = \"m\"\nlayout = [\"@a\", \"A1\", \"S." + std::to_string(bit) +
                     "? 00\", \"check:sum8:@a..\"]\n");
  };
  constexpr std::tuple<int, int, unsigned> ranges[] = {{4, 4, 4}, {5, 7, 7}, {6, 9, 15}, {8, 9, 9}, {7, 8, 15}};
  for (const auto& [lowest, highest, bits] : ranges)
    for (int bit = 0; bit < 5; ++bit)
      EXPECT_EQ(!contains(faults(lowest, highest, bit), "no value of S has bit " + std::to_string(bit)),
                (bits >> bit & 1U) != 0)
          << lowest << " to " << highest << ", bit " << bit << ": " << faults(lowest, highest, bit);
}

TEST(FrameOptional, WhatCannotBeDecodedIsRefused) {
  const std::pair<const char*, const char*> cases[] = {
      {R"("A1", "MASK.0? rate_x_rad_per_s:f32")", "a decoder cannot see whether the optional elements are there"},
      {R"("@a", "A1", "@b", "length:u8:@a..@b", "MASK.0? rate_x_rad_per_s:f32")",
       "give a length of them, or a check"},
      {R"("A1", "MASK.0? length:u8:@a..@", "@a")", "only constants, _:N, numbers and bits are optional"},
      {R"("A1", "MASK.0? @a")", "only constants, _:N, numbers and bits are optional"},
      {R"("@a", "A1", "MASK.0? check:sum8:@a..")", "only constants, _:N, numbers and bits are optional"},
      {R"("@a", "A1", "MASK.0? 00", "pad:4", "check:sum8:@a..")", "elements before it are optional"},
      {R"("@a", "A1", "MASK? 00", "check:sum8:@a..")", "begins with a bit or a value of a setting, as MASK.3?"},
      {R"("@a", "A1", "MASK.64? 00", "check:sum8:@a..")", "begins with a bit or a value of a setting, as MASK.3?"},
      {R"("@a", "A1", "MASK.x? 00", "check:sum8:@a..")", "begins with a bit or a value of a setting, as MASK.3?"},
      {R"("@a", "A1", "MASK.5? 00", "check:sum8:@a..")", "no value of MASK has bit 5"},
      {R"("@a", "A1", "MSK.0? 00", "check:sum8:@a..")", "did you mean \"MASK\"?"},
      {R"("@a", "A1", "MASK=32? 00", "check:sum8:@a..")", "32 is no value of MASK"},
      {R"("@a", "A1", "MASK.0? 00", "check:sum16/16:@a..")", "have 1 bytes, which are no whole number of words"},
      {R"("@a", "A1", "length:u8/2:@b..@", "@b", "MASK.0? 00", "MASK.1? 00")",
       "have 1 bytes, which are no whole number of pieces of 2 bytes"},
      {R"("@a", "A1", "length:u8:@b..@-2", "@b", "MASK.0? 00", "MASK.1? 00 00")",
       "the length is negative without the optional elements"},
      {R"("@a", "A1", "length:u8:@b..@", "@b", "MASK.0? _:200", "MASK.1? _:200")",
       "the type does not hold the length"},
  };
  for (const auto& [layout, wanted] : cases) {
    const std::string faults = faults_of(optional_file(layout));
    EXPECT_TRUE(contains(faults, wanted)) << layout << "\n" << faults;
  }
  const auto request = [](const std::string& keys) { return optional_file("\"A1\"") + "[[request]]\n" + keys; };
  for (const char* keys : {"layout = [\"A2\", \"MASK.0? 00\"]", "layout = [\"A2\", \"MASK.0? {MASK}:u8\"]",
                           "bytes = \"A3\"\nanswer = [\"MASK.0? temperature_c:f32\"]"})
    EXPECT_TRUE(contains(faults_of(request(keys)), "only a message has optional elements"))
        << faults_of(request(keys));
}

TEST(FrameOptional, TheTableShowsThem) {
  const std::vector<std::string> table = protocol_named("frame").layout(frame_settings(frames_of_text(
      optional_file(R"("A1", "length:u8:@d..@e", "@d", "MASK.0? rate_x_deg_per_s:f32", "temperature_c:i16", "@e",
      "check:sum8:@d..@e")"),
      "test.toml")));
  const auto has = [&](std::string_view wanted) {
    return std::ranges::any_of(table, [&](const std::string& line) { return line.ends_with(wanted); });
  };
  EXPECT_TRUE(contains(table.at(0), "at most 9 bytes")) << table.at(0);
  EXPECT_TRUE(has("rate_x, if MASK.0"));
  EXPECT_TRUE(has("length of @d..@e"));
  EXPECT_TRUE(has("check sum8 of @d..@e"));
  EXPECT_TRUE(std::ranges::any_of(table, [](const auto& line) { return contains(line, "     2  f32"); }));
  EXPECT_TRUE(std::ranges::any_of(table, [](const auto& line) { return line.starts_with("        i16 le"); }));
}

}  // namespace
}  // namespace imud
