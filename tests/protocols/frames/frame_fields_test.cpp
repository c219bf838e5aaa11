// The fields of decoded frames by their names: of the frames that units have sent, of all shipped descriptions, and
// of bytes that were written by hand.
#include <cmath>
#include <cstring>
#include <optional>
#include <set>
#include <string>

#include "core/units.hpp"
#include "protocols/frames/text/text_piece.hpp"
#include "tests/protocols/frames/field_recording.hpp"

namespace imud {
namespace {

// A field as the description gives it, parsed here again.
struct DescribedField {
  FrameSource source;
  double lsb = 0;       // in the unit; 0: of a counter or a bit
  double relative = 0;  // of floats
  unsigned width = 64;  // bits of a counter
  bool may_be_left_out = false;
  std::string condition = {};             // of an optional element
  std::optional<TextFormat> choice = {};  // of texts
};

std::vector<DescribedField> fields_of_bytes(const FrameDescription& description,
                                            const FrameDescription::Message& message) {
  std::vector<DescribedField> fields;
  for (const FrameDescription::Text& text : message.layout) {
    const FrameElement element = parse_frame_element(text.text, message.is_big, description.checks);
    if (element.kind == FrameElement::Kind::field) {
      const FrameNumber& type = element.number;
      const double relative = type.format == FrameNumber::Format::float32 ? 1e-6 : type.is_float() ? 1e-13 : 1e-13;
      fields.push_back({element.source, type.is_float() ? 0 : std::abs(element.lsb), relative,
                        static_cast<unsigned>(8 * type.bytes), false, element.condition});
    }
    for (const FrameElement::BitField& bits : element.bit_fields)
      if (bits.source.kind != FrameSource::Kind::constant)
        fields.push_back({bits.source, 0, 0, bits.high - bits.low + 1, false, element.condition});
  }
  return fields;
}

std::vector<DescribedField> fields_of_text(const FrameDescription& description,
                                           const FrameDescription::Message& message) {
  std::vector<DescribedField> fields;
  std::set<const MeasuredQuantity*> angles;  // that are sent without sign
  const std::vector<TextPiece> pieces = parse_text_pieces(message.text->text, description.checks);
  for (const TextPiece& piece : pieces)
    if (piece.kind == TextPiece::Kind::field && piece.format.value() == TextFormat::Value::degrees)
      angles.insert(piece.source.in.quantity);
  for (const TextPiece& piece : pieces) {
    if (piece.kind != TextPiece::Kind::field) continue;
    const bool is_choice = piece.format.chosen("").has_value();
    if (is_choice && angles.contains(piece.source.in.quantity)) continue;
    // Digits of a pattern; all that are shipped have the unit of their name.
    double step = piece.format.step();
    if (piece.format.value() == TextFormat::Value::seconds) step = 0.01;
    if (piece.format.value() == TextFormat::Value::degrees) step = 1e-6 / 60;
    fields.push_back({piece.source,
                      step * std::abs(piece.lsb),
                      1e-13,
                      64,
                      piece.format.may_be_empty(),
                      {},
                      is_choice ? std::optional(piece.format) : std::nullopt});
  }
  return fields;
}

std::vector<DescribedField> fields_of(const FrameDescription& description, const FrameDescription::Message& message) {
  return message.text ? fields_of_text(description, message) : fields_of_bytes(description, message);
}

// Returns the value that is read where a choice stands for the number: of two texts 1 above 0; of several the number
// itself, or the lowest with the same text.
double wanted_of(const TextFormat& choice, double number) {
  const auto written = [&](double value) {
    std::string text(choice.longest(), ' ');
    bool is_saturated = false;
    text.resize(choice.write(value, text.data(), is_saturated));
    return text;
  };
  if (choice.is_above(written(1))) return number > 0 ? 1 : 0;
  return static_cast<double>(choice.choice_value(written(number)));
}

// Compares a value with the quantity of the sample, or with the test value if `given` is not nullptr.
void expect_field(const DescribedField& field, const FieldValue& value, const Reading& reading,
                  const MessageLayout::State& state, const FrameTestValues* given) {
  const FrameSource& source = field.source;
  const MeasuredQuantity* quantity = source.in.quantity;
  const bool is_number = quantity != nullptr && quantity->kind == MeasuredQuantity::Kind::number;
  if (given != nullptr && field.may_be_left_out && is_number && !given->has(*quantity)) {
    EXPECT_EQ(value.kind, FieldValue::Kind::left_out);
    return;
  }
  ASSERT_NE(value.kind, FieldValue::Kind::left_out);
  const double got = number_of(value);
  if (source.kind == FrameSource::Kind::status) {
    EXPECT_EQ(got, is_set(source.bits, reading, state) ? 1 : 0);
    return;
  }
  const auto counted = [&](std::uint64_t count) {
    const std::uint64_t sent = source.modulus != 0 ? count % static_cast<std::uint64_t>(source.modulus) : count;
    EXPECT_EQ(got, static_cast<double>(sent & low_bits(field.width)));
    EXPECT_EQ(value.kind, FieldValue::Kind::integer);
  };
  if (source.kind == FrameSource::Kind::alive_counter) return counted(state.count);
  if (source.kind == FrameSource::Kind::frame_counter) return counted(state.frames);
  if (quantity->kind == MeasuredQuantity::Kind::counter) return counted(reading.sample.counter);
  if (quantity->kind == MeasuredQuantity::Kind::status) return counted(reading.sample.status);
  const double si = quantity->kind == MeasuredQuantity::Kind::time
                        ? 1e-9 * static_cast<double>(reading.sample.stamp().ns)
                        : number_of(*quantity, source.otherwise, reading, given);
  if (field.choice) {
    EXPECT_EQ(got, wanted_of(*field.choice, si)) << si;
    return;
  }
  if (source.kind == FrameSource::Kind::flag) {
    const double value = (si - source.in.offset) / source.in.factor;
    EXPECT_EQ(got, (source.limit ? value < *source.limit : value > 0) ? 1 : 0) << value;
    return;
  }
  const double wanted = (si - source.in.offset) / std::abs(source.in.factor);
  double difference = got - wanted;
  if (source.modulus != 0) {
    EXPECT_GE(got, 0);
    EXPECT_LE(got, source.modulus);
    difference -= source.modulus * std::round(difference / source.modulus);
  }
  EXPECT_LE(std::abs(difference), field.lsb * (1 + 1e-6) + field.relative * std::abs(wanted) + 1e-30)
      << got << " for " << wanted;
}

// Calls `act` with each message of each shipped description.
template <class Act>
void each_shipped_message(Act act) {
  for (const ShippedFrames& shipped : shipped_frames()) {
    const auto description = read_frames(std::string(shipped.name));
    const std::vector<FrameMessage> messages = frame_messages(*description);
    for (std::size_t i = 0; i < messages.size(); ++i) {
      SCOPED_TRACE(std::string(shipped.name) + ", message " + messages[i].name);
      const std::vector<DescribedField> fields = fields_of(*description, description->messages[i]);
      ASSERT_EQ(messages[i].layout->fields().size(), fields.size());
      act(*description, description->messages[i], *messages[i].layout, fields);
    }
  }
}

// Returns the values of the settings with which a test frame was sent.
std::vector<FrameValue> values_of(const FrameSettings& settings, const FrameDescription::Test& test) {
  std::vector<FrameValue> values = settings.delivered();
  for (const FrameHostDescription::Choice& choice : test.settings) {
    const std::size_t setting = settings.at(choice.setting);
    values[setting] = settings.value_at(setting, choice.values.front());
  }
  return values;
}

void expect_fields(const FrameSettings& settings, std::span<const FrameValue> chosen, MessageLayout& layout,
                   std::span<const std::byte> frame, const std::vector<DescribedField>& fields,
                   const Reading& reading, const MessageLayout::State& state, const FrameTestValues* given,
                   int& compared) {
  layout.select(chosen);
  std::vector<FieldValue> values(fields.size());
  layout.read_fields(frame, values);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    SCOPED_TRACE(std::to_string(i) + ", " + layout.fields()[i]);
    EXPECT_EQ(layout.fields()[i], fields[i].source.name);
    if (!fields[i].condition.empty()) {
      const FrameCondition condition = settings.condition(fields[i].condition);
      const bool is_sent = condition.allows(chosen[condition.setting]);
      EXPECT_EQ(values[i].kind != FieldValue::Kind::left_out, is_sent);
      if (!is_sent) continue;
    }
    expect_field(fields[i], values[i], reading, state, given);
    ++compared;
  }
}

// The test frames are from outside: from documents, captures and other encoders.
TEST(FrameFields, OfTestFramesAreTheirTestValues) {
  int compared = 0;
  each_shipped_message([&](const FrameDescription& description, const FrameDescription::Message& message,
                           MessageLayout& layout, const std::vector<DescribedField>& fields) {
    const FrameSettings settings(description);
    for (const FrameDescription::Test& test : message.tests) {
      FrameTestValues given;
      for (const FrameDescription::Value& value : test.values) given.add(test_source(value.name), value.value);
      std::vector<std::byte> frame(test.frame.text.size());
      std::memcpy(frame.data(), test.frame.text.data(), frame.size());
      if (!message.text) frame = hex_bytes(test.frame.text);
      expect_fields(settings, values_of(settings, test), layout, frame, fields, {given.sample}, given.state, &given,
                    compared);
    }
  });
  EXPECT_GE(compared, 800);
}

Sample sample_with_all() {
  Sample sample;
  sample.time.ns = 12'345'678;
  sample.counter = 1;
  sample.rate = Vector3(0.1, -0.2, 0.3);
  sample.specific_force = Vector3(0.5, -0.25, -9.8);
  sample.delta_angle = 0.01 * sample.rate;
  sample.delta_velocity = 0.01 * sample.specific_force;
  sample.temperature_c = 31;
  sample.status = status::gyro_saturated_x << 1 | status::accelerometer_saturated_x;
  sample.magnetic_field = Vector3(2e-5, -1e-6, 4e-5);
  sample.pressure = 98'765;
  sample.q_LP = Quaternion(0.98, -0.05, 0.04, -0.33).normalized();
  sample.navigation = {.is_known = true,
                       .gps_ns = 1'440'000'001'234'500'000,
                       .latitude = -0.8,
                       .longitude = 0.1,
                       .height = 432.1,
                       .r_E = Vector3(4'429'000, 444'300, -4'553'000),
                       .v_L = Vector3(3, -4, 0.5)};
  return sample;
}

TEST(FrameFields, AreTheSamplesQuantitiesWithinAnLsb) {
  int compared = 0;
  const Sample sample = sample_with_all();
  const Reading reading{sample, sample.delta_angle, sample.delta_velocity, exp(sample.delta_angle), 0.01};
  const MessageLayout::State state{2, 3, false};
  each_shipped_message([&](const FrameDescription& description, const FrameDescription::Message&,
                           MessageLayout& layout, const std::vector<DescribedField>& fields) {
    const FrameSettings settings(description);
    std::vector<std::byte> frame(layout.longest());
    std::vector<double> carried(layout.carries());
    const auto [size, saturated] = layout.encode(reading, state, carried, frame);
    EXPECT_EQ(saturated, 0U);
    expect_fields(settings, settings.delivered(), layout, std::span(frame).first(size), fields, reading, state,
                  nullptr, compared);
  });
  EXPECT_GE(compared, 450);
}

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

TEST(FrameFields, BitsAndTextsOfQuantitiesHaveValues) {
  const std::string layout = one_message("A5\nbits:u8:0=gnss_fix,1=!gnss_fix,2=height_m<5");
  const auto fields = row_of(layout, hex_bytes("A5 06")).fields;
  ASSERT_EQ(fields.size(), 3U);
  EXPECT_EQ(number_of(fields.at("gnss_fix")), 0);
  EXPECT_EQ(number_of(fields.at("gnss_fix_2")), 0);
  EXPECT_EQ(number_of(fields.at("height_m<5")), 1);
  const std::string text =
      "frame_version = 1\nname = \"test\"\n[[message]]\nname = \"m\"\ntext = \"$X,{gnss_fix:N/E/A},\\n\"\n";
  EXPECT_EQ(number_of(row_of(text, {std::byte{'$'}, std::byte{'X'}, std::byte{','}, std::byte{'A'}, std::byte{','},
                                    std::byte{'\n'}})
                          .fields.at("gnss_fix")),
            2);
}

TEST(FrameFields, NamesThatOccurTwiceGetANumber) {
  const std::string text = one_message("A5 01\nsample_counter:u8\nsample_counter%100:u8") +
                           "[[message]]\nname = \"m\"\nlayout = [\"A5 02\", \"sample_counter:u8\"]\n"
                           "[[message]]\nname = \"m_2\"\nlayout = [\"A5 03\", \"sample_counter:u8\"]\n";
  Line line = frame_line(text);
  const auto kinds = dynamic_cast<FrameStreamDecoder&>(*line.decoder).frame_kinds();
  ASSERT_EQ(kinds.size(), 3U);
  EXPECT_EQ(kinds[0].name, "m");
  EXPECT_EQ(kinds[0].fields, (std::vector<std::string>{"sample_counter", "sample_counter_2"}));
  EXPECT_EQ(kinds[1].name, "m_2");
  EXPECT_EQ(kinds[2].name, "m_2_2");
}

}  // namespace
}  // namespace imud
