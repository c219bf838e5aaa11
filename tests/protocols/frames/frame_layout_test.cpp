// The elements of a frame, by the bytes that a manual would give.
#include <cmath>
#include <limits>

#include "core/units.hpp"
#include "tests/protocols/frames/frame_unit.hpp"

namespace imud {
namespace {

Sample example_sample() {
  Sample sample;
  sample.time.ns = 1'000'600'000;
  sample.counter = 0x12345;
  sample.rate = Vector3(10, -20, 30) * units::degree;
  sample.specific_force = Vector3(0, 0.5, -1) * units::standard_gravity;
  sample.temperature_c = 25;
  sample.status = status::gyro_saturated_x << 1;
  return sample;
}

std::vector<std::byte> encoded(std::string_view elements, std::string_view more = "") {
  Line line = frame_line(one_message(elements, more));
  return bytes_of(line, example_sample());
}

TEST(FrameLayout, NumbersHaveTheirTypeOrderAndLsb) {
  EXPECT_EQ(encoded("A5\nrate_x_deg_per_s:i16*0.01"), hex_bytes("A5 E8 03"));
  EXPECT_EQ(encoded("A5\nrate_x_deg_per_s:i16*0.01 be"), hex_bytes("A5 03 E8"));
  EXPECT_EQ(encoded("A5\nrate_x_deg_per_s:i16*0.01", "byte_order = \"big\""), hex_bytes("A5 03 E8"));
  EXPECT_EQ(encoded("A5\nrate_x_deg_per_s:i16*0.01 le", "byte_order = \"big\""), hex_bytes("A5 E8 03"));
  EXPECT_EQ(encoded("A5\nrate_y_deg_per_s:i24*1/1000"), hex_bytes("A5 E0 B1 FF"));
  EXPECT_EQ(encoded("A5\n-rate_y_deg_per_s:u24*2^-8 be"), hex_bytes("A5 00 14 00"));
  EXPECT_EQ(encoded("A5\nspecific_force_z_g:f32 be"), hex_bytes("A5 BF 80 00 00"));
  EXPECT_EQ(encoded("A5\nspecific_force_y_g:f64"), hex_bytes("A5 00 00 00 00 00 00 E0 3F"));
  EXPECT_EQ(encoded("A5\ntemperature_c:i16*0.008+20 be"), hex_bytes("A5 02 71"));
  EXPECT_EQ(encoded("A5\ntemperature_c:u8-40"), hex_bytes("A5 41"));
  EXPECT_EQ(encoded("A5\ntemperature_k:u16*0.01"), hex_bytes("A5 77 74"));
  EXPECT_EQ(encoded("A5\nspecific_force_z_ug:i64 be"), hex_bytes("A5 FF FF FF FF FF F0 BD C0"));
}

TEST(FrameLayout, NumbersAreRoundedAndSaturate) {
  EXPECT_EQ(encoded("A5\nrate_x_deg_per_s:i8*4"), hex_bytes("A5 03"));  // 2.5, away from zero
  EXPECT_EQ(encoded("A5\nrate_z_deg_per_s:i8*0.1"), hex_bytes("A5 7F"));
  EXPECT_EQ(encoded("A5\nrate_y_deg_per_s:u16"), hex_bytes("A5 00 00"));
  Line line = frame_line(one_message("A5\nrate_z_deg_per_s:i8*0.1\nrate_y_deg_per_s:u16\nrate_x_deg_per_s:i8"));
  Sample sample = example_sample();
  bytes_of(line, sample);
  EXPECT_EQ(line.device->counts()[0], 2U);
  sample.rate.z() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(bytes_of(line, sample)[1], std::byte{0x80});
  sample.rate.z() = -std::numeric_limits<double>::infinity();
  EXPECT_EQ(bytes_of(line, sample)[1], std::byte{0x80});
}

TEST(FrameLayout, BitsCountersAndTheStatus) {
  EXPECT_EQ(encoded("A5\nbits:u8:0-1=2,3=gyro_saturated,4=!gyro_saturated,5=gyro_saturated_x,7=!not_valid"),
            hex_bytes("A5 8A"));
  EXPECT_EQ(encoded("A5\nbits:u16:0-3=sample_counter,8-11=sample_counter%7,15=1 be"), hex_bytes("A5 81 05"));
  EXPECT_EQ(encoded("A5\nsample_counter:u16\nsample_counter%128:u8\nstatus:u8"), hex_bytes("A5 45 23 45 02"));
  EXPECT_EQ(encoded("A5\nbits:u8:0-3=0xF,4-7=alive_counter"), hex_bytes("A5 0F"));
}

// A quantity is a bit by its sign, or by a limit in its unit.
TEST(FrameLayout, QuantitiesAreBits) {
  const auto bits = [](std::string_view text, double temperature_c) {
    Line line = frame_line(one_message("A5\nbits:u8:" + std::string(text)));
    Sample sample;
    sample.rate.x() = -2 * units::degree;
    sample.temperature_c = temperature_c;
    return bytes_of(line, sample)[1];
  };
  EXPECT_EQ(bits("0=rate_x_deg_per_s,1=-rate_x_deg_per_s,2=!rate_x_deg_per_s,3=rate_y_deg_per_s", 0),
            std::byte{0x06});
  EXPECT_EQ(
      bits("0=rate_x_deg_per_s<-1.9,1=rate_x_deg_per_s<-2.1,2=!rate_x_deg_per_s<-2.1,3=-rate_x_deg_per_s<2.1", 0),
      std::byte{0x0D});
  EXPECT_EQ(bits("0=temperature_c,1=temperature_c<20", 19), std::byte{0x03});
  EXPECT_EQ(bits("0=temperature_c,1=temperature_c<20", 21), std::byte{0x01});
  EXPECT_EQ(bits("0=temperature_c,1=temperature_c<20", -1), std::byte{0x02});
  EXPECT_EQ(bits("0=temperature_c,1=!temperature_c<20", std::numeric_limits<double>::quiet_NaN()), std::byte{0x02});
}

TEST(FrameLayout, TimesWrapByTypeOrModulus) {
  EXPECT_EQ(encoded("A5\ntime_ms:u16"), hex_bytes("A5 E9 03"));  // 1000.6
  EXPECT_EQ(encoded("A5\ntime_us:u16"), hex_bytes("A5 98 44"));
  EXPECT_EQ(encoded("A5\ntime_s:u32*1/62500"), hex_bytes("A5 4A F4 00 00"));
  EXPECT_EQ(encoded("A5\ntime_ms%1000:u16"), hex_bytes("A5 01 00"));
  EXPECT_EQ(encoded("A5\ntime_s:f32 be"), hex_bytes("A5 3F 80 13 A9"));
}

// Seconds and the rest in fields of their own.
TEST(FrameLayout, NumbersAreRoundedDown) {
  EXPECT_EQ(encoded("A5\ntime_s:u8 floor\ntime_us%1000000:u24 be floor"), hex_bytes("A5 01 00 02 58"));
  EXPECT_EQ(encoded("A5\nrate_y_deg_per_s:i8*3 floor\nrate_x_deg_per_s:i8*4 floor"), hex_bytes("A5 F9 02"));
  Line line = frame_line(one_message("A5\ntime_of_day_s:u32 be floor\ntime_of_day_ms%1000:u16 be floor"));
  Sample sample = example_sample();
  int compared = 0;
  for (std::int64_t ns = 0; ns < 3'000'000'000; ns += 1'000'001, ++compared) {
    sample.navigation = {.is_known = true, .gps_ns = 1'440'000'018'000'000'000 + ns};
    const std::vector<std::byte> bytes = bytes_of(line, sample);
    const auto seconds = static_cast<std::uint32_t>(57'600 + ns / 1'000'000'000);
    const auto rest = static_cast<std::uint32_t>(ns / 1'000'000 % 1000);
    ASSERT_EQ(bytes[4], static_cast<std::byte>(seconds)) << ns;
    ASSERT_EQ(bytes[5], static_cast<std::byte>(rest >> 8)) << ns;
    ASSERT_EQ(bytes[6], static_cast<std::byte>(rest)) << ns;
  }
  EXPECT_EQ(compared, 3000);
}

TEST(FrameLayout, AHeadingHasNoModulus) {
  Line line = frame_line(one_message("A5\nyaw_deg%360:u16*0.01 be"));
  Sample sample;
  const auto heading = [&](double deg) {
    sample.q_LP = Quaternion(Eigen::AngleAxisd(deg * units::degree, Vector3::UnitZ()));
    const auto bytes = bytes_of(line, sample);
    return std::to_integer<int>(bytes[1]) << 8 | std::to_integer<int>(bytes[2]);
  };
  EXPECT_EQ(heading(-90), 27000);
  EXPECT_EQ(heading(179), 17900);
  EXPECT_EQ(heading(-0.001), 0);
}

TEST(FrameLayout, LengthsChecksAndPadding) {
  EXPECT_EQ(encoded("A5\nlength:u16:@a..@+4\n@a\n01 02 03\npad:4"), hex_bytes("A5 09 00 01 02 03 00 00"));
  EXPECT_EQ(encoded("A5\nlength:u8/2:@a..@b\n@a\n01 02 03 04\n@b\n_:2"), hex_bytes("A5 02 01 02 03 04 00 00"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:sum8:@a.."), hex_bytes("01 02 03 FF 05"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:-sum8:@a.."), hex_bytes("01 02 03 FF FB"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:~sum16:@a.. be"), hex_bytes("01 02 03 FF FE FA"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:sum16/16:@a.. be"), hex_bytes("01 02 03 FF 05 01"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:sum32/16:@a.."), hex_bytes("01 02 03 FF 04 01 01 00"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:xor8:@a.."), hex_bytes("01 02 03 FF FF"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:xor16:@a.. be"), hex_bytes("01 02 03 FF 02 FD"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:fletcher8:@a.."), hex_bytes("01 02 03 FF 05 0F"));
  EXPECT_EQ(encoded("@a\n01 02 03 FF\ncheck:fletcher8:@a.. be"), hex_bytes("01 02 03 FF 05 0F"));
  EXPECT_EQ(encoded("@a\n\"123456789\"\ncheck:crc16/xmodem:@a.. be"), hex_bytes("31 32 33 34 35 36 37 38 39 31 C3"));
  EXPECT_EQ(encoded("@a\n\"12345\"\n@b\n\"678\"\ncheck:CRC-16/XMODEM:@a..@b,@b..:+39 be"),
            hex_bytes("31 32 33 34 35 36 37 38 31 C3"));
}

// Bytes that a real unit may change: sent as they stand, in the range of a check, and decoded as any.
TEST(FrameLayout, UnusedBytesMayBeSentAsGiven) {
  const std::string elements = "@a\nA5 5A\n_=12 FF\n_:1\nalive_counter:u8\ncheck:sum8:@a..";
  EXPECT_EQ(encoded(elements), hex_bytes("A5 5A 12 FF 00 00 10"));
  EXPECT_EQ(
      faults_of(one_message(elements, "test_frame = \"A5 5A 34 00 07 03 3D\"\ntest_values = {alive_counter = 3}")),
      "");
  const auto description = frames_of_text(one_message(elements), "test.toml");
  const auto messages = frame_messages(*description);
  EXPECT_EQ(messages[0].layout->match(hex_bytes("A5 5A 34 00 07 03 3D")).match, MessageLayout::Match::yes);
  EXPECT_EQ(messages[0].layout->rows().at(1).name, "12 FF");
}

TEST(FrameLayout, AFileDescribesItsOwnCrc) {
  Line line = frame_line(one_message("@a\n\"123456789\"\ncheck:mine:@a..") +
                         "[check.mine]\nwidth = 16\npoly = 0x1021\ninit = 0x1D0F\n");
  EXPECT_EQ(bytes_of(line, {}), hex_bytes("31 32 33 34 35 36 37 38 39 CC E5"));
}

// A check over a header that contains the check of the data, which follows it (ANPP).
TEST(FrameLayout, ChecksAreComputedInTheOrderOfTheirRanges) {
  EXPECT_EQ(encoded("check:-sum8:@a..@b\n@a\n1C\ncheck:crc16/ibm-3740:@b..@\n@b\n01 02"),
            hex_bytes("5A 1C 7C 0E 01 02"));
}

// The remainders of increments are sent later: the sum of what is sent is the sum of the increments.
TEST(FrameLayout, ARemainderIsCarried) {
  Line line = frame_line(one_message("A5\ndelta_angle_x_rad:i16*2^-10 carry\ndelta_angle_x_rad:i16*2^-10"));
  Sample sample;
  sample.delta_angle.x() = 0.3 * 0x1p-10;
  int carried = 0, rounded = 0;
  for (int k = 0; k < 1000; ++k) {
    const auto bytes = bytes_of(line, sample);
    carried += static_cast<std::int8_t>(bytes[1]);
    rounded += static_cast<std::int8_t>(bytes[3]);
    ++sample.counter;
    sample.time = sample.time + std::chrono::milliseconds(1);
  }
  EXPECT_NEAR(carried, 300, 1);
  EXPECT_EQ(rounded, 0);
}

TEST(FrameLayout, RowsAreAManualsTable) {
  const auto description = frames_of_text(
      one_message("@a\nAA 55\n-rate_x_deg_per_s:i16*1/2 be\n_:2\ncheck:crc16/xmodem:@a..:+01\nlength:u8:@a..@+1"),
      "test.toml");
  const std::vector<FrameMessage> messages = frame_messages(*description);
  std::string text;
  for (const MessageLayout::Row& row : messages[0].layout->rows())
    text += std::to_string(row.offset.value_or(0)) + "|" + std::to_string(row.size) + "|" + row.type + "|" + row.lsb +
            "|" + row.unit + "|" + row.name + "\n";
  EXPECT_EQ(text,
            "0|2|constant|||AA 55\n"
            "2|2|i16 be|0.5|deg_per_s|-rate_x\n"
            "4|2|unused|||0\n"
            "6|2|u16 le|||check crc16/xmodem of 0-5, then of 01\n"
            "8|1|u8|||length of 0-8, + 1\n");
}

}  // namespace
}  // namespace imud
