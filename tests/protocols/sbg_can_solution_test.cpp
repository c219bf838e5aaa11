// Status words and accuracies of sbg-can: they follow the unit's own solution. Bits and limits: sbgECom 05c19cd,
// sbgEComLogEkf.h, sbgEComLogStatus.h and doc/binaryMessages.md.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/attitude.hpp"
#include "core/units.hpp"
#include "tests/protocols/can_text.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/solution_phases.hpp"

namespace imud {
namespace {

using SbgLines = std::vector<std::string>;

// Returns the frames of a unit that sends these messages after that sample.
SbgLines sbg_frames(const std::string& messages, const Sample& sample) {
  const Protocol& protocol = protocol_named("sbg-can");
  Line line(protocol, settings_of(protocol, "messages=" + messages));
  SbgLines lines;
  for (const Frame& frame : line.encode(sample)) lines.push_back(can_text(frame));
  EXPECT_EQ(line.device->counts().empty() ? 0 : line.device->counts()[0], 0U);  // none has saturated
  return lines;
}
// Returns the words CLOCK, AIDING and SOLUTION as they are in their frames.
SbgLines sbg_words(const Sample& sample) {
  SbgLines lines = sbg_frames("status_01,status_02,status_03", sample);
  EXPECT_EQ(lines.at(0).substr(0, 16), "100#40420F007F00");  // 1 s; all is good
  EXPECT_EQ(lines.at(1).substr(0, 12), "101#FF7F002E");
  EXPECT_EQ(lines.at(2).substr(12), "0000");
  return {lines[0].substr(16), lines[1].substr(12), lines[2].substr(4, 8)};
}

Sample sbg_known() {
  Sample sample;
  sample.time.ns = 1'000'000'000;
  sample.navigation.is_known = true;
  sample.navigation.gps_ns = 1'420'000'000'000'000'000;
  return sample;
}

TEST(SbgCanSolutionTest, WordsOfTheTruthAreThoseOfANavigatingUnit) {
  Sample sample = sbg_known();
  EXPECT_EQ(sbg_words(sample), (SbgLines{"A700", "0B000000", "F40C0008"}));
  sample.navigation = {};
  EXPECT_EQ(sbg_words(sample), (SbgLines{"0200", "00000000", "32000000"}));
  sample.magnetic_field.x() = 20e-6;
  sample.pressure = 1e5;
  EXPECT_EQ(sbg_words(sample), (SbgLines{"0200", "00210000", "32000000"}));
}

TEST(SbgCanSolutionTest, WordsFollowTheFilter) {
  Sample known = sbg_known();
  const auto solution = [](const Sample& sample) { return sbg_words(sample)[2]; };
  // While it aligns: vertical gyro, with a magnetometer AHRS; the receiver's data arrive, and time with them.
  EXPECT_EQ(sbg_words(aligning(known, false)), (SbgLines{"0200", "00000000", "01010000"}));
  EXPECT_EQ(sbg_words(aligning(known)), (SbgLines{"A700", "0B000000", "01010000"}));
  known.magnetic_field.x() = 20e-6;
  EXPECT_EQ(sbg_words(aligning(known)), (SbgLines{"A700", "0B010000", "02030000"}));
  // With fixes: navigation, all valid.
  Sample sample = aided(known);
  sample.solution->used = aid::position | aid::velocity | aid::magnetic_heading;
  EXPECT_EQ(sbg_words(sample), (SbgLines{"A700", "0B010000", "F40E0008"}));
  sample.solution->used = aid::antennas_heading | aid::pressure | aid::zero_velocity;
  EXPECT_EQ(sbg_words(sample), (SbgLines{"A700", "0B010000", "F42C000E"}));
  // The heading of two antennas arrives, but is not used.
  EXPECT_EQ(sbg_words(aided(with_antennas(known, 1, 0.01))), (SbgLines{"A700", "0F010000", "F40C0008"}));
  EXPECT_EQ(sbg_words(aligning(with_antennas(known, 1, 0.01))), (SbgLines{"A700", "0F010000", "02030000"}));
  // With the truth as solution it is used while there is one.
  const std::string without = solution(known);
  EXPECT_EQ(without.substr(2), "0C0008");
  EXPECT_EQ(solution(with_antennas(known, 1, 0.01)), without.substr(0, 2) + "2C0008");
  // Without: the fixes count for 3 s, the time runs on, and the mode stays.
  EXPECT_EQ(sbg_words(coasting(known, 2.9)), (SbgLines{"8200", "00010000", "F40C0008"}));
  EXPECT_EQ(sbg_words(coasting(known, 3.1)), (SbgLines{"8200", "00010000", "F4000008"}));
  EXPECT_EQ(solution(coasting(known, 60, {.tilt_deg = 0.6, .heading_deg = 1.1, .velocity = 1.6, .position = 11})),
            "04000000");
  // An attitude without a place.
  sample.navigation = {};
  sample.solution->state = Solution::State::levelled;
  sample.solution->used = aid::gravity | aid::magnetic_heading;
  EXPECT_EQ(solution(sample), "32030000");
}

TEST(SbgCanSolutionTest, EachQuantityIsValidBelowItsLimit) {
  const auto valid = [](const PhaseSigmas& sigmas) { return sbg_words(aided(sbg_known(), sigmas))[2]; };
  EXPECT_EQ(valid({.tilt_deg = 0.49, .heading_deg = 0.99, .velocity = 1.49, .position = 9.9}), "F40C0008");
  EXPECT_EQ(valid({.tilt_deg = 0.51}), "E40C0000");
  EXPECT_EQ(valid({.heading_deg = 1.01}), "D40C0000");
  EXPECT_EQ(valid({.velocity = 1.51}), "B40C0000");
  EXPECT_EQ(valid({.position = 10.1}), "740C0000");
}

TEST(SbgCanSolutionTest, AccuraciesAreTheFiltersDeviations) {
  const std::string messages = "ekf_orientation_acc,ekf_pos_acc,ekf_vel_ned_acc";
  EXPECT_EQ(sbg_frames(messages, sbg_known()),
            (SbgLines{"133#000000000000", "136#000000000000", "138#000000000000"}));
  Sample sample = aided(sbg_known());
  sample.solution->attitude = {0.001F, 0.002F, 0.004F};
  sample.solution->velocity = {0.01F, 0.02F, 0.03F};
  sample.solution->position = {1, 2, 300};
  EXPECT_EQ(sbg_frames(messages, sample), (SbgLines{"133#0A0014002800", "136#6400C8003075", "138#010002000300"}));
  // Heading east, the roll is a rotation about east. Nose up by 60 deg, it is that over cos 60 deg, and the yaw has
  // the part tan 60 deg of it: sqrt(0.004^2 + 0.002^2 * 3) = 0.00529.
  sample.q_LP = exp(Vector3(0, 0, units::pi / 2));
  EXPECT_EQ(sbg_frames(messages, sample)[0], "133#14000A002800");
  sample.q_LP = sample.q_LP * exp(Vector3(0, units::pi / 3, 0));
  EXPECT_EQ(sbg_frames(messages, sample)[0], "133#28000A003500");
  sample.solution->velocity.setConstant(1e4F);
  sample.solution->position.setConstant(1e4F);
  const SbgLines unknown = {"133#B87A5C3DB87A", "136#FFFFFFFFFFFF", "138#FF7FFF7FFF7F"};
  EXPECT_EQ(sbg_frames(messages, sample)[1], unknown[1]);
  EXPECT_EQ(sbg_frames(messages, sample)[2], unknown[2]);
  EXPECT_EQ(sbg_frames(messages, aligning(sbg_known())), unknown);
}

constexpr const char* sbg_gps =
    "gps1_vel_info,gps1_vel,gps1_vel_acc,gps1_course,gps1_pos_info,gps1_pos,gps1_pos_alt,gps1_pos_acc";

// The layouts are those of sbgECom 05c19cd, doc/canProtocol.md; the numbers were written by hand.
TEST(SbgCanSolutionTest, Gps1IsTheReceiversFixWhateverTheSolution) {
  Sample sample = sbg_known();
  sample.navigation.latitude = 45.5 * units::degree;
  sample.navigation.longitude = -12.25 * units::degree;
  sample.navigation.height = 1234.567;
  sample.navigation.v_L = {3, -4, 0.5};
  sample.navigation.satellites = 9;
  const SbgLines open_sky = {
      "170#40420F0080000000",  // computed, Doppler
      "171#2C0170FE3200",      // 3, -4, 0.5 m/s
      "172#030003000300",      // 0.03 m/s
      "173#DF772200",          // 306.87 deg; 0.03 / 5 rad is 0.34 deg
      "174#40420F0080100000",  // computed, single, GPS L1
      "175#C0BF1E1B60CCB2F8",  // 45.5 deg, -12.25 deg
      "176#87D61200000009FF",  // 1234.567 m, no undulation, 9 satellites, no corrections
      "177#55005500B400FFFF"   // 0.85 m, 0.85 m, 1.8 m
  };
  EXPECT_EQ(sbg_frames(sbg_gps, sample), open_sky);
  // The receiver's accuracies are multiplied where it sees few satellites.
  sample.navigation.accuracy_factor = 4;
  sample.navigation.satellites = 4;
  SbgLines few = sbg_frames(sbg_gps, sample);
  EXPECT_EQ(few[2], "172#0C000C000C00");
  EXPECT_EQ(few[3], "173#DF778A00");  // 1.375 deg
  EXPECT_EQ(few[6], "176#87D61200000004FF");
  EXPECT_EQ(few[7], "177#54015401D002FFFF");
  sample.navigation.accuracy_factor = 1;
  sample.navigation.satellites = 9;
  // Neither a filter that has no place yet, nor one that is elsewhere, changes the fix.
  EXPECT_EQ(sbg_frames(sbg_gps, aligning(sample)), open_sky);
  Sample elsewhere = aided(sample);
  elsewhere.navigation.latitude = 0.5;
  elsewhere.navigation.v_L.setZero();
  EXPECT_EQ(sbg_frames(sbg_gps, elsewhere), open_sky);
  // Without a fix the receiver has nothing, though the solution coasts.
  const SbgLines none = {"170#40420F0001000000", "171#000000000000",     "172#FF7FFF7FFF7F",
                         "173#00005046",         "174#40420F0001000000", "175#0000000000000000",
                         "176#00000000000000FF", "177#FFFFFFFFFFFFFFFF"};
  EXPECT_EQ(sbg_frames(sbg_gps, coasting(sample, 60)), none);
  sample.navigation = {};
  EXPECT_EQ(sbg_frames(sbg_gps, sample), none);
}

TEST(SbgCanSolutionTest, Gps1HasTheAccuraciesOfTheUnitsReceiver) {
  const Protocol& protocol = protocol_named("sbg-can");
  Line line(protocol, settings_of(protocol, "messages=gps1_vel_acc,gps1_course,gps1_pos_acc"));
  OwnFigures figures;
  figures.position = {1.25, 2.5, 700};
  figures.velocity = {0.1, 0.2, 0.4};
  line.device->set_figures(figures);
  Sample sample = sbg_known();  // at rest: the course is not known
  const auto frames = [&] {
    SbgLines lines;
    for (const Frame& frame : line.encode(sample)) lines.push_back(can_text(frame));
    return lines;
  };
  EXPECT_EQ(frames(), (SbgLines{"172#0A0014002800", "173#00005046", "177#7D00FA00FFFFFFFF"}));
  // To the east the course follows the north velocity: 0.1 / 10 rad is 0.57 deg.
  sample.time.ns += 1'000'000'000;
  ++sample.counter;
  sample.navigation.v_L = {0, 10, 0};
  EXPECT_EQ(frames()[1], "173#28233900");
}

// "Position timestamp": 1 s less 150 ms.
TEST(SbgCanSolutionTest, TheReceiversTimeStampIsTheFixs) {
  const std::string messages = "ekf_info,gps1_vel_info,gps1_pos_info";
  SbgLines lines = sbg_frames(messages, between_fixes(sbg_known(), std::chrono::milliseconds(150)));
  for (std::string& line : lines) line.resize(12);
  EXPECT_EQ(lines, (SbgLines{"130#40420F00", "170#50F80C00", "174#50F80C00"}));
  lines = sbg_frames(messages, aided(sbg_known()));
  EXPECT_EQ(lines.at(2).substr(0, 12), "174#40420F00") << "each sample has a fix";
}

// sbgECom 05c19cd, doc/canProtocol.md, states the layouts GPSX_HDT_INFO and GPSX_HDT; the numbers were written
// by hand. The SDK takes accuracies of 180 and 90 deg as no heading and no pitch (sbgEComLogGnssHdt.c).
TEST(SbgCanSolutionTest, HdtIsTheHeadingOfTheReceiversAntennas) {
  const auto hdt = [](const Sample& sample) { return sbg_frames("gps1_hdt_info,gps1_hdt", sample); };
  const SbgLines none = {"178#40420F000100", "179#0000504600002823"};
  EXPECT_EQ(hdt(sbg_known()), none) << "one antenna";
  const Sample west = with_antennas(sbg_known(), -0.5 * units::pi, 0.4 * units::degree);
  const SbgLines measured = {"178#40420F000000", "179#7869280000002823"};  // 270 deg, 0.4 deg
  EXPECT_EQ(hdt(west), measured);
  // Whatever the solution is; without a fix there is no heading.
  EXPECT_EQ(hdt(aligning(west)), measured);
  Sample north = aided(west);
  north.q_LP = Quaternion::Identity();
  EXPECT_EQ(hdt(north), measured);
  EXPECT_EQ(hdt(coasting(west, 60)), none);
  Sample lost = west;
  lost.navigation.is_known = false;
  EXPECT_EQ(hdt(lost), none);
  // A line that is nearly vertical has none, and an accuracy is never 0, which is not valid.
  Sample upright = west;
  upright.navigation.antennas.direction_L = {0, -0.17, -0.985};
  EXPECT_EQ(hdt(upright), none);
  EXPECT_EQ(hdt(with_antennas(sbg_known(), 0, 1e-6))[1], "179#0000010000002823");
  // 1 s less the age of the heading, which unlike the fix is not late.
  Sample later = between_fixes(west, std::chrono::milliseconds(150));
  later.solution->receiver.antennas.age = std::chrono::milliseconds(100);
  EXPECT_EQ(hdt(later)[0], "178#A0BB0D000000");
  EXPECT_EQ(sbg_frames("gps1_pos_info", later)[0].substr(0, 12), "174#50F80C00");
}

TEST(SbgCanSolutionTest, AirDataIsTheBarometers) {
  Sample sample = sbg_known();
  EXPECT_EQ(sbg_frames("air_data_info,air_data_altitude", sample),
            (SbgLines{"162#40420F00000000", "163#0000000000000000"}));
  sample.pressure = 89874.57;  // of the standard atmosphere at 1000 m (ISO 2533)
  const SbgLines lines = sbg_frames("air_data_info,air_data_altitude", sample);
  EXPECT_EQ(lines[0], "162#40420F00060000");
  EXPECT_EQ(lines[1].substr(0, 12), "163#8A605B05");
  std::uint32_t altitude_mm = 0;
  for (std::size_t i = 0; i < 4; ++i)
    altitude_mm |= static_cast<std::uint32_t>(std::stoul(lines[1].substr(12 + 2 * i, 2), nullptr, 16)) << 8 * i;
  EXPECT_NEAR(altitude_mm, 1e6, 2);
}

}  // namespace
}  // namespace imud
