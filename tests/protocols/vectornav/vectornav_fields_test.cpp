// A VectorNav's messages and binary fields on the Earth, and what registers change in them.
#include <gtest/gtest.h>

#include <cmath>

#include "core/attitude.hpp"
#include "core/earth/earth.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/vectornav/vectornav_unit.hpp"

namespace imud {
namespace {

using namespace vectornav_test;

Vector3 floats_at(const std::string& frame, std::size_t at) {
  return {static_cast<double>(real_at(frame, at)), static_cast<double>(real_at(frame, at + 4)),
          static_cast<double>(real_at(frame, at + 8))};
}
Vector3 doubles_at(const std::string& frame, std::size_t at) {
  return {number_at<double>(frame, at), number_at<double>(frame, at + 8), number_at<double>(frame, at + 16)};
}

// At 30 N, 90 E, looking east; 2025-06-01T12:34:56.789Z.
Sample on_earth() {
  Sample sample;
  sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(units::pi / 2, 0, 0).transpose());
  sample.navigation.is_known = true;
  sample.navigation.gps_ns = gps_ns_from_unix(1'748'781'296) + 789'000'000;
  sample.navigation.latitude = 30 * units::degree;
  sample.navigation.longitude = 90 * units::degree;
  sample.navigation.height = 1234.5;
  sample.navigation.r_E = {0, 5'529'324, 3'170'991};
  sample.navigation.v_L = {10, 20, -3};
  sample.magnetic_field = {20e-6, -5e-6, 45e-6};
  sample.pressure = 87'654;
  sample.specific_force = {0.5, 0, -9.80665};
  return sample;
}

// The frame of a single output.
std::string binary(Unit& unit, const std::string& output) {
  EXPECT_EQ(unit.ask("VNWRG,05,921600"), with_xor("VNWRG,05,921600"));
  EXPECT_EQ(unit.ask("VNWRG,75,1,8," + output), with_xor("VNWRG,75,1,8," + output));
  EXPECT_EQ(unit.ask("VNWRG,06,0"), with_xor("VNWRG,06,0"));
  const auto sent = unit.run(8);
  return sent.empty() ? "" : sent[0];
}

// The worked example of VectorNav's manuals, from memory; its CRC is right for its content.
TEST(VectorNavFields, TheManualsYawPitchRoll) {
  Unit unit;
  unit.sample.q_LP =
      Quaternion(dcm_from_yaw_pitch_roll(43.57868576049805 * units::degree, 1.8847202062606812 * units::degree,
                                         -0.0020249653607606888 * units::degree)
                     .transpose());
  EXPECT_EQ(binary(unit, "01,0008"),
            std::string("\xFA\x01\x08\x00\x93\x50\x2E\x42\x83\x3E\xF1\x3F\x48\xB5\x04\xBB\x92\x88", 18));
}

TEST(VectorNavFields, GnssAndInsAreTheTruths) {
  Unit unit({{"model", std::string("vn-300")}});
  unit.sample = on_earth();
  // ArduPilot's third output: Common TimeStartup, TimeGps; GNSS1 numSats, fix, LLA, velNed, posU, velU, DOP; GNSS2
  // numSats, fix.
  const std::string frame = binary(unit, "49,0003,26B8,0018");
  ASSERT_EQ(frame.size(), 2 + 6 + 16 + (1 + 1 + 24 + 12 + 12 + 4 + 28) + 2 + 2U);
  EXPECT_EQ(number_at<std::uint64_t>(frame, 16), static_cast<std::uint64_t>(unit.sample.navigation.gps_ns));
  EXPECT_GT(frame[24], 4) << "satellites";
  EXPECT_EQ(frame[25], 3) << "3D";
  EXPECT_LT((doubles_at(frame, 26) - Vector3(30, 90, 1234.5)).norm(), 1e-9);
  EXPECT_EQ(floats_at(frame, 50), Vector3(10, 20, -3));
  EXPECT_EQ(frame[24 + 82 + 1], 3) << "the second receiver's";
  // Its second: Attitude YPR, quaternion, YprU; INS status, LLA, velNed, posU, velU.
  const std::string ins = binary(unit, "31,0001,0106,0613");
  ASSERT_EQ(ins.size(), 2 + 6 + 8 + 40 + (2 + 24 + 12 + 4 + 4) + 2U);
  EXPECT_NEAR(real_at(ins, 16), 90, 1e-4);
  EXPECT_EQ(number_at<std::uint16_t>(ins, 56), 0x0306);
  EXPECT_LT((doubles_at(ins, 58) - Vector3(30, 90, 1234.5)).norm(), 1e-9);
  EXPECT_EQ(floats_at(ins, 82), Vector3(10, 20, -3));
  // INS r_E, velBody, velEcef. At 90 E: north is E's (0, -sin, cos), east is (-1, 0, 0), down (0, -cos, -sin) of 30
  // deg.
  const std::string more = binary(unit, "20,002C");
  EXPECT_EQ(doubles_at(more, 4), unit.sample.navigation.r_E);
  EXPECT_LT((floats_at(more, 28) - Vector3(20, -10, -3)).norm(), 1e-5) << "it looks east";
  const double s = 0.5, c = std::sqrt(0.75);
  EXPECT_LT((floats_at(more, 40) - Vector3(-20, -10 * s + 3 * c, 10 * c + 3 * s)).norm(), 1e-5);
  // Time: GpsTow, GpsWeek, UTC, status. 2025-06-01 is the first day of week 2369.
  const std::string time = binary(unit, "02,024C");
  EXPECT_EQ(number_at<std::uint64_t>(time, 4), (12 * 3600 + 34 * 60 + 56 + 18) * 1'000'000'000ULL + 789'000'000);
  EXPECT_EQ(number_at<std::uint16_t>(time, 12), 2369);
  EXPECT_EQ(time.substr(14, 6), std::string("\x19\x06\x01\x0C\x22\x38"));
  EXPECT_EQ(number_at<std::uint16_t>(time, 20), 789);
  EXPECT_EQ(time[22], 7);
}

TEST(VectorNavFields, NoReceiverAndNoEarthGiveZeros) {
  for (const char* model : {"vn-100", "vn-200"}) {
    Unit unit({{"model", std::string(model)}});
    if (std::string_view(model) == "vn-100") unit.sample = on_earth();
    const std::string frame = binary(unit, "28,3FFF,07FF");
    EXPECT_EQ(frame.find_first_not_of('\0', 6 + 0), frame.size() - 2) << model;
  }
  // Each register of GNSS and INS has no digit but 0, in any format: 2.00E-08 would be an accuracy.
  Unit without({{"model", std::string("vn-300")}});
  without.run(1);
  for (const char* id : {"58", "59", "63", "64"}) {
    const std::string answer = without.ask("VNRRG," + std::string(id));
    ASSERT_TRUE(answer.starts_with("$VNRRG," + std::string(id) + ",")) << answer;
    EXPECT_EQ(answer.substr(10, answer.find('*') - 10).find_first_of("123456789"), std::string::npos) << answer;
  }
  Unit unit;
  EXPECT_EQ(unit.ask("VNWRG,06,22"), with_xor("VNERR,07")) << "a VN-100 has no VNINS";
  EXPECT_EQ(unit.ask("VNRRG,63"), with_xor("VNERR,08"));
}

TEST(VectorNavFields, MessagesOfGnssAndIns) {
  Unit unit({{"model", std::string("vn-200")}});
  unit.sample = on_earth();
  unit.run(1);
  EXPECT_EQ(unit.ask("VNRRG,58"),
            with_xor("VNRRG,58,045314.789000,2369,3,12,+30.00000000,+090.00000000,+01234.500,+010.000,+020.000,"
                     "-003.000,+001.000,+001.000,+001.000,+000.050,2.00E-08"));
  EXPECT_EQ(unit.ask("VNRRG,63"),
            with_xor("VNRRG,63,045314.789000,2369,0006,+090.000,+000.000,+000.000,+30.00000000,+090.00000000,"
                     "+01234.500,+010.000,+020.000,-003.000,00.5,01.0,0.05"));
  for (const char* type : {"20", "21", "22", "23", "28", "29"}) {
    EXPECT_EQ(unit.ask("VNWRG,06," + std::string(type)), with_xor("VNWRG,06," + std::string(type)));
    const auto sent = unit.run(800);
    ASSERT_EQ(sent.size(), 40U) << type;
    EXPECT_EQ(sent[0], with_xor(sent[0].substr(1, sent[0].find('*') - 1)));
  }
}

// The figures of the solution's own errors, in place of those of a unit under an open sky.
TEST(VectorNavFields, AccuraciesAreThoseOfTheErrors) {
  Unit unit({{"model", std::string("vn-200")}});
  OwnFigures figures;
  figures.position = {1, 2, 2};
  figures.velocity = {0.1, 0.2, 0.2};
  figures.attitude = units::degree * Vector3(0.3, 0.6, 2);
  unit.device->set_figures(figures);
  unit.sample = on_earth();
  unit.run(1);
  EXPECT_EQ(unit.ask("VNRRG,58"),
            with_xor("VNRRG,58,045314.789000,2369,3,12,+30.00000000,+090.00000000,+01234.500,+010.000,+020.000,"
                     "-003.000,+001.000,+002.000,+002.000,+000.173,2.00E-08"));
  EXPECT_EQ(unit.ask("VNRRG,63"),
            with_xor("VNRRG,63,045314.789000,2369,0006,+090.000,+000.000,+000.000,+30.00000000,+090.00000000,"
                     "+01234.500,+010.000,+020.000,-003.000,01.2,01.7,0.17"));
  const std::string attitude = binary(unit, "10,0100");
  EXPECT_LT((floats_at(attitude, 4) - Vector3(2, 0.6, 0.3)).norm(), 1e-6) << "yaw, pitch, roll";
}

TEST(VectorNavFields, MagneticFieldAndPressure) {
  Unit unit;
  unit.sample = on_earth();
  // Common MagPres; IMU pressure, magnetometer; Attitude MagNed.
  const std::string frame = binary(unit, "15,0400,0120,0010");
  ASSERT_EQ(frame.size(), 2 + 6 + 20 + 16 + 12 + 2U);
  EXPECT_LT((floats_at(frame, 8) - Vector3(0.20, -0.05, 0.45)).norm(), 1e-6) << "gauss";
  EXPECT_FLOAT_EQ(real_at(frame, 24), 87.654F) << "kPa";
  EXPECT_FLOAT_EQ(real_at(frame, 28), 87.654F);
  EXPECT_LT((floats_at(frame, 32) - Vector3(0.20, -0.05, 0.45)).norm(), 1e-6);
  EXPECT_LT((floats_at(frame, 44) - Vector3(0.05, 0.20, 0.45)).norm(), 1e-6);
  EXPECT_EQ(unit.ask("VNRRG,17"), with_xor("VNRRG,17,+00.2000,-00.0500,+00.4500"));
}

TEST(VectorNavFields, TareMakesTheAttitudeZero) {
  Unit unit;
  unit.sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(1, 0.2, -0.3).transpose());
  unit.run(1);
  EXPECT_EQ(unit.ask("VNTAR"), with_xor("VNTAR"));
  unit.run(1);
  EXPECT_EQ(unit.ask("VNRRG,8").substr(0, 35), "$VNRRG,8,+000.000,+000.000,+000.000");
  unit.sample.q_LP = unit.sample.q_LP * Quaternion(dcm_from_yaw_pitch_roll(0.5, 0, 0).transpose());
  unit.run(1);
  EXPECT_EQ(unit.ask("VNRRG,8").substr(0, 17), "$VNRRG,8,+028.648");
  unit.ask("VNRST");
  unit.run(1);
  EXPECT_NE(unit.ask("VNRRG,8").substr(0, 17), "$VNRRG,8,+028.648");
}

TEST(VectorNavFields, TareTurnsNoGravity) {
  Unit unit({{"async_type", std::int64_t{0}}, {"binary_1", std::string("1,8,10,00EA")}});
  unit.sample.q_LP = Quaternion(dcm_from_yaw_pitch_roll(1, 0, units::pi).transpose());  // upside down
  unit.sample.specific_force = {0, 0, 9.80665};
  for (const bool is_tared : {false, true}) {
    if (is_tared) unit.ask("VNTAR");
    const std::string frame = unit.run(8).at(0);  // YPR, DCM, AccelNed, linear of body and NED
    EXPECT_NEAR(std::abs(real_at(frame, 4 + 8)), is_tared ? 0 : 180, 1e-3) << "roll";
    EXPECT_NEAR(real_at(frame, 16 + 32), is_tared ? 1 : -1, 1e-6) << "DCM";
    EXPECT_LT((floats_at(frame, 52) - Vector3(0, 0, -9.80665)).norm(), 1e-5);
    EXPECT_LT(floats_at(frame, 64).norm(), 1e-5);
    EXPECT_LT(floats_at(frame, 76).norm(), 1e-5);
  }
}

// Register 26 from the next reset on; a sensor mounted with its x axis to the right, its y axis to the back.
TEST(VectorNavFields, TheReferenceFrameTurnsEverything) {
  Unit unit;
  unit.sample = on_earth();
  unit.sample.rate = {0.1, 0.2, 0.3};
  unit.sample.delta_angle = unit.sample.rate / 800;
  unit.run(1);
  const std::string frame = "VNWRG,26,0,-1,0,1,0,0,0,0,1";
  EXPECT_EQ(unit.ask(frame), with_xor(frame));
  EXPECT_EQ(unit.ask("VNWRG,26,1,0,0,0,1,0,0,0,-1"), with_xor("VNERR,07")) << "no rotation";
  unit.run(1);
  EXPECT_EQ(unit.ask("VNRRG,19"), with_xor("VNRRG,19,+00.100000,+00.200000,+00.300000")) << "not yet";
  unit.ask("VNWNV");
  unit.ask("VNRST");
  unit.run(1);
  EXPECT_EQ(unit.ask("VNRRG,19"), with_xor("VNRRG,19,-00.200000,+00.100000,+00.300000"));
  EXPECT_EQ(unit.ask("VNRRG,18"), with_xor("VNRRG,18,+00.000,+00.500,-09.807"));
  EXPECT_EQ(unit.ask("VNRRG,17"), with_xor("VNRRG,17,+00.0500,+00.2000,+00.4500"));
  // The sensor's x, which pointed east, is now the host's y: the host's x points north.
  EXPECT_EQ(unit.ask("VNRRG,8").substr(0, 17), "$VNRRG,8,+000.000");
}

TEST(VectorNavFields, CompensationsActOnWhatIsCompensated) {
  Unit unit({{"binary_1", std::string("1,8,04,060C")}, {"async_type", std::int64_t{0}}});
  unit.sample.rate = {0.1, 0.2, 0.3};
  unit.sample.specific_force = {1, 2, 3};
  const std::string gyro = "VNWRG,84,1,0,0,0,1,0,0,0,2,0.1,0,0.1", accelerometer = "VNWRG,25,1,0,0,0,1,0,0,0,1,0,0,5";
  EXPECT_EQ(unit.ask(gyro), with_xor(gyro));
  EXPECT_EQ(unit.ask(accelerometer), with_xor(accelerometer));
  const auto sent = unit.run(8);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_LT((floats_at(sent[0], 4) - Vector3(1, 2, 3)).norm(), 1e-6) << "uncompensated";
  EXPECT_LT((floats_at(sent[0], 16) - Vector3(0.1, 0.2, 0.3)).norm(), 1e-6);
  EXPECT_LT((floats_at(sent[0], 28) - Vector3(1, 2, -2)).norm(), 1e-6);
  EXPECT_LT((floats_at(sent[0], 40) - Vector3(0, 0.2, 0.4)).norm(), 1e-6);
}

// A bias of 5 m/s^2 is 50 mm/s in 10 ms, one of 0.1 rad/s is 1 mrad.
TEST(VectorNavFields, CompensationsActOnIncrements) {
  Unit unit({{"binary_1", std::string("1,8,01,0800")}, {"async_type", std::int64_t{0}}});
  unit.ask("VNWRG,84,1,0,0,0,1,0,0,0,2,0.1,0,0.1");
  unit.ask("VNWRG,25,3,0,0,0,1,0,0,0,1,5,0,0");
  unit.sample.delta_angle = Vector3(0.1, 0.2, 0.3) / 800;
  unit.sample.delta_velocity = Vector3(1, 2, 3) / 800;
  unit.run(8);
  const std::string frame = unit.run(8).at(0);
  EXPECT_LT((floats_at(frame, 8) * units::degree - Vector3(0, 0.2, 0.4) / 100).norm(), 1e-7);
  EXPECT_LT((floats_at(frame, 20) - Vector3(-12, 2, 3) / 100).norm(), 1e-6);
}

// From north-east-down to the body, in column-major order: the SDK's CompositeData.hpp, vnproglib's
// Packet::extractMat3f.
TEST(VectorNavFields, TheMatrixOfDirectionCosinesGoesByColumns) {
  Unit unit({{"async_type", std::int64_t{0}}, {"binary_1", std::string("1,8,10,0008")}});
  const Matrix3 dcm_PL = dcm_from_yaw_pitch_roll(0.5, 0.2, -0.3);
  unit.sample.q_LP = Quaternion(dcm_PL.transpose());
  const auto sent = unit.run(8);
  ASSERT_EQ(sent.size(), 1U);
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row)
      EXPECT_NEAR(real_at(sent[0], 4 + 4 * static_cast<std::size_t>(3 * column + row)), dcm_PL(row, column), 1e-6);
  EXPECT_NEAR(real_at(sent[0], 4 + 12), std::cos(0.2) * std::sin(0.5), 1e-6) << "row 0, column 1";
}

// The examples of VectorNav's manuals UM001 and UM004.
TEST(VectorNavFields, TheManualsMessages) {
  Unit ypr({{"async_type", std::int64_t{1}}}), unit;
  const auto turned = [](double yaw, double pitch, double roll) {
    return Quaternion(
        dcm_from_yaw_pitch_roll(yaw * units::degree, pitch * units::degree, roll * units::degree).transpose());
  };
  ypr.sample.q_LP = turned(10.071, 0.278, -2.026);
  EXPECT_EQ(ypr.run(1).at(0), "$VNYPR,+010.071,+000.278,-002.026*60\r\n");
  unit.sample.q_LP = turned(-114.314, 0.058, -1.773);
  unit.sample.specific_force = {0.013, 0.354, -9.801};
  constexpr int samples = 532;  // 0.665 s; the manual's 0.665016 s are no multiple of a sample
  unit.sample.delta_angle = Vector3(-0.119, -0.409, -0.025) * units::degree / samples;
  unit.sample.delta_velocity = Vector3(0.011, -0.084, -6.702) / samples;
  unit.run(samples);
  EXPECT_EQ(unit.ask("VNRRG,08"), "$VNRRG,08,-114.314,+000.058,-001.773*5F\r\n");
  EXPECT_EQ(unit.ask("VNRRG,18"), "$VNRRG,18,+00.013,+00.354,-09.801*65\r\n");
  // The manual's ends in *6A; its dt ends in 16 instead of 00: '1' ^ '6' is 7.
  EXPECT_EQ(unit.ask("VNRRG,80"), "$VNRRG,80,+0.665000,-000.119,-000.409,-000.025,+000.011,-000.084,-006.702*6D\r\n");
  unit.ask("VNWRG,30,2,0,0,0,1,0,1");
  EXPECT_EQ(unit.ask("VNRRG,30"), "$VNRRG,30,2,0,0,0,1,0,1*6E\r\n");
  EXPECT_EQ(unit.send("$VNKMD,1*47\r\n"), "$VNKMD,1*47\r\n");
  EXPECT_EQ(unit.send("$VNRRG,01*00\r\n"), "$VNERR,03*72\r\n");
}

// ArduPilot's AP_ExternalAHRS_VectorNav.cpp, the third output, with its CRC-16.
TEST(VectorNavFields, ArduPilotsGnssOutput) {
  Unit unit({{"model", std::string("vn-300")}});
  const std::string line = "$VNWRG,77,1,160,49,0003,26B8,0018*4FD9\r\n";
  EXPECT_EQ(unit.send(line), line);
}

TEST(VectorNavFields, TextIsDecodedInItsUnits) {
  Unit unit({{"async_type", std::int64_t{30}}, {"async_hz", std::int64_t{200}}});
  unit.sample.delta_angle = {1e-3, 0, -2e-3};
  unit.sample.delta_velocity = {0, 0.01, 0};
  const auto sent = unit.run(8);
  ASSERT_EQ(sent.size(), 2U);
  const Protocol& protocol = *find_protocol("vectornav");
  const auto decoder = protocol.make_decoder(Settings(protocol.settings));
  Recording recording;
  for (const std::string& one : sent) decoder->feed({std::as_bytes(std::span(one))}, recording);
  ASSERT_EQ(recording.measurements.size(), 2U);
  EXPECT_EQ(recording.measurements[1].fields, Measurement::delta_angle | Measurement::delta_velocity);
  EXPECT_LT((recording.measurements[1].sample.delta_angle - 4 * unit.sample.delta_angle).norm(),
            1e-3 * units::degree);
  EXPECT_LT((recording.measurements[1].sample.delta_velocity - 4 * unit.sample.delta_velocity).norm(), 1e-3);
}

}  // namespace
}  // namespace imud
