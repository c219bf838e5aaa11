// Messages of text: their formats by known lines, what a decoder makes of them, and the faults of a text.
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "core/units.hpp"
#include "tests/protocols/frames/frame_unit.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

// A description of one message with this text, in TOML.
std::string one_text(std::string_view text, std::string_view more = "") {
  return "frame_version = 1\nname = \"test\"\n[[message]]\nname = \"m\"\ntext = \"" + std::string(text) + "\"\n" +
         std::string(more) + "\n";
}

Sample text_sample() {
  Sample sample;
  sample.time.ns = 1'234'567'890;
  sample.counter = 0x12345;
  sample.rate = Vector3(10, -20, 0.001) * units::degree;
  sample.specific_force = Vector3(0, 0.5, -1) * units::standard_gravity;
  sample.temperature_c = 25.5;
  sample.navigation = {.is_known = true,
                       .satellites = 9,
                       .gps_ns = 1'440'000'018'250'000'000,
                       .latitude = -48.5 * units::degree,
                       .longitude = (7 + 59.99996 / 60) * units::degree};
  return sample;
}

std::string line_of(Line& line, const Sample& sample) {
  std::string text;
  for (const std::byte byte : bytes_of(line, sample)) text += static_cast<char>(byte);
  return text;
}

std::string written(std::string_view text, const Sample& sample = text_sample()) {
  Line line = frame_line(one_text(text));
  return line_of(line, sample);
}

TEST(TextMessage, NumbersAreWrittenAsPrintfDoes) {
  std::mt19937_64 random(28);
  std::uniform_real_distribution<double> mantissa(-1, 1);
  const std::pair<const char*, const char*> formats[] = {
      {"f", "%f"},           {".0f", "%.0f"},     {"8.3f", "%8.3f"}, {"+08.3f", "%+08.3f"},
      {" 7.2f", "% 7.2f"},   {"e", "%e"},         {".3e", "%.3e"},   {"+.9e", "%+.9e"},
      {"012.4e", "%012.4e"}, {"09.4f", "%09.4f"}, {".9f", "%.9f"}};
  int compared = 0;
  for (const auto& [format, printf_format] : formats) {
    Line line = frame_line(one_text("<{specific_force_x_m_per_s2:" + std::string(format) + "}>"));
    for (int k = 0; k < 500; ++k, ++compared) {
      Sample sample;
      sample.specific_force.x() = mantissa(random) * std::pow(10.0, k % 14 - 7);
      char wanted[64];
      std::snprintf(wanted, sizeof wanted, printf_format, sample.specific_force.x());
      ASSERT_EQ(line_of(line, sample), "<" + std::string(wanted) + ">");
    }
  }
  EXPECT_EQ(compared, 5500);
}

TEST(TextMessage, NumbersHaveTheirUnitLsbAndOffset) {
  EXPECT_EQ(written("{rate_x_deg_per_s:.1f}\\n"), "10.0\n");
  EXPECT_EQ(written("{-rate_y_deg_per_s:+07.2f}\\n"), "+020.00\n");
  EXPECT_EQ(written("{rate_x_deg_per_s:.1f*1/60}\\n"), "600.0\n");
  EXPECT_EQ(written("{temperature_c:d*0.01-40}\\n"), "6550\n");
  EXPECT_EQ(written("{rate_y_deg_per_s:05d}\\n"), "-0020\n");
  EXPECT_EQ(written("{rate_y_deg_per_s: 05d}|{rate_x_deg_per_s: 5d}|\\n"), "-0020|   10|\n");
  EXPECT_EQ(written("{rate_y_deg_per_s:04X} {rate_y_deg_per_s:04x}\\n"), "FFEC ffec\n");
  EXPECT_EQ(written("{rate_y_deg_per_s:.1f}{{}}\\n"), "-20.0{}\n");
}

TEST(TextMessage, SeveralTextsAreForTheValuesFrom0) {
  const auto text_of = [](double temperature_c) {
    Sample sample = text_sample();
    sample.temperature_c = temperature_c;
    return written("{temperature_c:no/a few/many/many},\\n", sample);
  };
  EXPECT_EQ(text_of(-1), "no,\n");
  EXPECT_EQ(text_of(0.4), "no,\n");
  EXPECT_EQ(text_of(0.6), "a few,\n");
  EXPECT_EQ(text_of(2), "many,\n");
  EXPECT_EQ(text_of(99), "many,\n");
  EXPECT_EQ(text_of(std::numeric_limits<double>::quiet_NaN()), "no,\n");
}

TEST(TextMessage, CountersClocksAndTheStatus) {
  EXPECT_EQ(written("{sample_counter:d},{sample_counter:04X},{sample_counter%100:02d}\\n"), "74565,2345,65\n");
  EXPECT_EQ(written("{time_ms:d},{time_s:.6f},{time_us%1000000:06d}\\n"), "1235,1.234568,234568\n");
  EXPECT_EQ(written("{not_valid:V/A}{!not_valid:d}{status:02X}\\n"), "A100\n");
  Sample sample = text_sample();
  sample.status = status::not_valid | status::gyro_saturated_x;
  EXPECT_EQ(written("{not_valid:V/A}{!not_valid:d}{status:03X}\\n", sample), "V0101\n");
}

TEST(TextMessage, AnglesAndTimesOfDay) {
  EXPECT_EQ(written("{latitude_deg:ddmm.mmm},{latitude_deg:N/S},{longitude_deg:dddmm.mmm},{longitude_deg:E/W}\\n"),
            "4830.000,S,00800.000,E\n");  // rounding carries into the degrees
  EXPECT_EQ(written("{longitude_deg:dddmm.mmmmm}\\n"), "00759.99996\n");
  EXPECT_EQ(written("{time_of_day_s:hhmmss.ss} {time_of_day_s:hh:mm:ss} {time_of_day_s:hhmmss}\\n"),
            "160000.25 16:00:00 160000\n");
  EXPECT_EQ(written("{utc_day:02d}{utc_month:02d}{utc_year%100:02d}\\n"), "230825\n");
  EXPECT_EQ(written("{gnss_fix:01d} {gnss_satellites:02d}\\n"), "1 09\n");
  Sample own = text_sample();
  own.solution = Solution{.state = Solution::State::coasting,
                          .since_fix_s = 2.5F,
                          .attitude = {0.001F, 0.002F, 0.004F},
                          .velocity = {0.25F, 0.5F, 1.0F},
                          .position = {2.0F, 4.0F, 8.0F}};
  EXPECT_EQ(written("{navigation_state:d},{fix_age_s:.1f},{attitude_sigma_down_mrad:.1f},"
                    "{velocity_sigma_east_m_per_s:.1f},{position_sigma_north_m:.1f}\\n",
                    own),
            "2,2.5,4.0,0.5,2.0\n");
  Sample aligning = text_sample();  // time and place are the receiver's; the place is left out, where it may be
  aligning.solution.emplace().receiver = std::exchange(aligning.navigation, {});
  EXPECT_EQ(written("{time_of_day_s:hhmmss.ss} {latitude_deg:.1f},{latitude_deg:.1f?}\\n", aligning),
            "160000.25 -48.5,\n");
  const std::string of_receiver = "{gnss_latitude_deg:.1f?},{gnss_satellites:02d?},{latitude_deg:.1f?}\\n";
  EXPECT_EQ(written(of_receiver, aligning), "-48.5,09,\n");
  EXPECT_EQ(written(of_receiver, own), ",,-48.5\n");  // it coasts without a fix
  Sample sample = text_sample();
  sample.navigation.gps_ns += 28'800'000'000'000 - 250'000'001;  // the last nanosecond of the day
  EXPECT_EQ(written("{time_of_day_s:hhmmss.ss} {time_of_day_s:hhmmss} {utc_day:02d}\\n", sample),
            "235959.99 235959 23\n");  // of the same day as the date
  ++sample.navigation.gps_ns;
  EXPECT_EQ(written("{time_of_day_s:hhmmss.ss} {time_of_day_s:hhmmss} {utc_day:02d}\\n", sample),
            "000000.00 000000 24\n");
}

// By sbgECom's manual ROT is "not the IMU gyroscope Z value but rather the true heading derivative".
TEST(TextMessage, TheRateOfTurnIsTheDerivativeOfTheHeading) {
  const std::string rates = "{yaw_rate_deg_per_s:.3f},{rate_z_deg_per_s:.3f}\\n";
  Sample sample = text_sample();
  sample.q_LP = Quaternion(std::sqrt(0.75), 0.5, 0, 0);  // a level turn of 10 deg/s with a roll of 60 deg
  sample.rate = units::degree * Vector3(0, 10 * std::sqrt(0.75), 5);
  EXPECT_EQ(written(rates, sample), "10.000,5.000\n");
  sample.q_LP = Quaternion(0.9659258262890683, 0, 0.25881904510252074, 0);  // a pitch of 30 deg
  sample.rate = units::degree * Vector3(7, -3, 10 * std::sqrt(0.75));
  EXPECT_EQ(written(rates, sample), "10.000,8.660\n");
  sample.q_LP = Quaternion(std::sqrt(0.5), 0, std::sqrt(0.5), 0);  // there is no heading
  EXPECT_EQ(written(rates, sample), "0.000,8.660\n");
}

TEST(TextMessage, AHeadingHasNoModulus) {
  Sample sample = text_sample();
  sample.q_LP = Quaternion(std::cos(-1e-6), 0, 0, std::sin(-1e-6));  // yaw -1.1e-4 deg
  EXPECT_EQ(written("{yaw_deg%360:06.2f} {yaw_deg%360:010.6f}\\n", sample), "000.00 359.999885\n");
}

TEST(TextMessage, LeavesOutWhatIsNotValid) {
  const char* text = "{latitude_deg:ddmm.mm?},{rate_x_deg_per_s:.1f?},{rate_x_deg_per_s:.1f}\\n";
  EXPECT_EQ(written(text), "4830.00,10.0,10.0\n");
  Sample sample = text_sample();
  sample.navigation = {};
  EXPECT_EQ(written(text, sample), ",10.0,10.0\n");
  sample.status = status::not_valid;
  EXPECT_EQ(written(text, sample), ",,10.0\n");
}

TEST(TextMessage, NumbersSaturate) {
  Line line = frame_line(one_text("{rate_x_rad_per_s:f},{rate_y_rad_per_s:d},{rate_z_rad_per_s:02X}\\n"));
  Sample sample;
  sample.rate = Vector3(1e300, -std::numeric_limits<double>::infinity(), 200);
  EXPECT_EQ(line_of(line, sample), "1000000000000000.000000,-1000000000000000,7F\n");
  EXPECT_EQ(line.device->counts()[0], 3U);
  sample.rate = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(line_of(line, sample), "-1000000000000000.000000,-1000000000000000,80\n");
  EXPECT_EQ(line.device->counts()[0], 6U);
}

// NMEA 0183 and the ASCII logs of NovAtel: exclusive or, CRC-32 in lower case, and a sum over a range.
TEST(TextMessage, Checks) {
  EXPECT_EQ(written("$HEHDT,90.00,T*{check:xor8}\\r\\n"), "$HEHDT,90.00,T*26\r\n");  // sbgECom's manual
  EXPECT_EQ(written("$123456789*{check:crc32/iso-hdlc:x}\\n"), "$123456789*cbf43926\n");
  EXPECT_EQ(written("x{@a}123{@b}4{check:sum8:@a..@b}\\n"), "x123496\n");
  EXPECT_EQ(written("x{@a}12{@b}34{@c}56{check:sum16:@a..@b,@c..}\\n"), "x12345600CE\n");
}

TEST(TextMessage, IsDecoded) {
  Line line = frame_line(
      one_text("$IMU,{sample_counter%1000:03d},{time_ms:d},{rate_x_deg_per_s:+.3f},{rate_y_deg_per_s:+.3f},"
               "{rate_z_deg_per_s:+.3f},{specific_force_x_mg:d},{specific_force_y_mg:d},{specific_force_z_mg:d},"
               "{temperature_c:.1f?},{not_valid:V/A}*{check:xor8}\\r\\n"));
  Recording recording;
  const auto feed = [&](std::string_view text) {
    line.decoder->feed({std::as_bytes(std::span(text)), {}}, recording);
  };
  Sample sample = text_sample();
  const std::string good = line_of(line, sample);
  EXPECT_EQ(good, "$IMU,565,1235,+10.000,-20.000,+0.001,0,500,-1000,25.5,A*" + good.substr(good.size() - 4));
  feed(good.substr(0, 20));
  feed(good.substr(20));
  feed("$IMU,garbage\r\n$IM");
  sample.counter += 436;  // begins again
  const std::string second = line_of(line, sample);
  feed(second);
  std::string damaged = second;
  damaged[6] ^= 1;
  feed(damaged);
  sample.status = status::not_valid;
  feed(line_of(line, sample));
  line.decoder->finish(recording);
  ASSERT_EQ(recording.measurements.size(), 3U);
  const Measurement& first = recording.measurements[0];
  constexpr std::uint32_t fields = Measurement::rate | Measurement::specific_force | Measurement::temperature |
                                   Measurement::time | Measurement::counter | Measurement::status;
  EXPECT_EQ(first.fields, fields);
  EXPECT_EQ(first.sample.counter, 565U);
  EXPECT_EQ(first.sample.time.ns, 1'235'000'000);
  EXPECT_TRUE(first.sample.rate.isApprox(text_sample().rate, 1e-9));
  EXPECT_TRUE(first.sample.specific_force.isApprox(text_sample().specific_force, 1e-9));
  EXPECT_EQ(first.sample.temperature_c, 25.5);
  EXPECT_EQ(recording.measurements[1].sample.counter, 1001U);
  EXPECT_EQ(recording.measurements[2].sample.status, status::not_valid);
  EXPECT_EQ(recording.measurements[2].fields, fields & ~Measurement::temperature);
  EXPECT_EQ(line.decoder->errors().checksum, 1U);
  EXPECT_EQ(line.decoder->errors().skipped_bytes, 14U + 3U + damaged.size());
}

// Numbers of a width that zeros fill stand side by side, as in TSS1.
TEST(TextMessage, DigitsSideBySideAreDecoded) {
  Line line = frame_line(one_text(":{rate_x_deg_per_s:02X}{rate_y_deg_per_s:04X} {rate_z_deg_per_s: 05d}H\\r\\n"));
  Recording recording;
  Sample sample = text_sample();
  sample.rate.z() = -16 * units::degree;
  const std::string text = line_of(line, sample);
  EXPECT_EQ(text, ":0AFFEC -0016H\r\n");
  line.decoder->feed({std::as_bytes(std::span(text)), {}}, recording);
  ASSERT_EQ(recording.measurements.size(), 1U);
  EXPECT_TRUE(recording.measurements[0].sample.rate.isApprox(sample.rate, 1e-9));
}

TEST(TextMessage, WhatIsLeftOutSideBySideIsDecoded) {
  Line line = frame_line(one_text("D{utc_day:02d?}{utc_month:02d?},{rate_x_deg_per_s:.1f}\\n"));
  Recording recording;
  Sample sample = text_sample();
  const std::string with = line_of(line, sample);
  sample.navigation = {};
  const std::string without = line_of(line, sample);
  EXPECT_EQ(with + without, "D2308,10.0\nD,10.0\n");
  for (const std::string& text : {with, without}) line.decoder->feed({std::as_bytes(std::span(text)), {}}, recording);
  EXPECT_EQ(recording.measurements.size(), 2U);
}

TEST(TextMessage, RandomBytesHarmNothing) {
  std::mt19937_64 random(5);
  Line line = frame_line(one_text("$A,{rate_x_deg_per_s:.3f},{not_valid:no/yes},{time_ms:d?}*{check:xor8}\\n"));
  const std::string good = line_of(line, text_sample());
  Recording recording(50'000);
  const std::uint64_t before = allocations();
  int fed = 0;
  for (; fed < 20'000; ++fed) {
    std::array<char, 24> text{};
    std::copy_n(good.begin(), std::min(good.size(), text.size()), text.begin());
    for (int k = 0; k < 2; ++k) text[random() % text.size()] = static_cast<char>(random());
    line.decoder->feed({std::as_bytes(std::span(text).first(1 + random() % text.size())), {}}, recording);
  }
  EXPECT_EQ(allocations() - before, 0U);
  EXPECT_EQ(fed, 20'000);
  line.decoder->feed({std::as_bytes(std::span(good)), {}}, recording);
  const std::size_t found = recording.measurements.size();
  line.decoder->feed({std::as_bytes(std::span(good)), {}}, recording);
  EXPECT_EQ(recording.measurements.size(), found + 1);
}

TEST(TextMessage, ATestFrameIsItsText) {
  const std::string text = "$A,{rate_x_deg_per_s:.1f},{yaw_deg:.1f?}*{check:xor8}\\r\\n";
  EXPECT_EQ(faults_of(one_text(text, "test_frame = \"$A,10.0,*5E\\r\\n\"\ntest_values = {rate_x_deg_per_s = 10}")),
            "");
  EXPECT_EQ(faults_of(one_text(text, "test_frame = \"$A,10.5,*6A\\r\\n\"\ntest_values = {rate_x_deg_per_s = 10}")),
            "test.toml:6: message \"m\": test_frame: differs at character 6, in \"rate_x_deg_per_s:.1f\": it has "
            "\"10.5\", test_values give \"10.0\"");
  EXPECT_TRUE(contains(faults_of(one_text(text, "test_frame = \"$A\"\ntest_values = {rate_y_deg_per_s = 1}")),
                       "the message does not carry it; its fields are rate_x_deg_per_s, yaw_deg"));
}

TEST(TextMessage, RefusesWhatCannotBe) {
  const std::pair<const char*, const char*> cases[] = {
      {"", "give the line, with numbers in braces"},
      {"A{rate_x_deg_per_s}", "{rate_x_deg_per_s}: a number is given as {QUANTITY_UNIT:FORMAT}"},
      {"A{rate_x_deg_per_s:q}\\n", "\"q\" is no format; give one like 6.2f"},
      {"A{rate_x_deg_per_s:}\\n", "is no format"},
      {"A{rate_x_dps:f}\\n", "there is no quantity \"rate_x_dps\""},
      {"A{rate_x_deg_per_s:f\\n", "a brace that is sent is written twice"},
      {"A}\\n", "a brace that is sent is written twice"},
      {"A{rate_x_deg_per_s:99f}\\n", "at most 32 characters and 15 decimals"},
      {"A{rate_x_deg_per_s:.16f}\\n", "at most 32 characters and 15 decimals"},
      {"A{rate_x_deg_per_s:.2d}\\n", "an integer has no decimals"},
      {"A{rate_x_deg_per_s:X}\\n", "hexadecimal digits are given by their number"},
      {"A{rate_x_deg_per_s:17X}\\n", "hexadecimal digits are given by their number"},
      {"A{rate_x_deg_per_s:f*0}\\n", "the LSB after * must not be 0"},
      {"A{rate_x_deg_per_s:fx}\\n", "what follows the format must be ?, *LSB or +OFFSET"},
      {"A{rate_x_deg_per_s:hhmmss}\\n", "hhmmss is of a time"},
      {"A{time_of_day_s:ddmm}\\n", "ddmm is of an angle"},
      {"A{time_of_day_s:hhmmss.}\\n", "after the point of a pattern come 1 to 9 decimals"},
      {"A{sample_counter:f}\\n", "a counter or the status is written as d or X"},
      {"A{!rate_x_deg_per_s:f}\\n", "only a bit of the status has an inverse"},
      {"A{not_valid:A/}\\n", "a choice is two texts"},
      {"A{not_valid:A/AB}\\n", "a choice is two texts"},
      {"A{gnss_fix:A/B/AB}\\n", "or up to 8 texts for the values 0, 1, 2"},
      {"A{gnss_fix:A/B/}\\n", "or up to 8 texts"},
      {"A{gnss_fix:1/2/3/4/5/6/7/8/9}\\n", "or up to 8 texts"},
      {"A{gnss_fix:1/0*2}\\n", "a choice of texts has no LSB"},
      {"A{gnss_fix:1/2/0*2}\\n", "a choice of texts has no LSB"},
      {"A{gnss_fix:1/0?*2}\\n", "a choice of texts has no LSB"},
      {"A{rate_x_deg_per_s:f}",
       "a decoder cannot find the end of {rate_x_deg_per_s:f}: let a character follow, such"},
      {"A{rate_x_deg_per_s:f}{rate_y_deg_per_s:f}\\n", "fill it up with zeros, as in 08.3f"},
      {"A{rate_x_deg_per_s:f} B\\n", "let a character follow that no number has"},
      {"A{utc_day:02d?}{utc_month:02d}\\n", "a decoder cannot find the end of {utc_day:02d?}"},
      {"{sample_counter:08X}", "give at least one constant character"},
      {"A{check:xor8}\\n", "give the range, as in {check:sum8:@begin..}"},
      {"A{@a}B{check:xor9:@a..}\\n", "there is no check \"xor9\""},
      {"A{@a}B{check:xor8:@b..}\\n", "there is no label {@b}"},
      {"A{@a}B{check:xor8:@a..@}\\n", "the range must end before the check"},
      {"A{@a}B{check:sum16/16:@a..}\\n", "a check of text is of bytes, not of words"},
      {"A{@a}B{@a}\\n", "the label {@a} is given twice"},
      {"A{time_ms%100:d+1}\\n", "a clock with a modulus has an LSB of whole nanoseconds and no offset"},
  };
  for (const auto& [text, wanted] : cases)
    EXPECT_TRUE(contains(faults_of(one_text(text)), wanted)) << faults_of(one_text(text));
  EXPECT_TRUE(
      contains(faults_of(one_text("A\\n", "layout = [\"AA\"]")), "give either this, for a line of text, or layout"));
}

}  // namespace
}  // namespace imud
