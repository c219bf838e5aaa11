// What a VectorNav reports while its own filter aligns, is aided, coasts for 50 s, and is aided again.
#include <gtest/gtest.h>

#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/solution_phases.hpp"
#include "tests/protocols/vectornav/vectornav_unit.hpp"

namespace imud {
namespace {

using namespace vectornav_test;

Sample at_30_north(double east_deg) {
  Sample sample;
  sample.navigation = {.is_known = true,
                       .gps_ns = gps_ns_from_unix(1'748'781'296),
                       .latitude = 30 * units::degree,
                       .longitude = east_deg * units::degree,
                       .v_L = {0, 20, 0}};
  sample.specific_force = {0, 0, -9.80665};
  return sample;
}

// The words of register 63, without its name: time, week, status, yaw, pitch, roll, latitude, longitude, height, the
// velocity, and the uncertainties of attitude, position and velocity.
std::vector<std::string> ins_words(Unit& unit, const Sample& sample) {
  unit.sample = sample;
  unit.run(1);
  const std::string answer = unit.ask("VNRRG,63");
  std::vector<std::string> words = {""};
  for (const char c : answer.substr(10, answer.find('*') - 10))
    if (c == ',')
      words.emplace_back();
    else
      words.back() += c;
  EXPECT_EQ(words.size(), 15U) << answer;
  return words;
}
std::string ins_status(Unit& unit, const Sample& sample) { return ins_words(unit, sample)[2]; }

// The frame of the first binary output with these fields.
std::string binary_frame(Unit& unit, const std::string& fields) {
  unit.ask("VNWRG,05,921600");
  unit.ask("VNWRG,75,1,8," + fields);
  const auto sent = unit.run(8);
  return sent.empty() ? "" : sent[0];
}

TEST(VectorNavSolution, ModesOfTheIns) {
  const Sample known = at_30_north(90);
  const PhaseSigmas wide = {.heading_deg = 4};  // 2.3 deg of all axes
  const auto modes = [&](const char* model) {
    Unit unit({{"model", std::string(model)}, {"async_type", std::int64_t{0}}});
    std::vector<std::string> all;
    for (const Sample& sample : {aligning(known, false), aligning(known), aided(known, wide), aided(known),
                                 coasting(known, 44), coasting(known, 46), coasting(known, 44, wide), aided(known)})
      all.push_back(ins_status(unit, sample));
    return all;
  };
  EXPECT_EQ(modes("vn-200"),
            (std::vector<std::string>{"0000", "0005", "0005", "0006", "0002", "0003", "0001", "0006"}));
  EXPECT_EQ(modes("vn-300"),
            (std::vector<std::string>{"0000", "0205", "0305", "0306", "0002", "0003", "0001", "0306"}));
}

// Bit 8: the heading of the antennas aids the filter; bit 9: the compass has a heading.
TEST(VectorNavSolution, TheCompassIsTheReceivers) {
  Unit unit({{"model", std::string("vn-300")}, {"async_type", std::int64_t{0}}});
  const Sample known = with_antennas(at_30_north(90), 1.25, 0.003);
  EXPECT_EQ(ins_status(unit, known), "0306") << "the truth";
  Sample upright = known;
  upright.navigation.antennas.direction_L = -Vector3::UnitZ();
  EXPECT_EQ(ins_status(unit, upright), "0006");
  EXPECT_EQ(ins_status(unit, aligning(known)), "0205");
  Sample sample = aided(known);
  EXPECT_EQ(ins_status(unit, sample), "0206") << "rejected";
  sample.solution->used = aid::antennas_heading;
  EXPECT_EQ(ins_status(unit, sample), "0306");
  sample.solution->used = 0;
  sample.solution->receiver.antennas.direction_L = -Vector3::UnitZ();
  EXPECT_EQ(ins_status(unit, sample), "0006") << "an upright line";
}

TEST(VectorNavSolution, PositionAndVelocityStayWhenTheFixesAreLost) {
  Unit unit({{"model", std::string("vn-300")}, {"async_type", std::int64_t{0}}});
  const std::size_t time = 0, longitude = 7, east = 10;
  const auto coasts = [&](double east_deg, double since_fix_s) {
    Sample sample = coasting(at_30_north(east_deg), since_fix_s);
    sample.navigation.gps_ns += static_cast<std::int64_t>(since_fix_s * 1e9);
    sample.navigation.v_L.y() = since_fix_s;
    return ins_words(unit, sample);
  };
  ins_words(unit, aided(at_30_north(90)));
  EXPECT_EQ(coasts(90.1, 44)[longitude], "+090.10000000");
  for (const double since : {46.0, 50.0}) {
    const auto lost = coasts(90.2, since);
    EXPECT_EQ(lost[longitude], "+090.10000000");
    EXPECT_EQ(lost[east], "+044.000");
  }
  EXPECT_NE(coasts(90.2, 60)[time], coasts(90.2, 46)[time]) << "its clock goes on";
  const auto back = ins_words(unit, aided(at_30_north(90.3)));
  EXPECT_EQ(back[longitude], "+090.30000000");
  EXPECT_EQ(back[east], "+020.000");
}

// The manual of the VersaSync, page 352: position and velocity are no longer updated. Their uncertainties are still
// those that the filter expects.
TEST(VectorNavSolution, TheUncertaintyGrowsOnWhileThePlaceStays) {
  Unit unit({{"model", std::string("vn-300")}, {"async_type", std::int64_t{0}}});
  const auto lost = [&](double since_fix_s, double position) {
    const PhaseSigmas sigmas = {.velocity = 3, .position = position};
    const auto words = ins_words(unit, coasting(at_30_north(90), since_fix_s, sigmas));
    return words[2] + "," + words[13] + "," + words[14];
  };
  EXPECT_EQ(lost(44, 20), "0002,20.0,3.00");
  EXPECT_EQ(lost(46, 25), "0003,25.0,3.00");
  EXPECT_EQ(lost(90, 70), "0003,70.0,3.00");
}

// Both receivers, the health of the compass's signals and its start-up: they have nothing without a fix, although the
// solution coasts, and everything while it aligns.
TEST(VectorNavSolution, ReceiversReportTheirOwnFix) {
  Unit unit(
      {{"model", std::string("vn-300")}, {"async_type", std::int64_t{0}}, {"firmware", std::string("3.0.0.0")}});
  Sample known = at_30_north(90);
  known.navigation.satellites = 9;
  const auto read = [&](const Sample& sample, const char* id) {
    unit.sample = sample;
    unit.run(1);
    const std::string answer = unit.ask("VNRRG," + std::string(id));
    return answer.substr(0, answer.find('*'));
  };
  Sample moved = coasting(known, 5);
  moved.navigation.longitude += 0.1;
  for (const char* id : {"58", "59", "103", "104", "86", "98"}) {
    const std::string of_truth = read(known, id), none = read(moved, id);
    EXPECT_EQ(read(aligning(known), id), of_truth);
    EXPECT_EQ(read(aided(known), id), of_truth);
    EXPECT_NE(none, of_truth);
    EXPECT_EQ(read(aligning(known, false), id), none);
    const std::size_t first = none.find(',', 7);
    EXPECT_EQ(none.find_first_of("123456789", first), std::string::npos) << none << ": all are 0";
  }
  EXPECT_NE(read(moved, "63").find("+095.7"), std::string::npos) << "the solution goes on";
}

// The receivers' data have the time of the fix, the solution the present time.
TEST(VectorNavSolution, ReceiversReportTheTimeOfTheirFix) {
  Unit unit({{"model", std::string("vn-300")}, {"async_type", std::int64_t{0}}});
  const Sample known = at_30_north(90);
  unit.sample = between_fixes(known, std::chrono::milliseconds(150));
  const auto time_of_week = [&](const char* id) {
    unit.run(1);
    return std::stod(unit.ask("VNRRG," + std::string(id)).substr(10));
  };
  const double now = 1e-9 * static_cast<double>(known.navigation.gps_ns % gps_week_ns);
  for (const char* id : {"58", "59"}) EXPECT_NEAR(time_of_week(id), now - 0.15, 2e-6) << id;
  EXPECT_NEAR(std::stod(unit.ask("VNRRG,103").substr(11)), now - 0.15, 2e-6);
  EXPECT_GT(time_of_week("63"), now - 1e-6) << "of the solution";
  unit.sample = aided(known);
  EXPECT_GT(time_of_week("58"), now - 1e-6) << "each sample has a fix";
}

// SyncOut follows the pulse of the receiver, which has none without a fix.
TEST(VectorNavSolution, NoPulseWithoutAFix) {
  Unit unit({{"model", std::string("vn-300")}, {"async_type", std::int64_t{0}}});
  const auto pulses = [&](const Sample& sample, int seconds) {
    unit.sample = sample;
    for (int k = 0; k < seconds; ++k) {
      unit.sample.navigation.gps_ns += 1'000'000'000;
      if (unit.sample.solution && unit.sample.fix().is_known) unit.sample.solution->receiver = unit.sample.navigation;
      unit.wait(std::chrono::seconds(1));
      unit.run(1);
    }
    const std::string answer = unit.ask("VNRRG,33");
    return std::stoi(answer.substr(answer.rfind(',') + 1));
  };
  const int first = pulses(aided(at_30_north(90)), 3);
  const int more = pulses(aided(at_30_north(90)), 3);
  EXPECT_GT(more, first);
  EXPECT_EQ(pulses(coasting(at_30_north(90), 5), 3), more);
}

TEST(VectorNavSolution, UncertaintiesAreTheFilters) {
  Unit unit({{"model", std::string("vn-200")}, {"async_type", std::int64_t{0}}});
  const Sample known = at_30_north(90);
  const auto of = [&](const Sample& sample) {
    const auto words = ins_words(unit, sample);
    return words[12] + "," + words[13] + "," + words[14];
  };
  EXPECT_EQ(of(known), "00.5,01.0,0.05") << "of the truth";
  EXPECT_EQ(of(aligning(known)), "180.0,01.0,0.05") << "any attitude; the place is the receiver's";
  EXPECT_EQ(of(aided(known)), "00.5,01.0,0.10");
  EXPECT_EQ(of(coasting(known, 30, {.velocity = 2, .position = 30})), "00.5,30.0,2.00");
}

// The compensated measurements are those less the biases; the others, and increments as delivered, are not.
TEST(VectorNavSolution, BiasesAreSubtracted) {
  Unit unit({{"async_type", std::int64_t{0}}});
  Sample sample = aided(at_30_north(90));
  sample.rate = {0.5, 0, 0};
  sample.solution->gyro_bias = {0.125F, 0, 0};
  sample.solution->accelerometer_bias = {0, 0, 0.5F};
  unit.sample = sample;
  unit.run(1);
  EXPECT_EQ(unit.ask("VNRRG,19").substr(10, 10), "+00.375000");
  EXPECT_EQ(unit.ask("VNRRG,18").substr(10, 23), "+00.000,+00.000,-10.307");
  EXPECT_NE(unit.ask("VNRRG,54").find("-09.807,+00.500000"), std::string::npos) << unit.ask("VNRRG,54");
  sample.solution.reset();
  unit.sample = sample;
  unit.run(1);
  EXPECT_EQ(unit.ask("VNRRG,19").substr(10, 10), "+00.500000");
}

// The filter's biases include those that the host has set, which are not subtracted twice.
TEST(VectorNavSolution, BiasesOfTheHostAreSubtractedOnce) {
  Unit unit({{"async_type", std::int64_t{0}}});
  unit.ask("VNWRG,84,2,0,0,0,1,0,0,0,1,0.0625,0,0");
  unit.ask("VNWRG,25,1,0,0,0,1,0,0,0,2,0,0,0.25");
  const auto three = [&](const Sample& sample, const char* request) {
    unit.sample = sample;
    unit.run(1);
    return unit.ask(request).substr(10, 32);
  };
  Sample sample = aided(at_30_north(90));
  sample.rate = {0.5, 0, 0};
  sample.solution->gyro_bias = {0.125F, 0, 0};
  sample.solution->accelerometer_bias = {0, 0, 0.5F};
  EXPECT_EQ(three(sample, "VNRRG,19").substr(0, 10), "+00.750000") << "2 (0.5 - 0.125)";
  EXPECT_EQ(three(sample, "VNRRG,18").substr(0, 23), "+00.000,+00.000,-20.613") << "2 (-9.80665 - 0.5)";
  sample.solution->state = Solution::State::levelled;
  EXPECT_EQ(three(sample, "VNRRG,19").substr(0, 10), "+00.750000");
  EXPECT_EQ(three(sample, "VNRRG,18").substr(0, 23), "+00.000,+00.000,-20.113") << "2 (-9.80665 - 0.25)";
  sample.solution->state = Solution::State::aligning;
  EXPECT_EQ(three(sample, "VNRRG,19").substr(0, 10), "+00.875000") << "2 (0.5 - 0.0625)";
}

// A VN-100 has an attitude, and no place.
TEST(VectorNavSolution, AnAttitudeAlone) {
  Unit unit({{"async_type", std::int64_t{0}}});
  const auto sent = [&](const Sample& sample) {
    unit.sample = sample;
    return binary_frame(unit, "10,0101");  // the status of the VPE and the uncertainty of yaw, pitch and roll
  };
  Sample known = at_30_north(90);
  known.status = status::gyro_saturated_x << 1;
  const auto vpe = [&](const Sample& sample) { return number_at<std::uint16_t>(sent(sample), 4); };
  EXPECT_EQ(vpe(known), 0) << "of the truth";
  EXPECT_EQ(vpe(aligning(known)), 3 | 1 << 2) << "not tracking, and a saturated gyro";
  Sample levelled = navigating(known, Solution::State::levelled, {});
  levelled.navigation = {};
  EXPECT_EQ(vpe(levelled), 1 << 2);
  const std::string frame = sent(levelled);
  EXPECT_NEAR(number_at<float>(frame, 6), 0.8, 1e-6) << "yaw";
  EXPECT_NEAR(number_at<float>(frame, 10), 0.2, 1e-6);
}

}  // namespace
}  // namespace imud
