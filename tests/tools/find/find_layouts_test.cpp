// Layouts of frames that are found only with care: several checks, terminators, messages of one length.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/text.hpp"
#include "tests/tools/find/find_unit.hpp"
#include "tools/find/found_description.hpp"
#include "tools/find/frame_finder.hpp"
#include "tools/find/header_checks.hpp"
#include "tools/find/message_types.hpp"

namespace imud {
namespace {

// FDILink, as the Wheeltec N100 has it: FC, type, length, sequence, CRC-8 of these four, CRC-16 of the data in big
// endian, data, FD (sbgisen/fdilink_ahrs at d61c953f, src/ahrs_driver.cpp; the polynomials by the tables in
// cutespider-lzz/FlightControler-Rocket at 909a2057, HardWare/FDILink/CRC_Table.c).
constexpr std::string_view fdilink_imu =
    "@h\nFC\n40\nlength:u8:@p..@q\nframe_counter:u8\ncheck:crc8/maxim-dow:@h..\ncheck:crc16/xmodem:@p..@q be\n@p\n"
    "rate_x_rad_per_s:f32\nrate_y_rad_per_s:f32\nrate_z_rad_per_s:f32\nspecific_force_x_m_per_s2:f32\n"
    "specific_force_y_m_per_s2:f32\nspecific_force_z_m_per_s2:f32\nmagnetic_field_x_mgauss:f32\n"
    "magnetic_field_y_mgauss:f32\nmagnetic_field_z_mgauss:f32\ntemperature_c:f32\npressure_pa:f32\ntemperature_c:"
    "f32\n"
    "time_us:u64\n@q\nFD";

// LpBus, as LP-Research's LPMS has it: 3A, sensor, command 9, length, data, a sum of all but 3A, 0D 0A
// (al3Co/LPMS-IMUsensors at dd836a05, lpms.m); its clock counts 2.5 ms.
constexpr std::string_view lpms_data =
    "3A\n@a\n01 00\n09 00\nlength:u16:@p..@q\n@p\ntime_ns:u32*2500000\nrate_x_rad_per_s:f32\nrate_y_rad_per_s:f32\n"
    "rate_z_rad_per_s:f32\nspecific_force_x_g:f32\nspecific_force_y_g:f32\nspecific_force_z_g:f32\n@q\n"
    "check:sum16:@a..@q\n0D 0A";

Capture layout_capture(std::string_view elements, std::size_t count, Handling handling = Handling::turned) {
  Line line = frame_line(one_message(elements));
  return capture_of(line, handled_samples(handling, count, 100));
}

void expect_begins(const FoundFrames& found, const Capture& capture, std::size_t lost = 0) {
  for (const FoundMessage& message : found.messages)
    for (const FrameSplit::Place& frame : message.frames)
      ASSERT_TRUE(std::ranges::binary_search(capture.begins, frame.at + lost)) << frame.at;
}

// After 16.8 s the fourth byte of the time is no longer 0, which makes a run of zeros shorter.
TEST(FindLayouts, FramesStayWhereTheyAreWhenAHighByteBeginsToChange) {
  const Capture capture = layout_capture(fdilink_imu, 3000);
  const auto found = find_frames(capture.bytes);
  ASSERT_TRUE(found);
  ASSERT_EQ(found->messages.size(), 1U);
  EXPECT_EQ(found->messages[0].length, 64U);
  EXPECT_GT(found->coverage, 0.999);
  expect_begins(*found, capture);
}

// Wherever the capture begins, 0D 0A end a frame, and do not begin one.
TEST(FindLayouts, TerminatorsEndFrames) {
  constexpr std::string_view others[] = {
      "80\n@a\nFE 00\nrate_x_deg_per_s:i16*1/66 be\nrate_y_deg_per_s:i16*1/66 be\nsample_counter:u16 be\n"
      "check:sum16/16:@a.. be\n0D",
      "02\n@a\n00 40\nalive_counter:u8\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32\ncheck:sum8:@a..\n03",
      "3A\n@a\nalive_counter:u8\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32\ncheck:crc16/xmodem:@a..\n0A",
  };
  std::vector<std::string_view> all(std::begin(others), std::end(others));
  all.push_back(lpms_data);
  for (const std::string_view layout : all)
    for (const Handling handling : {Handling::rest, Handling::turned}) {
      SCOPED_TRACE(layout);
      Capture capture = layout_capture(layout, 300, handling);
      const std::size_t length = capture.begins[1];
      for (const std::size_t lost : {std::size_t{0}, std::size_t{5}, length - 3, length - 2, length - 1}) {
        SCOPED_TRACE(lost);
        const std::vector<std::byte> bytes(capture.bytes.begin() + static_cast<std::ptrdiff_t>(lost),
                                           capture.bytes.end());
        const auto found = find_frames(bytes);
        ASSERT_TRUE(found);
        ASSERT_EQ(found->messages.size(), 1U);
        expect_begins(*found, capture, lost);
      }
    }
}

// A constant byte between check and data is the header, and can be the end; the capture's first byte decides.
TEST(FindLayouts, OneByteIsHeaderOrTerminator) {
  constexpr std::string_view data =
      "@a\nalive_counter:u8\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32\ncheck:crc16/xmodem:@a..\n";
  const Capture headed = layout_capture("ED\n" + std::string(data), 600);
  const auto found = find_frames(headed.bytes);
  ASSERT_TRUE(found);
  expect_begins(*found, headed);
  // With a header of its own, ED is the end.
  const Capture both = layout_capture("A7 51\n" + std::string(data) + "ED", 600);
  const auto other = find_frames(both.bytes);
  ASSERT_TRUE(other);
  expect_begins(*other, both);
  ASSERT_EQ(other->messages.size(), 1U);
  EXPECT_EQ(other->messages[0].length, 14U);
  // In the middle of a frame nothing decides, and both are named.
  const std::vector<std::byte> cut(both.bytes.begin() + 6, both.bytes.end());
  const auto open = find_frames(cut);
  ASSERT_TRUE(open);
  EXPECT_FALSE(open->other_begins.empty());
}

std::string check_text(const FoundCheck& check) {
  std::string text = fmt::format("{} at {} of", check.forms.front().name, check.at);
  for (const auto& [begin, end] : check.ranges_of(check.forms.front()))
    if (begin != end) text += fmt::format(" {}-{}", begin, end - 1);
  return text;
}

// The header has a check of its own, in which the sequence alone changes, and the length counts the data.
TEST(FindLayouts, HeadersHaveChecksOfTheirOwn) {
  for (const bool is_damaged : {false, true}) {
    const Capture capture = layout_capture(fdilink_imu, 1000);
    const auto found = find_frames(is_damaged ? damaged(capture, 25) : capture.bytes);
    ASSERT_TRUE(found);
    ASSERT_EQ(found->messages.size(), 1U);
    const FoundMessage& message = found->messages[0];
    ASSERT_EQ(message.checks.size(), 2U);
    EXPECT_EQ(check_text(message.checks[0]), "crc8/maxim-dow at 4 of 0-3");
    EXPECT_EQ(check_text(message.checks[1]), "crc16/xmodem at 5 of 7-62");
    ASSERT_TRUE(message.length_field);
    EXPECT_EQ(message.length_field->at, 2U);
    EXPECT_EQ(message.length_field->from, 7U);
    EXPECT_EQ(message.length_field->to, 63U);
  }
}

// A type that is as large as the frame is long is not taken for the length, which counts the bytes behind it.
TEST(FindLayouts, LengthsCountTheBytesBehindThem) {
  struct Wanted {
    std::string_view layout;
    std::size_t at, from, to;
  };
  for (const auto& [layout, at, from, to] :
       {Wanted{lpms_data, 5, 7, 35},
        Wanted{"FA\n@a\nFF "
               "15\nlength:u8:@p..@q\n@p\nsample_counter:u16\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32\nrate_z_deg_"
               "per_s:f32\n_:2\n@q\ncheck:-sum8:@a..@q",
               3, 4, 20},
        Wanted{"02\n@a\n00 "
               "40\nlength:u8:@p..@q\n@p\nalive_counter:u8\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32\n@q\ncheck:"
               "sum8:@a..@q\n03",
               3, 4, 13}}) {
    SCOPED_TRACE(layout);
    const auto found = find_frames(layout_capture(layout, 600).bytes);
    ASSERT_TRUE(found);
    ASSERT_EQ(found->messages.size(), 1U);
    const auto& length = found->messages[0].length_field;
    ASSERT_TRUE(length);
    EXPECT_EQ(length->at, at);
    EXPECT_EQ(length->from, from);
    EXPECT_EQ(length->to, to);
  }
}

// Bytes at random, counters and copies of them in a header are no check.
TEST(FindLayouts, FindsNoHeaderChecksInRandomBytes) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937_64 random(seed);
    FoundMessage message;
    message.length = 24;
    const std::size_t count = seed % 2 == 0 ? 40 : 1000;
    std::vector<std::byte> stream = random_bytes(message.length * count, random);
    for (std::size_t k = 0; k < count; ++k) {
      message.frames.push_back({k * message.length, k > 0});
      const std::size_t at = k * message.length;
      stream[at] = std::byte{0x5A};
      stream[at + 1] = static_cast<std::byte>(k);  // a counter, its copy, its complement, one twice as fast,
      stream[at + 2] = static_cast<std::byte>(k);  // and one of four values
      stream[at + 3] = static_cast<std::byte>(~k);
      stream[at + 4] = static_cast<std::byte>(2 * k);
      stream[at + 5] = static_cast<std::byte>(k % 4);
    }
    EXPECT_TRUE(find_header_checks(message, stream).empty()) << seed;
  }
}

const FoundCounter* clock_at(const FoundFrames& found, std::size_t at) {
  for (const FoundCounter& one : found.messages.front().counters)
    if (one.at == at) return &one;
  return nullptr;
}

// The period of 10 ms is no whole number of ticks of 4 ms or 3 ms: the steps are of two values.
TEST(FindLayouts, ClocksMayStepUnevenly) {
  for (const auto& [unit, step] : {std::pair(4'000'000, 2.5), std::pair(3'000'000, 10 / 3.0),
                                   std::pair(8'000'000, 1.25), std::pair(2'000'000, 5.0)}) {
    SCOPED_TRACE(unit);
    const Capture capture =
        layout_capture("3A\n@a\n01 00\ntime_ns:u32*" + std::to_string(unit) +
                           "\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32\ncheck:sum16:@a..\n0D 0A",
                       1000);
    const auto found = find_frames(capture.bytes);
    ASSERT_TRUE(found);
    const FoundCounter* clock = clock_at(*found, 3);
    ASSERT_NE(clock, nullptr);
    EXPECT_EQ(clock->size, 4U);
    EXPECT_NEAR(clock->step, step, 2e-3 * step);
    DescriptionText text{"test", 100};
    EXPECT_TRUE(contains(describe_frames(*found, capture.bytes, text), fmt::format("\"time_ns:u32*{} le\"", unit)) ||
                unit == 3'000'000);
  }
}

// The low bytes of a time before constant bytes, read as a float, rise nearly evenly.
TEST(FindLayouts, LowBytesOfIntegersAreNoFloatClocks) {
  const Capture capture = layout_capture(
      "AA 44\n@a\n13 4C "
      "09\ngps_time_of_week_ms:u32\nrate_x_deg_per_s:f32\nrate_y_deg_per_s:f32\ncheck:crc16/xmodem:@a..",
      1500);
  const auto found = find_frames(capture.bytes);
  ASSERT_TRUE(found);
  for (const FoundCounter& one : found->messages.front().counters) EXPECT_FALSE(one.is_float) << one.at;
  EXPECT_NE(clock_at(*found, 5), nullptr);
}

// MAVLink's check is also of a byte that is not sent, and of which each message has its own.
TEST(FindLayouts, ChecksHaveAByteThatIsNotSent) {
  const auto found = find_frames(shipped_capture("mavlink-imu", Handling::turned, 1000).bytes);
  ASSERT_TRUE(found);
  ASSERT_EQ(found->messages.size(), 2U);
  constexpr std::byte extra[] = {std::byte{0xF6}, std::byte{0x5D}};
  for (std::size_t m = 0; m < 2; ++m) {
    const FoundMessage& message = found->messages[m];
    EXPECT_EQ(message.length, m == 0 ? 44U : 74U);
    ASSERT_EQ(message.checks.size(), 1U);
    EXPECT_EQ(check_text(message.checks[0]), m == 0 ? "crc16/mcrf4xx at 42 of 1-41" : "crc16/mcrf4xx at 72 of 1-71");
    EXPECT_EQ(message.checks[0].forms.front().extra, std::vector{extra[m]});
  }
}

// The first word of a sum begins with a constant byte, and its second byte varies.
TEST(FindLayouts, WordsMayBeginWithConstantBytes) {
  const auto found = find_frames(layout_capture("80\n@a\nFE 00 03\nalive_counter:u8\nrate_x_deg_per_s:i16*0.01 "
                                                "be\nrate_y_deg_per_s:i16*0.01 be\ncheck:sum16/16:@a.. be\n0D",
                                                600)
                                     .bytes);
  ASSERT_TRUE(found);
  ASSERT_EQ(found->messages.size(), 1U);
  ASSERT_EQ(found->messages[0].checks.size(), 1U);
  EXPECT_EQ(check_text(found->messages[0].checks[0]), "sum16/16 at 9 of 1-8");
}

// Four messages 55 51 to 55 54 of 11 bytes.
TEST(FindLayouts, MessagesOfOneLengthHaveTypes) {
  for (const Handling handling : {Handling::rest, Handling::turned}) {
    const Capture capture = shipped_capture("witmotion", handling, 1000);
    for (const bool is_damaged : {false, true}) {
      const auto found = find_frames(is_damaged ? damaged(capture, 25) : capture.bytes);
      ASSERT_TRUE(found);
      ASSERT_EQ(found->messages.size(), 4U);
      for (std::size_t m = 0; m < 4; ++m) {
        const FoundMessage& message = found->messages[m];
        EXPECT_EQ(message.length, 11U);
        ASSERT_EQ(message.header, 2U);
        EXPECT_EQ(message.usual[1], static_cast<std::byte>(0x51 + m));
        ASSERT_EQ(message.checks.size(), 1U);
        EXPECT_EQ(message.checks[0].at, 10U);
        EXPECT_TRUE(message.counters.empty());
      }
      EXPECT_GE(found->messages[3].frames.size(), is_damaged ? 80U : 99U);
    }
  }
}

// Counters of few values, bits that toggle, and high bytes are no types.
TEST(FindLayouts, CountersAndBitsAreNoTypes) {
  for (const char* byte : {"sample_counter%4:u8", "frame_counter%12:u8", "specific_force_x_g:i8", "temperature_c:u8",
                           "bits:u8:0=sample_counter,4=!not_valid"})
    for (const Handling handling : {Handling::rest, Handling::turned}) {
      SCOPED_TRACE(byte);
      const Capture capture = layout_capture("55 AA\n@a\n" + std::string(byte) +
                                                 "\nrate_x_deg_per_s:i16*0.01\nrate_y_deg_per_s:i16*0.01\nspecific_"
                                                 "force_x_mg:i16\nspecific_force_y_mg:i16\ncheck:sum8:@a..",
                                             1000, handling);
      const auto found = find_frames(capture.bytes);
      ASSERT_TRUE(found);
      EXPECT_EQ(found->messages.size(), 1U);
    }
}

// No random byte beside small counters is a type. The threshold is five standard deviations of what random bytes
// give: a false alarm has the probability 3e-7 for each byte that is compared.
TEST(FindLayouts, FindsNoTypesInRandomBytes) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    std::mt19937_64 random(seed);
    const std::size_t length = 24, count = seed % 2 == 0 ? 40 : 1500;
    std::vector<std::byte> stream = random_bytes(length * count, random);
    std::vector<FrameSplit::Place> frames;
    for (std::size_t k = 0; k < count; ++k) {
      frames.push_back({k * length, k > 0});
      // Bytes of few values, in order or not.
      for (const std::size_t values : {2U, 4U, 9U}) {
        stream[k * length + values] = static_cast<std::byte>(k % values);
        stream[k * length + values + 1] = static_cast<std::byte>(random() % values);
      }
    }
    EXPECT_EQ(divide_by_type(frames, length, std::vector<bool>(length), stream).size(), 1U) << seed;
  }
}

}  // namespace
}  // namespace imud
