// Formats whose datagrams are packed fields: "betaflight", "basilisk", "dis". The datagrams are those of Python's
// struct.pack, as quoted.
#include <gtest/gtest.h>

#include <string>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "protocols/truth_format.hpp"
#include "tests/support/decode_truth.hpp"
#include "tests/support/hex_bytes.hpp"

namespace imud {
namespace {

// struct.pack('<18d', 1.25, 0.1, -0.2, 0.3, 0.5, -0.25, -9.75, 0.5, 0.5, 0.5, 0.5, 1, 2, 3, 10, 20, -30, 101325)
constexpr std::string_view betaflight_18 =
    "000000000000f43f9a9999999999b93f9a9999999999c9bf333333333333d33f000000000000e03f000000000000d0bf"
    "00000000008023c0000000000000e03f000000000000e03f000000000000e03f000000000000e03f000000000000f03f"
    "00000000000000400000000000000840000000000000244000000000000034400000000000003ec000000000d0bcf840";
// struct.pack('<17d', 1.25, 0.1, -0.2, 0.3, 0.5, -0.25, -9.75, 1, 0, 0, 0, 1, 2, 3, 8.5, 47.5, 400)
constexpr std::string_view betaflight_17 =
    "000000000000f43f9a9999999999b93f9a9999999999c9bf333333333333d33f000000000000e03f000000000000d0bf"
    "00000000008023c0000000000000f03f000000000000000000000000000000000000000000000000000000000000f03f"
    "0000000000000040000000000000084000000000000021400000000000c047400000000000007940";
// struct.pack('<Q33dQ', 5_000_000_000, 6.7e6, -1, 2, 7.5e3, .5, -.25, 6.7e6, -2, 3, 7.5e3, .75, -.125, 0, 0, 1, .25,
//             -.5, .125, .0625, 2, -3, 9, 9, 9, 4, 5, 6, 8, 8, 8, .5, -8, .75, 3)
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

TEST_F(PackedFormat, BetaflightByHand) {
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

  // An older sender, and virtual GPS: at 1.25 s N is almost E.
  make("betaflight", "position", "geodetic");
  ASSERT_EQ(decode(hex_bytes(betaflight_17)), TruthResult::ok);
  EXPECT_FALSE(truth_.has_pressure);
  EXPECT_NEAR(truth_.r_BN_N.norm(), 6366873, 1000);
  const Vector3 north_N = truth_.q_NB * Vector3(1, 0, 0);
  const Vector3 earth_rate_L(std::cos(47.5 * units::degree), 0, -std::sin(47.5 * units::degree));
  EXPECT_NEAR(north_N.z(), std::cos(47.5 * units::degree), 1e-12);
  EXPECT_LE((truth_.omega_BN_B - Vector3(0.1, -0.2, 0.3) - units::earth_rate * earth_rate_L).norm(), 1e-15);
  const Vector3 turning = Vector3(0, 0, units::earth_rate).cross(truth_.r_BN_N);
  EXPECT_LE((truth_.q_NB.conjugate() * (truth_.v_BN_N - turning) - Vector3(2, 1, -3)).norm(), 1e-9);

  std::vector<std::byte> whole = hex_bytes(betaflight_18);
  EXPECT_EQ(decode(std::span(whole).first(135)), TruthResult::too_short);
  EXPECT_EQ(decode(std::span(whole).first(143)), TruthResult::too_short);
  whole.push_back({});
  EXPECT_EQ(decode(whole), TruthResult::too_long);
  std::vector<std::byte> nan = hex_bytes(betaflight_17);
  nan[14] = nan[15] = std::byte{0x7F};
  nan[14] = std::byte{0xF8};
  EXPECT_EQ(decode(nan), TruthResult::not_finite);
  EXPECT_EQ(remark(*decoder_, TruthResult::not_finite), "p_BE, f64 at byte 8, is nan");
}

TEST_F(PackedFormat, BasiliskByHand) {
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

// An Entity State PDU in the field order of open-dis-cpp's EntityStatePdu::marshal, by Python's struct:
// pack('>BBBBIHH', 7, 1, 1, 1, 0x80000001, 144, 0) + pack('>HHH', 3, 4, 77) + pack('>BB', 1, 0) + bytes(16)
// + pack('>3f', 1, -2, 3) + pack('>3d', 4e6, 1e6, 4.9e6) + pack('>3f', .5, -.25, 1.5) + pack('>I', 0) + pack('>B', 4)
// + bytes(15) + pack('>3f', 9, 9, 9) + pack('>3f', .125, -.25, .5) + b'\1IMUD' + bytes(7) + pack('>I', 0)
constexpr std::string_view entity_state =
    "07010101800000010090000000030004004d0100000000000000000000000000000000003f800000c000000040400000"
    "414e848000000000412e8480000000004152b128000000003f000000be8000003fc00000000000000400000000000000"
    "00000000000000004110000041100000411000003e000000be8000003f00000001494d55440000000000000000000000";

TEST_F(PackedFormat, DisByHand) {
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
  pdu[88] = std::byte{8};
  ASSERT_EQ(decode(pdu), TruthResult::ok);
  EXPECT_TRUE(truth_.has_rate);
  EXPECT_LE((dcm_BE * velocity_E() - Vector3(1, -2, 3)).norm(), 1e-9);

  // The last tick of the hour, and the first of the next.
  for (std::size_t i = 4; i < 8; ++i) pdu[i] = std::byte{0xFF};
  ASSERT_EQ(decode(pdu), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 3'599'999'998'324);
  for (std::size_t i = 4; i < 8; ++i) pdu[i] = {};
  ASSERT_EQ(decode(pdu), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 3'600'000'000'000);

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

}  // namespace
}  // namespace imud
