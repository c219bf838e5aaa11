// The fields of decoded frames by their names: of the frames that units have sent, of all shipped descriptions, and
// of bytes that were written by hand.
#include <cstring>

#include "tests/protocols/frames/field_recording.hpp"

namespace imud {
namespace {

FieldRecording::Row row_of(const std::string& text, const std::vector<std::byte>& bytes) {
  Line line = frame_line(text);
  Recording recording;
  FieldRecording frames(*line.decoder);
  line.decoder->feed({bytes}, recording);
  line.decoder->finish(recording);
  EXPECT_EQ(frames.rows.size(), 1U);
  return frames.rows.empty() ? FieldRecording::Row() : frames.rows.front();
}

TEST(FrameFields, UndoLsbOffsetModulusAndSign) {
  const auto fields =
      row_of(one_message("A5\n-rate_y_deg_per_s:i16*0.01\ntemperature_c:u8-40\nyaw_deg%360:u16*0.01\n"
                         "-roll_deg%360:u16\npressure_pa:f32\nheight_m:f64\n-velocity_east_m_per_s:i8\n"
                         "_:1\nspecific_force_x_g:i8*-1/4\ntemperature_k:u16*0.01 be"),
             hex_bytes("A5 2C FF 41 78 69 0E 01 CD CC CC 3D 9A 99 99 99 99 99 B9 3F FE 77 08 74 77"))
          .fields;
  EXPECT_EQ(fields.size(), 9U);
  EXPECT_DOUBLE_EQ(number_of(fields.at("rate_y_deg_per_s")), 2.12);
  EXPECT_EQ(number_of(fields.at("temperature_c")), 25);
  EXPECT_DOUBLE_EQ(number_of(fields.at("yaw_deg")), 270);
  EXPECT_EQ(number_of(fields.at("roll_deg")), 90);  // -90 was sent, as 270
  EXPECT_EQ(number_of(fields.at("pressure_pa")), 0.1);
  EXPECT_EQ(number_of(fields.at("height_m")), 0.1);
  EXPECT_EQ(number_of(fields.at("velocity_east_m_per_s")), 2);
  EXPECT_EQ(number_of(fields.at("specific_force_x_g")), -2);
  EXPECT_DOUBLE_EQ(number_of(fields.at("temperature_k")), 298.15);
}

TEST(FrameFields, HaveIntegersExactly) {
  const auto fields = row_of(one_message("A5\ntime_ns:u64 be\n-gps_time_ns:i64 be\nstatus:u32 be\n"
                                         "bits:u8:0-2=frame_counter,3=not_valid,4=!at_rest,5=1"),
                             hex_bytes("A5 80 00 00 00 00 00 00 01 7F FF FF FF FF FF FF FF DE AD BE EF 35"))
                          .fields;
  EXPECT_EQ(fields.size(), 6U);
  EXPECT_EQ(fields.at("time_ns").magnitude, 0x8000'0000'0000'0001U);
  EXPECT_EQ(fields.at("gps_time_ns").magnitude, 0x7FFF'FFFF'FFFF'FFFFU);
  EXPECT_TRUE(fields.at("gps_time_ns").is_negative);
  EXPECT_EQ(fields.at("status").magnitude, 0xDEADBEEFU);
  EXPECT_EQ(fields.at("frame_counter").magnitude, 5U);
  EXPECT_EQ(fields.at("not_valid").magnitude, 0U);
  EXPECT_EQ(fields.at("at_rest").magnitude, 0U);
}

TEST(FrameFields, OfTextMayBeLeftOut) {
  const std::string text =
      "frame_version = 1\nname = \"test\"\n[[message]]\nname = \"m\"\ntext = \"$X,{latitude_deg:ddmm.mm?},"
      "{latitude_deg:N/S?},{time_of_day_s:hh:mm:ss.s?},{-pitch_deg:.1f?},{not_valid:V/A},{gnss_fix:A/N},"
      "{sample_counter:04X}\\n\"\n";
  const auto read = [&](const std::string& line) {
    std::vector<std::byte> bytes(line.size());
    std::memcpy(bytes.data(), line.data(), line.size());
    return row_of(text, bytes).fields;
  };
  const auto all = read("$X,4830.60,S,01:02:03.5,-4.5,A,N,00FF\n");
  EXPECT_EQ(all.size(), 6U);
  EXPECT_DOUBLE_EQ(number_of(all.at("latitude_deg")), -48.51);
  EXPECT_DOUBLE_EQ(number_of(all.at("time_of_day_s")), 3723.5);
  EXPECT_EQ(number_of(all.at("pitch_deg")), 4.5);
  EXPECT_EQ(number_of(all.at("not_valid")), 0);
  EXPECT_EQ(number_of(all.at("gnss_fix")), 0);
  EXPECT_EQ(number_of(all.at("sample_counter")), 255);
  const auto some = read("$X,,,,,V,A,0001\n");
  for (const char* name : {"latitude_deg", "time_of_day_s", "pitch_deg"})
    EXPECT_EQ(some.at(name).kind, FieldValue::Kind::left_out) << name;
  EXPECT_EQ(number_of(some.at("not_valid")), 1);
  EXPECT_EQ(number_of(some.at("gnss_fix")), 1);
}

TEST(FrameFields, NamesThatOccurTwiceGetANumber) {
  const std::string text = one_message("A5 01\nsample_counter:u8\nsample_counter%100:u8") +
                           "[[message]]\nname = \"m\"\nlayout = [\"A5 02\", \"sample_counter:u8\"]\n"
                           "[[message]]\nname = \"m_2\"\nlayout = [\"A5 03\", \"sample_counter:u8\"]\n";
  Line line = frame_line(text);
  const auto kinds = dynamic_cast<FieldDecoder&>(*line.decoder).frame_kinds();
  ASSERT_EQ(kinds.size(), 3U);
  EXPECT_EQ(kinds[0].name, "m");
  EXPECT_EQ(kinds[0].fields, (std::vector<std::string>{"sample_counter", "sample_counter_2"}));
  EXPECT_EQ(kinds[1].name, "m_2");
  EXPECT_EQ(kinds[2].name, "m_2_2");
}

}  // namespace
}  // namespace imud
