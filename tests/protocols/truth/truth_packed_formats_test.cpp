// Formats whose datagrams are packed fields: "betaflight", "basilisk", "dis". The datagrams of the first two are the
// bytes of the other project's own struct, filled with the quoted numbers by a program that was compiled with its
// header (g++ 12.2, x86-64); those of DIS are by the encoders of Open-DIS.
#include <gtest/gtest.h>

#include <string>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/units.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"
#include "tests/support/hex_bytes.hpp"

namespace imud {
namespace {

// fdm_packet of betaflight/betaflight at 301d01a, src/platform/SIMULATOR/target/SITL/target.h:
// {1.25, {0.1, -0.2, 0.3}, {0.5, -0.25, -9.75}, {0.5, 0.5, 0.5, 0.5}, {1, 2, 3}, {10, 20, -30}, 101325}
constexpr std::string_view betaflight_18 =
    "000000000000f43f9a9999999999b93f9a9999999999c9bf333333333333d33f000000000000e03f000000000000d0bf"
    "00000000008023c0000000000000e03f000000000000e03f000000000000e03f000000000000e03f000000000000f03f"
    "00000000000000400000000000000840000000000000244000000000000034400000000000003ec000000000d0bcf840";
// The same with virtual GPS: {1.25, {0.1, -0.2, 0.3}, {0.5, -0.25, -9.75}, {1, 0, 0, 0}, {1, 2, 3}, {8.5, 47.5, 400},
// 95000}. Up to version 4.4 (59207272, src/main/target/SITL/target.h) it has no pressure, and 136 bytes.
constexpr std::string_view betaflight_geodetic =
    "000000000000f43f9a9999999999b93f9a9999999999c9bf333333333333d33f000000000000e03f000000000000d0bf"
    "00000000008023c0000000000000f03f000000000000000000000000000000000000000000000000000000000000f03f"
    "0000000000000040000000000000084000000000000021400000000000c047400000000000007940000000008031f740";
// 5000000000, then SCStatesMsgPayload of AVSLab/basilisk at babdff7 (2.12.0b0), src/architecture/msgPayloadDefC:
// {{6.7e6, -1, 2}, {7.5e3, .5, -.25}, {6.7e6, -2, 3}, {7.5e3, .75, -.125}, {0, 0, 1}, {.25, -.5, .125}, {.0625, 2,
// -3},
//  {9, 9, 9}, {4, 5, 6}, {8, 8, 8}, {.5, -8, .75}, 3}
constexpr std::string_view basilisk_state =
    "00f2052a0100000000000000f88e5941000000000000f0bf000000000000004000000000004cbd40000000000000e03f"
    "000000000000d0bf00000000f88e594100000000000000c0000000000000084000000000004cbd40000000000000e83f"
    "000000000000c0bf00000000000000000000000000000000000000000000f03f000000000000d03f000000000000e0bf"
    "000000000000c03f000000000000b03f000000000000004000000000000008c000000000000022400000000000002240"
    "000000000000224000000000000010400000000000001440000000000000184000000000000020400000000000002040"
    "0000000000002040000000000000e03f00000000000020c0000000000000e83f0300000000000000";

class PackedFormat : public testing::Test {
 protected:
  void make(std::string_view name, std::string_view key = "", std::string_view value = "") {
    const TruthFormat& format = *find_truth_format(name);
    Settings settings(format.settings);
    if (!key.empty()) settings.set_text(key, value);
    decoder_ = format.make(settings);
  }
  TruthResult decode(std::span<const std::byte> bytes) { return decode_truth(*decoder_, bytes, truth_); }

  std::unique_ptr<TruthDecoder> decoder_;
  Truth truth_;
};

TEST_F(PackedFormat, BetaflightsOwnStruct) {
  make("betaflight");
  ASSERT_EQ(decode(hex_bytes(betaflight_18)), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 1'250'000'000);
  EXPECT_EQ(truth_.omega_BN_B, Vector3(0.1, -0.2, 0.3));
  EXPECT_EQ(truth_.specific_force_B, Vector3(0.5, -0.25, -9.75));
  EXPECT_LE((truth_.q_NB * Vector3(1, 2, 3) - Vector3(3, 1, 2)).norm(), 1e-15);
  EXPECT_EQ(truth_.v_BN_N, Vector3(1, 2, 3));
  EXPECT_EQ(truth_.r_BN_N, Vector3(10, 20, -30));
  EXPECT_TRUE(truth_.has_pressure && truth_.has_position && truth_.has_velocity);
  EXPECT_EQ(truth_.pressure, 101325);

  const std::vector<std::byte> whole = hex_bytes(betaflight_18);
  const std::size_t older_size = 136;
  ASSERT_EQ(decode(std::span(whole).first(older_size)), TruthResult::ok);
  EXPECT_EQ(truth_.r_BN_N, Vector3(10, 20, -30));
  EXPECT_FALSE(truth_.has_pressure);

  // Virtual GPS: at 1.25 s N is almost E.
  make("betaflight", "position", "geodetic");
  const std::vector<std::byte> geodetic = hex_bytes(betaflight_geodetic);
  ASSERT_EQ(decode(std::span(geodetic).first(older_size)), TruthResult::ok);
  EXPECT_FALSE(truth_.has_pressure);
  ASSERT_EQ(decode(geodetic), TruthResult::ok);
  EXPECT_EQ(truth_.pressure, 95000);
  EXPECT_NEAR(truth_.r_BN_N.norm(), 6366873, 1000);
  const Vector3 north_N = truth_.q_NB * Vector3(1, 0, 0);
  const Vector3 earth_rate_L(std::cos(47.5 * units::degree), 0, -std::sin(47.5 * units::degree));
  EXPECT_NEAR(north_N.z(), std::cos(47.5 * units::degree), 1e-12);
  EXPECT_LE((truth_.omega_BN_B - Vector3(0.1, -0.2, 0.3) - units::earth_rate * earth_rate_L).norm(), 1e-15);
  const Vector3 turning = Vector3(0, 0, units::earth_rate).cross(truth_.r_BN_N);
  EXPECT_LE((truth_.q_NB.conjugate() * (truth_.v_BN_N - turning) - Vector3(2, 1, -3)).norm(), 1e-9);

  EXPECT_EQ(decode(std::span(whole).first(135)), TruthResult::too_short);
  EXPECT_EQ(decode(std::span(whole).first(143)), TruthResult::too_short);
  std::vector<std::byte> nan = whole;
  nan.push_back({});
  EXPECT_EQ(decode(nan), TruthResult::too_long);
  nan.pop_back();
  nan[14] = nan[15] = std::byte{0x7F};
  nan[14] = std::byte{0xF8};
  EXPECT_EQ(decode(nan), TruthResult::not_finite);
  EXPECT_EQ(remark(*decoder_, TruthResult::not_finite), "p_BE, f64 at byte 8, is nan");
}

TEST_F(PackedFormat, BasilisksOwnStruct) {
  make("basilisk");
  const std::vector<std::byte> bytes = hex_bytes(basilisk_state);
  ASSERT_EQ(bytes.size(), 280U);
  ASSERT_EQ(decode(bytes), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 5'000'000'000);
  EXPECT_EQ(truth_.r_BN_N, Vector3(6.7e6, -1, 2));
  EXPECT_EQ(truth_.v_BN_N, Vector3(7.5e3, 0.5, -0.25));
  EXPECT_LE((truth_.q_NB * Vector3(1, 2, 3) - Vector3(-1, -2, 3)).norm(), 1e-15);  // half a turn about z
  EXPECT_EQ(truth_.omega_BN_B, Vector3(0.25, -0.5, 0.125));
  EXPECT_EQ(truth_.omegaDot_BN_B, Vector3(0.0625, 2, -3));
  EXPECT_EQ(truth_.accumulated_dv, AccumulatedDv::inertial);
  EXPECT_EQ(truth_.accumulated_dv_B, Vector3(4, 5, 6));
  EXPECT_EQ(truth_.specific_force_B, Vector3(0.5, -8, 0.75));
  EXPECT_TRUE(truth_.has_rate && truth_.has_angular_acceleration && truth_.has_specific_force);
  make("basilisk", "accumulated_dv", "none");
  ASSERT_EQ(decode(bytes), TruthResult::ok);
  EXPECT_EQ(truth_.accumulated_dv, AccumulatedDv::none);
  EXPECT_EQ(decode(std::span(bytes).first(272)), TruthResult::too_short);
  EXPECT_EQ(remark(*decoder_, TruthResult::too_short).substr(0, 53),
            "a datagram has 272 bytes, and one of this format 280:");
}

// EntityStatePdu::marshal() of open-dis/open-dis-cpp at b66306e, src/dis7: version 7, timestamp 0x80000001, entity 3,
// 4, 77, velocity 1 -2 3, location 4e6 1e6 4.9e6, psi theta phi .5 -.25 1.5, dead reckoning 4, acceleration 9 10 11,
// angular velocity .125 -.25 .5, marking IMUD.
constexpr std::string_view entity_state =
    "07010101800000010090000000030004004d0100010200e10103000000000000000000003f800000c000000040400000"
    "414e848000000000412e8480000000004152b128000000003f000000be8000003fc00000010203040400000000000000"
    "00000000000000004110000041200000413000003e000000be8000003f00000001494d55440000000000000000000000";
// The same with dead reckoning 8, and a variable parameter of zeros.
constexpr std::string_view entity_state_8 =
    "070101018000000100a0000000030004004d0101010200e10103000000000000000000003f800000c000000040400000"
    "414e848000000000412e8480000000004152b128000000003f000000be8000003fc00000010203040800000000000000"
    "00000000000000004110000041200000413000003e000000be8000003f00000001494d55440000000000000000000000"
    "00000000000000000000000000000000";
// open-dis/open-dis-python at b9c4cd0, EntityStatePdu.serialize(), with location and orientation by
// GPS().llarpy2ecef(): latitude 47.5 deg, longitude 8.5 deg, altitude 400 m, roll .3, pitch -.2, yaw 1; entity 17,
// 23, 42, timestamp 1, dead reckoning 4, angular velocity .125 -.25 .5.
constexpr std::string_view entity_state_at_place =
    "07010101000000010090000000110017002a010000000000000000000000000000000000000000000000000000000000"
    "415049a5a76f64e84123794372014e394151da1c2a0a33d140124957be59fc50c00e22d5000000000400000000000000"
    "00000000000000000000000000000000000000003e000000be8000003f0000000049676f723364000000000000000000";

TEST_F(PackedFormat, DisByOpenDis) {
  make("dis");
  std::vector<std::byte> pdu = hex_bytes(entity_state);
  ASSERT_EQ(pdu.size(), 144U);
  ASSERT_EQ(decode(pdu), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 1'800'000'000'000);  // half an hour
  EXPECT_EQ(truth_.stream, 77U);
  EXPECT_FALSE(truth_.has_specific_force);
  EXPECT_TRUE(truth_.has_rate && truth_.has_position && truth_.has_velocity);
  const Quaternion q_EN = exp(Vector3(0, 0, -units::earth_rate * 1800));
  EXPECT_LE((q_EN * truth_.r_BN_N - Vector3(4e6, 1e6, 4.9e6)).norm(), 1e-8);
  const Matrix3 dcm_BE = dcm_from_yaw_pitch_roll(0.5, -0.25, 1.5);
  EXPECT_LE((dcm_BE * (q_EN * (truth_.q_NB * Vector3(1, 2, 3))) - Vector3(1, 2, 3)).norm(), 1e-14);
  const Vector3 turning_B = truth_.q_NB.conjugate() * Vector3(0, 0, units::earth_rate);
  EXPECT_LE((truth_.omega_BN_B - turning_B - Vector3(0.125, -0.25, 0.5)).norm(), 1e-15);
  const auto velocity_E = [&] {
    return Vector3(q_EN * (truth_.v_BN_N - Vector3(0, 0, units::earth_rate).cross(truth_.r_BN_N)));
  };
  EXPECT_LE((velocity_E() - Vector3(1, -2, 3)).norm(), 1e-9);

  for (const int algorithm : {1, 2, 5, 6, 9}) {  // of entities that do not rotate
    pdu[88] = static_cast<std::byte>(algorithm);
    ASSERT_EQ(decode(pdu), TruthResult::ok);
    EXPECT_FALSE(truth_.has_rate) << algorithm;
  }
  ASSERT_EQ(decode(hex_bytes(entity_state_8)), TruthResult::ok);
  EXPECT_TRUE(truth_.has_rate);
  EXPECT_LE((dcm_BE * velocity_E() - Vector3(1, -2, 3)).norm(), 1e-9);

  // The last tick of the hour, and the first of the next.
  for (std::size_t i = 4; i < 8; ++i) pdu[i] = std::byte{0xFF};
  ASSERT_EQ(decode(pdu), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 3'599'999'998'324);
  for (std::size_t i = 4; i < 8; ++i) pdu[i] = {};
  ASSERT_EQ(decode(pdu), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 3'600'000'000'000);

  pdu[88] = std::byte{8};
  EXPECT_EQ(decode(std::span(pdu).first(143)), TruthResult::too_short);
  EXPECT_EQ(remark(*decoder_, TruthResult::too_short),
            "a datagram has 143 bytes; an Entity State PDU has at least 144");
  pdu[19] = std::byte{1};
  EXPECT_EQ(decode(pdu), TruthResult::too_short);
  pdu.resize(160);
  EXPECT_EQ(decode(pdu), TruthResult::ok);
  pdu.resize(161);
  EXPECT_EQ(decode(pdu), TruthResult::too_long);
  pdu[2] = std::byte{2};
  EXPECT_EQ(decode(pdu), TruthResult::no_state);
}

TEST_F(PackedFormat, DisAtAPlaceByOpenDis) {
  make("dis");
  ASSERT_EQ(decode(hex_bytes(entity_state_at_place)), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 0);
  EXPECT_EQ(truth_.stream, 42U);
  EXPECT_LE((truth_.r_BN_N - r_E_of({47.5 * units::degree, 8.5 * units::degree, 400})).norm(),
            1e-4);  // their b: 4 digits
  const Matrix3 dcm_BL =
      truth_.q_NB.conjugate().toRotationMatrix() * dcm_EL(47.5 * units::degree, 8.5 * units::degree);
  EXPECT_LE((dcm_BL - dcm_from_yaw_pitch_roll(1, -0.2, 0.3)).norm(), 1e-6);  // float32 angles
}

}  // namespace
}  // namespace imud
