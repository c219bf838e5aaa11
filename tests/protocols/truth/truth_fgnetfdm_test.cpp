// FGNetFDM as JSBSim sends it, with the text rows of the same run.
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

// Datagrams of JSBSim 1.3.2.dev1 (0b688c80), script c1722.xml, `<output type="FLIGHTGEAR">` with <time
// type="simulation" resolution="1e-6"/>; the rows are of the `<output type="SOCKET">` text of the same run and time.
// cur_time 15000000 us; the last bytes are 0.
constexpr std::string_view fdm_at_15_s =
    "0000001800000000bff9223ea04b727e3fdf72b959ebfb994092e519944d1c85449728a6bc09305f3cd7f935406b683d3c98ec333a55cf1d"
    "3a9a3eb93b83284f3ac42e8242c00ce23fa97072c31394d3c2aff96cbfa97072432bcb753e0f81af404d44b93ef0f3693d880e53c2033b1f"
    "000000003d3f696c0000000100000002000000000000000000000000450ecb7800000000000000000000000040c1d8660000000000000000"
    "0000000000000000000000000000000000000000417266660000000000000000000000004395b07300000000000000000000000041871cc3"
    "000000000000000000000000000000000000000000000000000000004304530d0000000000000000000000004286a1d20000000000000000"
    "00000000000000024301ea5c4301ea5c0000000000000000000000030000000000000000000000003f8000003f8000003f80000000000000"
    "000000000000000000000000000000000000000000e4e1c00000000046c35000000000003e4f3b3b";
// cur_time 20000000 us; the last bytes are 0.
constexpr std::string_view fdm_at_20_s =
    "0000001800000000bff92257553ece1f3fdf7225c20f25434092f475d69772204497a388bb9f226f3d1b85f3406b38343c9dd29739949c4d"
    "39f8101639ac5e72ba28913042bced15404a6290c3117e37c2ac189cc04a62904329083d3d444943405070ce3f1c71923d9e7276c200930d"
    "000000003c850b080000000100000002000000000000000000000000450e551600000000000000000000000040c1479b0000000000000000"
    "0000000000000000000000000000000000000000417266660000000000000000000000004395a3b400000000000000000000000041872159"
    "00000000000000000000000000000000000000000000000000000000430428160000000000000000000000004286adc10000000000000000"
    "00000000000000024301e3424301e3420000000000000000000000030000000000000000000000003f8000003f8000003f80000000000000"
    "000000000000000000000000000000000000000001312d000000000046c35000000000003e4f3b3b";
// cur_time 40000000 us; the last bytes are 0.
constexpr std::string_view fdm_at_40_s =
    "0000001800000000bff922b87c48f7113fdf6fdfa345d2634092eeb25bc52db94497756cba46fa113c30317d406b60433c9adcbb3a00f791"
    "389c16f33b0e560339b6826d42bea97fbfb1f735c3129d81c2ae71a93fb1f735432a92c13dabe487404e65013f071c1b3d988154c201fbec"
    "000000003ce6ea250000000100000002000000000000000000000000450e871200000000000000000000000040c18a4c0000000000000000"
    "0000000000000000000000000000000000000000417266660000000000000000000000004395ee2500000000000000000000000041872285"
    "0000000000000000000000000000000000000000000000000000000043039f340000000000000000000000004286d3c70000000000000000"
    "00000000000000024301c6f44301c6f40000000000000000000000030000000000000000000000003f8000003f8000003f80000000000000"
    "000000000000000000000000000000000000000002625a000000000046c35000000000003e4f3b3b";

struct JsbsimRow {
  std::string_view datagram;
  double time, latitude, longitude, altitude_ft, roll, pitch, yaw;
  Vector3 inertial_rate, pilot_force_ft, ecef_velocity_ft;
};
const JsbsimRow jsbsim_rows[] = {
    {fdm_at_15_s,
     15.00000000000095,
     0.4913771989958434,
     -1.570860506201967,
     3967.422169069584,
     -0.008373349277668226,
     0.02636394886271731,
     3.678237176311296,
     {0.001083010981818727, 0.004023108627163159, 0.001494114365743764},
     {0.4706070829519022, 0.06643356796422724, -32.80773626170957},
     {-87.99169255568613, -70.79634800731095, -129.495500914336}},
    {fdm_at_20_s,
     20.00000000000031,
     0.4913420100316054,
     -1.570884068479138,
     3980.020863763353,
     -0.004856399776947096,
     0.03796954078709388,
     3.675305325246652,
     {0.0004435452127008614, 0.0003647698976573626, -0.0006772869488523521},
     {0.6111079338509596, 0.07736675685462298, -32.14360294584949},
     {-86.05433237863994, -71.42562219780798, -126.7892836171254}},
    {fdm_at_40_s,
     40.00000000000201,
     0.4912032217464796,
     -1.570976720321998,
     3975.293531544498,
     -0.0007590363438844687,
     0.0107539859676455,
     3.677750279509845,
     {1.5782180409804e-05, 0.00220448292599494, 0.0003147740385720332},
     {0.5277726213372713, 0.07446542235412829, -32.49601653258443},
     {-87.23424421507269, -67.91483348882586, -129.936154404546}},
};

std::vector<std::byte> fdm_bytes(std::string_view hex) {
  std::vector<std::byte> bytes = hex_bytes(hex);
  bytes.resize(408);
  return bytes;
}
void put_word(std::vector<std::byte>& bytes, std::size_t offset, std::uint32_t word) {
  for (std::size_t i = 0; i < 4; ++i) bytes[offset + i] = static_cast<std::byte>(word >> (24 - 8 * i));
}

class FgnetfdmTruth : public testing::Test {
 protected:
  void make(std::string_view time = "field") {
    Settings settings(find_truth_format("fgnetfdm")->settings);
    settings.set_text("time", time);
    decoder_ = find_truth_format("fgnetfdm")->make(settings);
  }
  TruthResult decode(std::span<const std::byte> bytes) { return decode_truth(*decoder_, bytes, truth_); }

  std::unique_ptr<TruthDecoder> decoder_ =
      find_truth_format("fgnetfdm")->make(Settings(find_truth_format("fgnetfdm")->settings));
  Truth truth_;
};

// Bounds: half an LSB of float32, of angles up to 4 rad (1.2e-7 with the next rounding), of forces up to 64 ft/s^2,
// of velocities up to 256 ft/s; the altitude of JSBSim is the radius less the sea level's.
TEST_F(FgnetfdmTruth, DatagramsOfJsbsimAreItsText) {
  for (const JsbsimRow& row : jsbsim_rows) {
    SCOPED_TRACE(row.time);
    ASSERT_EQ(decode(fdm_bytes(row.datagram)), TruthResult::ok) << remark(*decoder_, TruthResult::out_of_range);
    EXPECT_EQ(truth_.time.ns, std::llround(row.time) * 1'000'000'000);
    const double turned = units::earth_rate * std::round(row.time);
    const Quaternion q_NE = exp(Vector3(0, 0, turned));
    const Matrix3 dcm_BL = dcm_from_yaw_pitch_roll(row.yaw, row.pitch, row.roll);
    const Quaternion q_NB = q_NE * Quaternion(Matrix3(dcm_EL(row.latitude, row.longitude) * dcm_BL.transpose()));
    EXPECT_LE(log(q_NB.conjugate() * truth_.q_NB).norm(), 1.5e-7);
    EXPECT_LE((truth_.omega_BN_B - row.inertial_rate).lpNorm<Eigen::Infinity>(), 6e-8);
    ASSERT_TRUE(truth_.has_rate && truth_.has_specific_force && truth_.has_position && truth_.has_velocity);
    EXPECT_LE((truth_.specific_force_B - units::foot * row.pilot_force_ft).lpNorm<Eigen::Infinity>(), 7e-7);
    const Vector3 r_E = r_E_of({row.latitude, row.longitude, units::foot * row.altitude_ft});
    EXPECT_LE((q_NE.conjugate() * truth_.r_BN_N - r_E).norm(), 0.02);
    const Vector3 v_E = q_NE.conjugate() * truth_.v_BN_N - Vector3(0, 0, units::earth_rate).cross(r_E);
    EXPECT_LE((v_E - units::foot * row.ecef_velocity_ft).lpNorm<Eigen::Infinity>(), 5e-6);
  }
}

TEST_F(FgnetfdmTruth, RefusesAndSaysWhy) {
  std::vector<std::byte> bytes = fdm_bytes(fdm_at_20_s);
  EXPECT_EQ(decode(std::span(bytes).first(407)), TruthResult::too_short);
  EXPECT_EQ(remark(*decoder_, TruthResult::too_short).substr(0, 58),
            "a datagram has 407 bytes, and one of this format 408: \"???");
  put_word(bytes, 0, 25);
  EXPECT_EQ(decode(bytes), TruthResult::bad_version);
  EXPECT_EQ(remark(*decoder_, TruthResult::bad_version), "version 25, and known is 24");
  put_word(bytes, 0, 24);
  put_word(bytes, 44, 0x7FC00000);
  EXPECT_EQ(decode(bytes), TruthResult::not_finite);
  EXPECT_EQ(remark(*decoder_, TruthResult::not_finite), "yaw, f32 at byte 44, is nan");
  put_word(bytes, 44, 0x50000000);
  EXPECT_EQ(decode(bytes), TruthResult::out_of_range);
  bytes.push_back({});
  EXPECT_EQ(decode(bytes), TruthResult::too_long);
}

TEST_F(FgnetfdmTruth, TheTimeWrapsIsStuckOrIsThatOfTheArrival) {
  std::vector<std::byte> bytes = fdm_bytes(fdm_at_20_s);
  put_word(bytes, 356, 0xFFFFFFFF);
  ASSERT_EQ(decode(bytes), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 4'294'967'295'000);
  put_word(bytes, 356, 9999);
  ASSERT_EQ(decode(bytes), TruthResult::ok);
  EXPECT_EQ(truth_.time.ns, 4'294'977'295'000);

  make();
  put_word(bytes, 356, 1234567890);
  EXPECT_EQ(decode(bytes), TruthResult::ok);
  EXPECT_EQ(decode(bytes), TruthResult::ok);  // the timeline counts it as a duplicate
  EXPECT_EQ(decode(bytes), TruthResult::out_of_range);
  EXPECT_EQ(remark(*decoder_, TruthResult::out_of_range),
            "cur_time is 1234567890 again: JSBSim's <output> needs <time type=\"simulation\" resolution=\"1e-6\"/>; "
            "for FlightGear set time = \"arrival\"");
  put_word(bytes, 356, 1234567891);
  EXPECT_EQ(decode(bytes), TruthResult::ok);

  make("arrival");
  for (int i = 0; i < 4; ++i) {
    decoder_->feed(bytes, TruthInput::datagram, {100 + 7 * i});
    ASSERT_EQ(decoder_->next(truth_), TruthResult::ok);
    EXPECT_EQ(truth_.time.ns, 7 * i);
  }
}

}  // namespace
}  // namespace imud
