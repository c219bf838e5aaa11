// MAVLink: frames of the reference generator, CRC_EXTRA from the definitions of the messages, and streams.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <string>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/units.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"
#include "tests/support/hex_bytes.hpp"

namespace imud {
namespace {

using MavlinkBytes = std::vector<std::byte>;

// Frames of mavlink/c_library_v2 at 7e16bc0, dialect common, system 1, component 200.
// t = 123456789 us, q = 1 0 0 0, rates .01 -.02 .03, lat 44, lon -73, alt 100000 mm, v 100 -200 300 cm/s, ias 1500,
// tas 1600, acc 1 2 -981 mG
constexpr std::string_view reference_quaternion =
    "fd4000000b01c873000015cd5b07000000000000803f0000000000000000000000000ad7233c0ad7a3bc8fc2f53c00de391a80157dd4a086"
    "0100640038ff2c01dc054006010002002bfcb92a";
// HIL_SENSOR and SCALED_IMU, which have no state.
constexpr std::string_view reference_sensor =
    "fd3e00000701c86b000015cd5b0700000000cdcccc3dcdcc4c3ec3f51cc10ad7233c0ad7a3bc8fc2f53c0000803e00000000cdcccc3e0050"
    "7d440000c03f0000c8420000c841ff1f4407";
constexpr std::string_view reference_scaled_imu =
    "fd1800000901c81a000040e201000a0014002bfc0a00ecff1e00fa0000009001c4098e3f";

// By mavlink/c_library_v2 at 7e16bc0 too: SYSTEM_TIME with time_boot_ms 12500; HIL_STATE at 12.5 s, roll, pitch, yaw
// .5
// -.25 1.5, rates .125 -.25 .5, lat 47.5, lon 8.5, alt 400000 mm, v 100 -200 300 cm/s, acc 125 -250 -1000 mG;
// SIM_STATE, q .5 .5 .5 .5, acc .5 -.25 -9.75, rates, lat, lon and v as before, alt 400, lat_int 475000123, lon_int
// 85000456.
constexpr std::string_view reference_system_time_v1 = "fe0c0401c80200401e18240a0600d430000052f2";
constexpr std::string_view reference_system_time = "fd0a00000001c802000000401e18240a0600d430edb9";
constexpr std::string_view reference_hil_state_v1 =
    "fe380501c85a20bcbe00000000000000003f000080be0000c03f0000003e000080be0000003fc0ec4f1c40ff1005801a0600640038ff2c01"
    "7d0006ff18fc4115";
constexpr std::string_view reference_hil_state =
    "fd3800000101c85a000020bcbe00000000000000003f000080be0000c03f0000003e000080be0000003fc0ec4f1c40ff1005801a06006400"
    "38ff2c017d0006ff18fc90e8";
// In version 1 without the extensions lat_int and lon_int, as in version 2 where they are 0.
constexpr std::string_view reference_sim_state_v1 =
    "fe540601c86c0000003f0000003f0000003f0000003f0000c03f000080be0000003f0000003f000080be00001cc10000003e000080be0000"
    "003f00003e42000008410000c8430000803f000000400000803f000000c0000040402359";
constexpr std::string_view reference_sim_state =
    "fd5c00000201c86c00000000003f0000003f0000003f0000003f0000c03f000080be0000003f0000003f000080be00001cc10000003e0000"
    "80be0000003f00003e42000008410000c8430000803f000000400000803f000000c0000040403bed4f1c08011105102a";
constexpr std::string_view reference_sim_state_without_int =
    "fd5400000301c86c00000000003f0000003f0000003f0000003f0000c03f000080be0000003f0000003f000080be00001cc10000003e0000"
    "80be0000003f00003e42000008410000c8430000803f000000400000803f000000c0000040409dc9";

// CRC-16/MCRF4XX bit by bit.
std::uint16_t mavlink_crc(std::span<const std::byte> bytes, std::uint16_t crc = 0xFFFF) {
  for (const std::byte byte : bytes) {
    crc = static_cast<std::uint16_t>(crc ^ std::to_integer<unsigned>(byte));
    for (int i = 0; i < 8; ++i) crc = static_cast<std::uint16_t>((crc & 1) != 0 ? crc >> 1 ^ 0x8408 : crc >> 1);
  }
  return crc;
}

// mavlink.io, "Packet Serialization", CRC_EXTRA: over the name, then type, name and array length of each field in the
// order of the wire, extensions left out. `fields` is already in that order.
std::uint8_t crc_extra_of(std::string_view name, std::string_view fields) {
  const std::string text = std::string(name) + " " + std::string(fields);
  const std::uint16_t crc = mavlink_crc(std::as_bytes(std::span(text)));
  return static_cast<std::uint8_t>((crc & 0xFF) ^ crc >> 8);
}
// message_definitions/v1.0/common.xml; the length of an array is one byte.
constexpr std::string_view system_time_fields = "uint64_t time_unix_usec uint32_t time_boot_ms ";
constexpr std::string_view hil_state_fields =
    "uint64_t time_usec float roll float pitch float yaw float rollspeed float pitchspeed float yawspeed int32_t lat "
    "int32_t lon int32_t alt int16_t vx int16_t vy int16_t vz int16_t xacc int16_t yacc int16_t zacc ";
constexpr std::string_view sim_state_fields =
    "float q1 float q2 float q3 float q4 float roll float pitch float yaw float xacc float yacc float zacc float "
    "xgyro float ygyro float zgyro float lat float lon float alt float std_dev_horz float std_dev_vert float vn "
    "float ve float vd ";
constexpr std::string_view quaternion_fields =
    "uint64_t time_usec float attitude_quaternion \4float rollspeed float pitchspeed float yawspeed int32_t lat "
    "int32_t lon int32_t alt int16_t vx int16_t vy int16_t vz uint16_t ind_airspeed uint16_t true_airspeed int16_t "
    "xacc int16_t yacc int16_t zacc ";

class MavlinkPayload {
 public:
  template <class... Numbers>
  explicit MavlinkPayload(Numbers... numbers) {
    (put(numbers), ...);
  }
  MavlinkBytes bytes;

 private:
  template <class Number>
  void put(Number number) {
    const auto raw = std::bit_cast<std::array<std::byte, sizeof number>>(number);
    bytes.insert(bytes.end(), raw.begin(), raw.end());
  }
};

MavlinkBytes mavlink_frame(int version, unsigned id, std::uint8_t extra, MavlinkBytes payload,
                           bool is_signed = false) {
  if (version == 2)
    while (payload.size() > 1 && payload.back() == std::byte{0}) payload.pop_back();
  const auto byte = [](auto number) { return static_cast<std::byte>(number); };
  MavlinkBytes frame = {byte(version == 2 ? 0xFD : 0xFE), byte(payload.size())};
  if (version == 2) frame.insert(frame.end(), {byte(is_signed ? 1 : 0), byte(0)});
  frame.insert(frame.end(), {byte(9), byte(3), byte(1), byte(id)});
  if (version == 2) frame.insert(frame.end(), {byte(0), byte(0)});
  frame.insert(frame.end(), payload.begin(), payload.end());
  const std::byte last[] = {byte(extra)};
  const std::uint16_t crc = mavlink_crc(last, mavlink_crc(std::span(frame).subspan(1)));
  frame.insert(frame.end(), {byte(crc & 0xFF), byte(crc >> 8)});
  if (is_signed) frame.resize(frame.size() + 13, byte(0xFD));
  return frame;
}

MavlinkBytes hil_state_frame(std::uint64_t time_us, int version = 2, bool is_signed = false) {
  const MavlinkPayload payload(time_us, 0.1F, -0.2F, 3.0F, 0.5F, 0.25F, -0.125F, std::int32_t{475'000'000},
                               std::int32_t{85'000'000}, std::int32_t{400'000}, std::int16_t{100}, std::int16_t{-200},
                               std::int16_t{50}, std::int16_t{10}, std::int16_t{0}, std::int16_t{0});
  return mavlink_frame(version, 90, crc_extra_of("HIL_STATE", hil_state_fields), payload.bytes, is_signed);
}
MavlinkBytes system_time_frame(std::uint32_t boot_ms) {
  return mavlink_frame(2, 2, crc_extra_of("SYSTEM_TIME", system_time_fields),
                       MavlinkPayload(std::uint64_t{0}, boot_ms).bytes);
}
MavlinkBytes sim_state_frame(std::int32_t lat_e7, std::int32_t lon_e7) {
  const MavlinkPayload payload(1.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.5F, 0.25F, -9.75F, 0.125F, 0.25F, -0.5F,
                               47.5F, 8.5F, 400.0F, 0.0F, 0.0F, 1.0F, 2.0F, -3.0F, lat_e7, lon_e7);
  return mavlink_frame(2, 108, crc_extra_of("SIM_STATE", sim_state_fields), payload.bytes);
}

class MavlinkTruth : public testing::Test {
 protected:
  MavlinkTruth() { make("specific_force"); }
  void make(std::string_view acceleration) {
    Settings settings(find_truth_format("mavlink")->settings);
    settings.set_text("acceleration", acceleration);
    decoder_ = find_truth_format("mavlink")->make(settings);
  }
  TruthResult decode(std::span<const std::byte> bytes) { return decode_truth(*decoder_, bytes, truth_); }
  std::vector<TruthResult> feed(std::span<const std::byte> bytes, TruthInput input = TruthInput::stream) {
    std::vector<TruthResult> results;
    decoder_->feed(bytes, input, {});
    Truth truth;
    while (const auto result = decoder_->next(truth)) {
      results.push_back(*result);
      if (*result == TruthResult::ok) truth_ = truth;
    }
    return results;
  }

  Quaternion q_EN() const {
    return exp(Vector3(0, 0, -units::earth_rate * 1e-9 * static_cast<double>(truth_.time.ns)));
  }
  void expect_place(double latitude_deg, double longitude_deg, double height) {
    latitude_ = latitude_deg * units::degree;
    dcm_LE_ = dcm_EL(latitude_, longitude_deg * units::degree).transpose();
    const Vector3 r_E = r_E_of({latitude_, longitude_deg * units::degree, height});
    EXPECT_LE((q_EN() * truth_.r_BN_N - r_E).norm(), 1e-8);
  }
  Matrix3 dcm_LB() const { return dcm_LE_ * (q_EN() * truth_.q_NB).toRotationMatrix(); }
  // p .125, q -.25, r .5 rad/s relative to the Earth; 1, -2, 3 m/s.
  void expect_motion() const {
    const Vector3 earth_rate_L(units::earth_rate * std::cos(latitude_), 0, -units::earth_rate * std::sin(latitude_));
    EXPECT_LE((truth_.omega_BN_B - Vector3(0.125, -0.25, 0.5) - dcm_LB().transpose() * earth_rate_L).norm(), 1e-15);
    const Vector3 v_N = truth_.v_BN_N - Vector3(0, 0, units::earth_rate).cross(truth_.r_BN_N);
    EXPECT_LE((dcm_LE_ * (q_EN() * v_N) - Vector3(1, -2, 3)).norm(), 1e-9);
  }

  std::unique_ptr<TruthDecoder> decoder_;
  Truth truth_;
  double latitude_ = 0;
  Matrix3 dcm_LE_;
};

TEST(MavlinkCrcExtra, IsThatOfTheGeneratedHeaders) {  // MAVLINK_MSG_ID_2_CRC, _90_, _108_, _115_
  EXPECT_EQ(crc_extra_of("SYSTEM_TIME", system_time_fields), 137);
  EXPECT_EQ(crc_extra_of("HIL_STATE", hil_state_fields), 183);
  EXPECT_EQ(crc_extra_of("SIM_STATE", sim_state_fields), 32);
  EXPECT_EQ(crc_extra_of("HIL_STATE_QUATERNION", quaternion_fields), 4);
}

TEST_F(MavlinkTruth, FramesOfTheReference) {
  ASSERT_EQ(decode(hex_bytes(reference_quaternion)), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 123'456'789'000);
  EXPECT_EQ(truth_.stream, 1U);
  const double latitude = 44 * units::degree;
  const Vector3 earth_rate_L(units::earth_rate * std::cos(latitude), 0, -units::earth_rate * std::sin(latitude));
  EXPECT_LE((truth_.omega_BN_B - Vector3(0.01F, -0.02F, 0.03F) - earth_rate_L).norm(), 1e-15);
  EXPECT_LE((truth_.specific_force_B - 1e-3 * units::standard_gravity * Vector3(1, 2, -981)).norm(), 1e-14);
  const Quaternion q_NE = exp(Vector3(0, 0, units::earth_rate * 123.456789));
  const Vector3 r_E = r_E_of({latitude, -73 * units::degree, 100});
  EXPECT_LE((truth_.r_BN_N - q_NE * r_E).norm(), 1e-8);
  const Vector3 v_N = q_NE * (dcm_EL(latitude, -73 * units::degree) * Vector3(1, -2, 3)) +
                      Vector3(0, 0, units::earth_rate).cross(truth_.r_BN_N);
  EXPECT_LE((truth_.v_BN_N - v_N).norm(), 1e-12);
  EXPECT_EQ(decode(hex_bytes(reference_sensor)), TruthResult::no_state);
  EXPECT_EQ(decode(hex_bytes(reference_scaled_imu)), TruthResult::no_state);
}

TEST_F(MavlinkTruth, HilStateOfTheReference) {
  for (const std::string_view frame : {reference_hil_state_v1, reference_hil_state}) {
    make("specific_force");
    ASSERT_EQ(decode(hex_bytes(frame)), TruthResult::ok);
    EXPECT_EQ(truth_.time.ns, 12'500'000'000);
    EXPECT_EQ(truth_.stream, 1U);
    expect_place(47.5, 8.5, 400);
    EXPECT_LE((dcm_LB() - dcm_from_yaw_pitch_roll(1.5, -0.25, 0.5).transpose()).norm(), 1e-7);
    EXPECT_LE((truth_.specific_force_B - units::standard_gravity * Vector3(0.125, -0.25, -1)).norm(), 1e-14);
    expect_motion();
  }
}

TEST_F(MavlinkTruth, SimStateOfTheReference) {
  const std::pair<std::string_view, std::string_view> frames[] = {
      {reference_system_time_v1, reference_sim_state_v1},
      {reference_system_time, reference_sim_state},
      {reference_system_time, reference_sim_state_without_int}};
  for (const auto& [time, state] : frames) {
    make("specific_force");
    ASSERT_EQ(decode(hex_bytes(time)), TruthResult::no_state);
    ASSERT_EQ(decode(hex_bytes(state)), TruthResult::ok);
    EXPECT_EQ(truth_.time.ns, 12'500'000'000);
    const bool is_extended = state == reference_sim_state;
    expect_place(is_extended ? 47.5000123 : 47.5, is_extended ? 8.5000456 : 8.5, 400);
    // q turns x to y, y to z, z to x.
    EXPECT_LE((dcm_LB() * Vector3(1, 2, 3) - Vector3(3, 1, 2)).norm(), 1e-14);
    EXPECT_EQ(truth_.specific_force_B, Vector3(0.5, -0.25, -9.75));
    expect_motion();
  }
}

TEST_F(MavlinkTruth, HilStateInBothVersionsAndSigned) {
  for (const int version : {1, 2})
    for (const bool is_signed : {false, true}) {
      if (version == 1 && is_signed) continue;
      ASSERT_EQ(decode(hil_state_frame(5'000'000, version, is_signed)), TruthResult::ok) << version << is_signed;
      EXPECT_EQ(truth_.time.ns, 5'000'000'000);
      EXPECT_EQ(truth_.stream, 3U);
      EXPECT_NEAR(truth_.specific_force_B.x(), 10e-3 * units::standard_gravity, 1e-15);  // the rest was cut off
      EXPECT_EQ(truth_.specific_force_B.z(), 0);
      EXPECT_NEAR(truth_.omega_BN_B.x(), 0.5, 1e-4);
    }
  make("none");
  ASSERT_EQ(decode(hil_state_frame(1)), TruthResult::ok);
  EXPECT_FALSE(truth_.has_specific_force);
  make("coordinate");
  ASSERT_EQ(decode(hil_state_frame(1)), TruthResult::ok);
  EXPECT_NEAR((truth_.specific_force_B - Vector3(0.0980665, 0, 0)).norm(), normal_gravity(47.5 * units::degree, 400),
              1e-3);
}

TEST_F(MavlinkTruth, ATimeSince1970CountsFromTheFirst) {
  constexpr std::uint64_t unix_us = 1'700'000'000'000'000;
  ASSERT_EQ(decode(hil_state_frame(unix_us)), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 0);
  ASSERT_EQ(decode(hil_state_frame(unix_us + 2500)), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 2'500'000);
}

TEST_F(MavlinkTruth, SimStateNeedsSystemTime) {
  EXPECT_EQ(decode(sim_state_frame(0, 0)), TruthResult::out_of_range);
  EXPECT_EQ(remark(*decoder_, TruthResult::out_of_range).substr(0, 53),
            "SIM_STATE has no time: send SYSTEM_TIME before each, ");
  EXPECT_EQ(decode(system_time_frame(0xFFFFFFFF)), TruthResult::no_state);
  ASSERT_EQ(decode(sim_state_frame(0, 0)), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 4'294'967'295'000'000);
  EXPECT_EQ(truth_.specific_force_B, Vector3(0.5, 0.25, -9.75));
  EXPECT_NEAR(geodetic_of(exp(Vector3(0, 0, -units::earth_rate * 4'294'967.295)) * truth_.r_BN_N).latitude,
              47.5 * units::degree, 1e-9);
  EXPECT_EQ(decode(sim_state_frame(0, 0)), TruthResult::out_of_range);  // the time was that of the other one
  EXPECT_EQ(decode(system_time_frame(9)), TruthResult::no_state);
  ASSERT_EQ(decode(sim_state_frame(475'000'123, 85'000'000)), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, (4'294'967'296 + 9) * 1'000'000);
  EXPECT_NEAR(geodetic_of(exp(Vector3(0, 0, -units::earth_rate * 4'294'967.305)) * truth_.r_BN_N).latitude,
              47.5000123 * units::degree, 1e-9);
}

TEST_F(MavlinkTruth, FindsFramesInAStreamOrInADatagram) {
  using enum TruthResult;
  const MavlinkBytes good = hil_state_frame(1'000), sensor = hex_bytes(reference_sensor);
  MavlinkBytes bad = good;
  bad[20] ^= std::byte{1};
  MavlinkBytes all = {std::byte{0xFE}, std::byte{7}};  // a false start that hides nothing
  for (const MavlinkBytes& part : {good, sensor, bad, good, good}) all.insert(all.end(), part.begin(), part.end());
  const std::vector<TruthResult> wanted = {not_this_kind, ok, no_state, bad_checksum, ok, ok};
  EXPECT_EQ(feed(all), wanted);
  EXPECT_EQ(feed(all, TruthInput::datagram), wanted);
  std::vector<TruthResult> found;
  for (std::size_t i = 0; i < all.size(); ++i)
    std::ranges::copy(feed(std::span(all).subspan(i, 1)), std::back_inserter(found));
  EXPECT_EQ(found, wanted);

  EXPECT_EQ(feed(std::span(good).first(30)), std::vector<TruthResult>());
  decoder_->finish();
  EXPECT_EQ(decoder_->losses().cut_short_by, 30U);
  EXPECT_EQ(decode(std::span(good).first(30)), too_short);
  EXPECT_EQ(decode({}), too_short);
  EXPECT_EQ(decode(bad), bad_checksum);
  EXPECT_EQ(remark(*decoder_, bad_checksum),
            "the CRC of message 90 is wrong: noise, or another definition of the message");
}

TEST_F(MavlinkTruth, EveryOneBitErrorIsRefused) {
  MavlinkBytes frame = hex_bytes(reference_quaternion);
  for (std::size_t bit = 0; bit < 8 * frame.size(); ++bit) {
    frame[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
    for (const TruthResult result : feed(frame, TruthInput::datagram)) EXPECT_NE(result, TruthResult::ok) << bit;
    frame[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
  }
}

// A frame whose id is damaged is not taken as a message that is not used.
TEST_F(MavlinkTruth, ADamagedIdIsAWrongChecksum) {
  const MavlinkBytes good = hex_bytes(reference_quaternion);
  for (const std::size_t at : {std::size_t{7}, std::size_t{8}, std::size_t{9}})
    for (unsigned bit = 0; bit < 8; ++bit) {
      MavlinkBytes bytes = good;
      bytes[at] ^= std::byte(1U << bit);
      const std::vector<TruthResult> results = feed(bytes, TruthInput::datagram);
      ASSERT_FALSE(results.empty());
      for (const TruthResult result : results) EXPECT_NE(result, TruthResult::no_state) << at << " " << bit;
      EXPECT_NE(results[0], TruthResult::ok);
    }
  EXPECT_EQ(feed(hex_bytes(reference_sensor), TruthInput::datagram), std::vector{TruthResult::no_state});
  EXPECT_EQ(feed(hex_bytes(reference_scaled_imu), TruthInput::datagram), std::vector{TruthResult::no_state});
}

}  // namespace
}  // namespace imud
