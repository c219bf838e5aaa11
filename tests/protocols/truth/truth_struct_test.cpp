// Packed layouts, and the truth format "struct". The known records are those of Python's struct.pack, as quoted.
#include <gtest/gtest.h>

#include <map>
#include <stdexcept>
#include <string>

#include "core/units.hpp"
#include "protocols/quantities/packed_layout.hpp"
#include "protocols/truth_format.hpp"
#include "protocols/wire/wrapping_time.hpp"
#include "tests/support/decode_truth.hpp"
#include "tests/support/hex_bytes.hpp"

namespace imud {
namespace {

using Texts = std::vector<std::string>;
constexpr auto little_end = boost::endian::order::little;
constexpr double deg_rad = units::degree;

std::string layout_fault(const Texts& fields) {
  try {
    const PackedLayout layout{std::span<const std::string>(fields), little_end};
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

double packed_value(const TruthReading& reading, std::string_view name) {
  return reading[find_truth_field(name).value().quantity];
}

// struct.pack('<4sH2xIdi4fhhhB3x', b'\x1a\xcf\xfc\x1d', 7, 4000000000, 47.5, -731234567, 0.5, 0.5, 0.5, 0.5, 100,
//             -200, 981, 255)
constexpr std::string_view little_record =
    "1acffc1d0700000000286bee0000000000c04740f93e6ad40000003f0000003f0000003f0000003f640038ffd503ff000000";

const Texts little_fields = {"vehicle:u16",
                             "_:2",
                             "time_us:u32",
                             "latitude_deg:f64",
                             "longitude_deg:i32*1e-7",
                             "q_LB_w:f32",
                             "q_LB_x:f32",
                             "q_LB_y:f32",
                             "q_LB_z:f32",
                             "specific_force_x_mg:i16",
                             "specific_force_y_mg:i16",
                             "specific_force_z_mg:i16*-1",
                             "temperature_c:u8",
                             "_:3"};

TEST(PackedLayout, ReadsEveryTypeInBothOrders) {
  PackedLayout little{std::span<const std::string>(little_fields), little_end, 4};
  EXPECT_EQ(little.size(), 50U);
  EXPECT_EQ(little.time_modulus(), std::int64_t{4'294'967'296'000});
  TruthReading reading;
  ASSERT_EQ(little.read(hex_bytes(little_record), reading), TruthResult::ok);
  EXPECT_EQ(packed_value(reading, "vehicle"), 7);
  EXPECT_EQ(reading.time_ns(), 4'000'000'000'000);
  EXPECT_EQ(packed_value(reading, "latitude_rad"), 47.5 * deg_rad);
  EXPECT_NEAR(packed_value(reading, "longitude_rad"), -73.1234567 * deg_rad, 4e-16);
  EXPECT_EQ(packed_value(reading, "q_LB_z"), 0.5);
  EXPECT_NEAR(packed_value(reading, "specific_force_y_m_per_s2"), -1.96133, 1e-15);
  EXPECT_NEAR(packed_value(reading, "specific_force_z_m_per_s2"), -9.62032365, 1e-14);
  EXPECT_EQ(packed_value(reading, "temperature_c"), 255);

  // struct.pack('>bhiqBHIQfd', -1, -2, -3, -4, 250, 65000, 4000000000, 10**19, 0.25, -0.5)
  const Texts every = {"p_rad_per_s:i8",  "q_rad_per_s:i16", "r_rad_per_s:i32", "time_ns:i64", "temperature_c:u8",
                       "pressure_pa:u16", "day:u32",         "sequence:u64",    "vehicle:f32", "earth_angle_rad:f64"};
  PackedLayout big{std::span<const std::string>(every), boost::endian::order::big};
  EXPECT_EQ(big.time_modulus(), std::nullopt);
  ASSERT_EQ(
      big.read(hex_bytes("fffffefffffffdfffffffffffffffcfafde8ee6b28008ac7230489e800003e800000bfe0000000000000"),
               reading),
      TruthResult::ok);
  EXPECT_EQ(packed_value(reading, "p_rad_per_s"), -1);
  EXPECT_EQ(packed_value(reading, "q_rad_per_s"), -2);
  EXPECT_EQ(packed_value(reading, "r_rad_per_s"), -3);
  EXPECT_EQ(reading.time_ns(), -4);
  EXPECT_EQ(packed_value(reading, "temperature_c"), 250);
  EXPECT_EQ(packed_value(reading, "pressure_pa"), 65000);
  EXPECT_EQ(packed_value(reading, "day"), 4e9);
  EXPECT_EQ(packed_value(reading, "sequence"), 1e19);
  EXPECT_EQ(packed_value(reading, "vehicle"), 0.25);
  EXPECT_EQ(packed_value(reading, "earth_angle_rad"), -0.5);
}

TEST(PackedLayout, SaysWhatIsWrongWithAField) {
  EXPECT_EQ(layout_fault({"time_s:f64", "_:4"}), "");
  EXPECT_EQ(layout_fault({"time_s"}), "\"time_s\": a field is NAME:TYPE, such as time_s:f64, and padding _:BYTES");
  EXPECT_EQ(layout_fault({"time_s:f16"}),
            "\"time_s:f16\": unknown type \"f16\"; there are u8 i8 u16 i16 u32 i32 u64 i64 f32 f64");
  EXPECT_NE(layout_fault({"tine_s:f64"}).find("unknown quantity \"tine_s\""), std::string::npos);
  EXPECT_NE(layout_fault({"time:f64"}).find("it needs a unit: time_s"), std::string::npos);
  EXPECT_NE(layout_fault({"time_s:f64", "time_ns:u64"}).find("given twice"), std::string::npos);
  EXPECT_NE(layout_fault({"utc:f64"}).find("give unix_time_s"), std::string::npos);
  for (const char* scale : {"time_s:f64*", "time_s:f64*x", "time_s:f64*0", "time_s:f64*inf"})
    EXPECT_NE(layout_fault({scale}).find("the scale must be a number"), std::string::npos) << scale;
  for (const char* wrong : {"_:0", "_:-1", "_:x", "_:65536"})
    EXPECT_NE(layout_fault({wrong}).find("1 to 65535"), std::string::npos) << wrong;
  EXPECT_NE(layout_fault({"_:65535", "time_s:f64"}).find("more than 65535 bytes"), std::string::npos);
}

TEST(WrappingTime, GoesOnOverTheEndAndRestarts) {
  constexpr std::int64_t second = 1'000'000'000, round = 4'294'967'296'000;
  WrappingTime time(round);
  EXPECT_EQ(time.of(round - second), round - second);
  EXPECT_EQ(time.of(second), round + second);
  EXPECT_EQ(time.of(round - 2 * second), round - 2 * second);  // reordered
  EXPECT_EQ(time.of(2 * second), round + 2 * second);
  EXPECT_EQ(time.of(600 * second), round + 600 * second);  // a long gap
  EXPECT_EQ(time.of(590 * second), round + 590 * second);
  EXPECT_EQ(time.of(5 * second), 5 * second);  // a restart
  WrappingTime restarted(round);
  EXPECT_EQ(restarted.of(3000 * second), 3000 * second);
  EXPECT_EQ(restarted.of(0), 0);
}

Settings struct_settings(const std::map<std::string, std::string>& given) {
  Settings settings(find_truth_format("struct")->settings);
  for (const auto& [key, text] : given) settings.set_text(key, text);
  return settings;
}

std::string struct_fault(const std::map<std::string, std::string>& given) {
  try {
    (void)find_truth_format("struct")->make(struct_settings(given));
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

constexpr std::string_view named_fields =
    "vehicle:u16,_:2,time_us:u32,latitude_deg:f64,longitude_deg:i32*1e-7,q_LB_w:f32,q_LB_x:f32,q_LB_y:f32,q_LB_z:f32,"
    "specific_force_x_mg:i16,specific_force_y_mg:i16,specific_force_z_mg:i16*-1,temperature_c:u8";

class StructTruth : public testing::Test {
 protected:
  void make(const std::map<std::string, std::string>& given) {
    decoder_ = find_truth_format("struct")->make(struct_settings(given));
  }
  TruthResult decode(std::span<const std::byte> bytes) { return decode_truth(*decoder_, bytes, truth_); }
  std::vector<TruthResult> stream(std::span<const std::byte> bytes) {
    std::vector<TruthResult> results;
    decoder_->feed(bytes, TruthInput::stream, {});
    while (const auto result = decoder_->next(truth_)) results.push_back(*result);
    return results;
  }

  std::unique_ptr<TruthDecoder> decoder_;
  Truth truth_;
};

TEST_F(StructTruth, KnownRecordWithMagicAndLength) {
  make({{"fields", std::string(named_fields)}, {"magic", "1ACFfc1d"}, {"length", "50"}});
  const std::vector<std::byte> record = hex_bytes(little_record);
  ASSERT_EQ(decode(record), TruthResult::ok) << remark(*decoder_, TruthResult::out_of_range);
  EXPECT_EQ(truth_.time.ns, 4'000'000'000'000);
  EXPECT_EQ(truth_.stream, 7U);
  EXPECT_TRUE(truth_.has_specific_force && truth_.has_temperature);
  EXPECT_FALSE(truth_.has_rate || truth_.has_position || truth_.has_velocity);
  EXPECT_NEAR(truth_.specific_force_B.x(), 0.980665, 1e-15);

  std::vector<std::byte> wrong = record;
  wrong.pop_back();
  EXPECT_EQ(decode(wrong), TruthResult::too_short);
  EXPECT_EQ(remark(*decoder_, TruthResult::too_short).substr(0, 58),
            "a datagram has 49 bytes, and these settings describe 50: \"");
  wrong.resize(51);
  EXPECT_EQ(decode(wrong), TruthResult::too_long);
  wrong = record;
  wrong[0] = {};
  EXPECT_EQ(decode(wrong), TruthResult::not_this_kind);
  wrong = record;
  wrong[18] = wrong[19] = std::byte{0xFF};  // of the latitude
  EXPECT_EQ(decode(wrong), TruthResult::not_finite);
  EXPECT_EQ(remark(*decoder_, TruthResult::not_finite), "latitude, f64 at byte 12, is nan");
  wrong = record;
  wrong[19] = std::byte{0x7F};
  EXPECT_EQ(decode(wrong), TruthResult::out_of_range);
  EXPECT_NE(remark(*decoder_, TruthResult::out_of_range).find("latitude is "), std::string::npos);
}

// d = struct.pack('>IddddfffHxx', 0xCAFEF00D, 12.25, 0.1, 0.2, 0.3, 1.5, -2.5, 9.75, 3)
// d + struct.pack('>I', zlib.crc32(d))
constexpr std::string_view big_record =
    "cafef00d40288000000000003fb999999999999a3fc999999999999a3fd33333333333333fc00000c0200000411c0000000300002ab7991"
    "4";

TEST_F(StructTruth, KnownRecordBigEndianWithACrc) {
  std::map<std::string, std::string> settings = {
      {"fields",
       "time_s:f64,yaw_rad:f64,pitch_rad:f64,roll_rad:f64,p_deg_per_s:f32,q_deg_per_s:f32,r_deg_per_s:f32,"
       "sequence:u16,_:2"},
      {"byte_order", "big"},
      {"magic", "cafef00d"},
      {"checksum", "crc32"}};
  make(settings);
  const std::vector<std::byte> record = hex_bytes(big_record);
  ASSERT_EQ(decode(record), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 12'250'000'000);
  EXPECT_EQ(truth_.sequence, 3U);
  EXPECT_NEAR(truth_.omega_BN_B.z(), 9.75 * deg_rad, 1e-16);
  EXPECT_FALSE(truth_.has_specific_force);
  settings["body"] = "flu";
  make(settings);
  ASSERT_EQ(decode(record), TruthResult::ok);
  EXPECT_NEAR(truth_.omega_BN_B.z(), -9.75 * deg_rad, 1e-16);
  for (std::size_t bit = 32; bit < 8 * record.size(); bit += 3) {
    std::vector<std::byte> wrong = record;
    wrong[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
    EXPECT_EQ(decode(wrong), TruthResult::bad_checksum) << bit;
  }
}

// The check values for the nine bytes "123456789": the sum is 477; the exclusive or is that of 1 to 9; the CRCs are
// those of the catalogue of parametrised CRC algorithms (reveng.sourceforge.io/crc-catalogue), RFC 3720 for CRC-32C.
TEST_F(StructTruth, ChecksumsHaveTheirCheckValues) {
  const std::map<std::string, std::string> checks = {{"sum8", "dd"},          {"xor8", "31"},
                                                     {"crc16-ccitt", "29b1"}, {"crc16-modbus", "4b37"},
                                                     {"crc32", "cbf43926"},   {"crc32c", "e3069283"}};
  for (const auto& [checksum, value] : checks) {
    make({{"fields", "_:4,time_s:u8,p_rad_per_s:i8,q_rad_per_s:i8,r_rad_per_s:i8,_:1"},
          {"checksum", checksum},
          {"byte_order", "big"}});
    EXPECT_EQ(decode(hex_bytes("313233343536373839" + value)), TruthResult::ok) << checksum;
    EXPECT_EQ(decode(hex_bytes("313233343536373830" + value)), TruthResult::bad_checksum) << checksum;
  }
}

TEST_F(StructTruth, FindsRecordsInAStream) {
  make({{"fields", std::string(named_fields)}, {"magic", "1acffc1d"}, {"length", "50"}});
  const std::vector<std::byte> record = hex_bytes(little_record);
  std::vector<std::byte> bytes = record;
  bytes.insert(bytes.end(), {std::byte{0x1A}, std::byte{0xCF}, std::byte{0x1A}});  // two false starts
  bytes.insert(bytes.end(), record.begin(), record.end());
  bytes.insert(bytes.end(), record.begin(), record.end());
  using enum TruthResult;
  EXPECT_EQ(stream(bytes), (std::vector{ok, not_this_kind, ok, ok}));
  EXPECT_EQ(stream(std::span(record).first(20)), std::vector<TruthResult>());
  decoder_->finish();
  EXPECT_EQ(decoder_->losses().cut_short, 1U);
  EXPECT_EQ(decoder_->losses().cut_short_by, 20U);
  EXPECT_EQ(stream(record), std::vector{ok});
}

TEST_F(StructTruth, AChecksumAloneFindsRecordsToo) {
  make({{"fields", "time_s:u8,p_rad_per_s:i8,q_rad_per_s:i8,r_rad_per_s:i8"}, {"checksum", "crc16-ccitt"}});
  std::vector<std::byte> bytes = hex_bytes("ffff");
  std::vector<std::byte> record = hex_bytes("01020304");
  record.insert(record.end(), {std::byte{0xC3}, std::byte{0x89}});  // binascii.crc_hqx(record, 0xffff) is 0x89c3
  for (int i = 0; i < 3; ++i) bytes.insert(bytes.end(), record.begin(), record.end());
  using enum TruthResult;
  EXPECT_EQ(stream(bytes), (std::vector{bad_checksum, ok, ok, ok}));
  // Without either, records follow one another.
  make({{"fields", "time_s:u8,p_rad_per_s:i8,q_rad_per_s:i8,r_rad_per_s:i8"}});
  EXPECT_EQ(stream(hex_bytes("0102030402030405030405")), (std::vector{ok, ok}));
}

TEST_F(StructTruth, TimesWrapOrAreThoseOfTheArrival) {
  make({{"fields", "time_ms:u16,p_rad_per_s:i8,q_rad_per_s:i8,r_rad_per_s:i8"}});
  ASSERT_EQ(decode(hex_bytes("f8ff000000")), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 65'528'000'000);
  ASSERT_EQ(decode(hex_bytes("0200000000")), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 65'538'000'000);
  make({{"fields", "p_rad_per_s:i8,q_rad_per_s:i8,r_rad_per_s:i8"}, {"time", "arrival"}});
  const std::vector<std::byte> rest = hex_bytes("000000");
  for (const std::int64_t ns : {0, 7, 12}) {
    decoder_->feed(rest, TruthInput::datagram, {ns + 1000});
    ASSERT_EQ(decoder_->next(truth_), TruthResult::ok);
    EXPECT_EQ(truth_.time.ns, ns);
  }
}

TEST_F(StructTruth, SaysWhatIsWrongWithItsSettings) {
  EXPECT_EQ(struct_fault({}), "");
  EXPECT_NE(struct_fault({{"fields", "time_s:f64"}}).find("fields: the attitude is missing"), std::string::npos);
  EXPECT_NE(
      struct_fault({{"time", "arrival"}, {"fields", "unix_time_s:f64,p_rad_per_s:i8,q_rad_per_s:i8,r_rad_per_s:i8"}})
          .find("the time is given twice"),
      std::string::npos);
  EXPECT_EQ(
      struct_fault({{"time", "arrival"}}),
      "fields: the time is given twice, by a field and by time = \"arrival\"; omit the key time, or give padding, "
      "such as _:8, in place of the field");
  EXPECT_EQ(struct_fault({{"time", "arrival"}, {"fields", "_:8,p_rad_per_s:i8,q_rad_per_s:i8,r_rad_per_s:i8"}}), "");
  for (const char* magic : {"1", "xy", "1acffc1", "0x1a"})
    EXPECT_NE(struct_fault({{"magic", magic}}).find("magic: must be at most 32 bytes"), std::string::npos) << magic;
  EXPECT_EQ(struct_fault({{"length", "88"}}), "");
  EXPECT_EQ(struct_fault({{"length", "87"}}),
            "length: magic, fields and checksum have 88 bytes; give that or more, or 0");
}

}  // namespace
}  // namespace imud
