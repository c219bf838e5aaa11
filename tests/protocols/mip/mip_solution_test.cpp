// What a MIP device reports while its own filter aligns, is aided, coasts, and is aided again.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "core/attitude.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "tests/protocols/mip/mip_unit.hpp"
#include "tests/protocols/solution_phases.hpp"

namespace imud::mip_test {
namespace {

constexpr PhaseSigmas far_off = {.tilt_deg = 0.4, .heading_deg = 0.9, .velocity = 1.6, .position = 11};
constexpr PhaseSigmas all_high = {.tilt_deg = 0.6, .heading_deg = 1.2, .velocity = 1.6, .position = 11};

// A unit of that model, which streams these fields of the filter with each sample.
class FilterUnit {
 public:
  FilterUnit(const char* model, std::vector<std::uint8_t> descriptors) : unit_({{"model", std::string(model)}}) {
    Bytes format = {1, 0x82, static_cast<std::uint8_t>(descriptors.size())};
    for (const std::uint8_t descriptor : descriptors) format.insert(format.end(), {descriptor, 0, 1});
    EXPECT_EQ(unit_.code(command(0x0C, 0x0F, format)), 0);
  }
  // The last packet of the filter's data in ten samples.
  Bytes packet(const Sample& sample) {
    unit_.sample = sample;
    Bytes last;
    for (const Bytes& one : unit_.run(10))
      if (one[2] == 0x82) last = one;
    return last;
  }
  // State and flags.
  std::pair<int, int> status(const Sample& sample) {
    const Bytes data = field(packet(sample), 0x10);
    return {number_at<std::uint16_t>(data, 0), number_at<std::uint16_t>(data, 4)};
  }
  Unit& unit() { return unit_; }

 private:
  Unit unit_;
};
using Status = std::pair<int, int>;

Sample levelled(const Sample& known) {
  Sample sample = navigating(known, Solution::State::levelled, {});
  sample.navigation = {};
  return sample;
}

TEST(MipSolution, StateAndFlagsOfAGx5) {
  const Sample known = over_boulder();
  FilterUnit ins("3dm-gx5-45", {0x10});
  EXPECT_EQ(ins.status(aligning(known)), Status(1, 0x3000)) << "no attitude, no position and velocity";
  EXPECT_EQ(ins.status(levelled(known)), Status(1, 0x2000)) << "no position and velocity";
  EXPECT_EQ(ins.status(aided(known)), Status(2, 0));
  EXPECT_EQ(ins.status(coasting(known, 5)), Status(2, 0x02)) << "no GNSS";
  EXPECT_EQ(ins.status(coasting(known, 60, far_off)), Status(2, 0x32)) << "position and velocity uncertain";
  EXPECT_EQ(ins.status(coasting(known, 600, all_high)), Status(2, 0x72));
  EXPECT_EQ(ins.status(aided(known)), Status(2, 0));
  FilterUnit ahrs("3dm-gx5-25", {0x10});
  EXPECT_EQ(ahrs.status(aligning(known)), Status(1, 0x1000)) << "no attitude";
  EXPECT_EQ(ahrs.status(levelled(known)), Status(2, 0));
}

TEST(MipSolution, StateAndFlagsOfTheSeries7) {
  const Sample known = over_boulder();
  const int stable = 1, converging = 2;
  FilterUnit cv7("3dm-cv7-ins", {0x10});
  EXPECT_EQ(cv7.status(aligning(known)), Status(1, converging | 0x0C)) << "initialization";
  EXPECT_EQ(cv7.status(levelled(known)), Status(3, stable)) << "AHRS";
  EXPECT_EQ(cv7.status(aided(known)), Status(4, stable)) << "full navigation";
  EXPECT_EQ(cv7.status(coasting(known, 5)), Status(4, converging));
  EXPECT_EQ(cv7.status(coasting(known, 60, far_off)), Status(4, converging | 0x30));
  EXPECT_EQ(cv7.status(aided(known, all_high)), Status(4, converging | 0x3C));
  EXPECT_EQ(cv7.status(aided(known)), Status(4, stable));
  FilterUnit ahrs("3dm-cv7-ahrs", {0x10});
  EXPECT_EQ(ahrs.status(aligning(known)), Status(1, converging | 0x0C));
  EXPECT_EQ(ahrs.status(levelled(known)), Status(3, stable));
}

// A GQ7 waits for its pulse per second, then for the place.
TEST(MipSolution, StateAndFlagsOfAGq7) {
  const Sample known = over_boulder();
  FilterUnit gq7("3dm-gq7", {0x10});
  const auto after = [&](int seconds, const Sample& sample) {
    for (int i = 0; i < 100 * seconds; ++i) gq7.packet(sample);
    return gq7.status(sample);
  };
  EXPECT_EQ(after(0, aligning(known, false)), Status(1, 2 | 0x40C)) << "initialization, no pulse";
  EXPECT_EQ(after(4, aligning(known)), Status(2, 2 | 0x0C)) << "vertical gyro";
  EXPECT_EQ(after(0, aided(known)), Status(4, 1)) << "full navigation, stable";
  EXPECT_EQ(after(0, coasting(known, 5)), Status(4, 2 | 0x400))
      << "converging, and a receiver without a fix has no pulse";
  EXPECT_EQ(after(0, coasting(known, 60, far_off)), Status(4, 2 | 0x430));
  EXPECT_EQ(after(0, aided(known)), Status(4, 1));
}

// Whatever its source of heading, a GQ7 has none while its filter aligns.
TEST(MipSolution, AGq7ThatAlignsIsAVerticalGyroWithoutValidAttitude) {
  const Sample known = over_boulder();
  FilterUnit gq7("3dm-gq7", {0x10, 0x05, 0x06, 0x0A, 0x0B});
  // The magnetometer gives the heading.
  EXPECT_EQ(gq7.unit().code(hex("75650d2b2b52010000040000000000000000000000000000000000000000000000000000000000000000"
                                "000000000296be")),
            0);
  for (int i = 0; i < 400; ++i) gq7.packet(aligning(known));
  const auto valid = [&](const Bytes& packet) {
    std::vector<int> all;
    for (const std::uint8_t descriptor : Bytes{0x05, 0x06, 0x0A, 0x0B}) {
      const Bytes data = field(packet, descriptor);
      all.push_back(number_at<std::uint16_t>(data, data.size() - 2));
    }
    return all;
  };
  EXPECT_EQ(gq7.status(aligning(known)), Status(2, 2 | 0x0C)) << "vertical gyro";
  EXPECT_EQ(valid(gq7.packet(aligning(known))), (std::vector<int>{0, 0, 0, 0}));
  EXPECT_EQ(gq7.status(levelled(known)).first, 3) << "AHRS";
  EXPECT_EQ(valid(gq7.packet(levelled(known))), (std::vector<int>{1, 1, 1, 1}));
  EXPECT_EQ(gq7.status(aided(known)), Status(4, 1));
}

// The heading of two antennas is the receivers', which the filter's place says nothing about.
TEST(MipSolution, AntennasHaveAHeadingWithAFix) {
  const Sample known = over_boulder();
  FilterUnit gq7("3dm-gq7", {0x49});
  const auto tail = [&](const Sample& sample) {
    const Bytes data = field(gq7.packet(sample), 0x49);
    return data.size() < 12 ? Bytes() : Bytes(data.begin() + 12, data.end());
  };
  const Bytes fixed = {2, 0, 7, 0, 1}, none = {0, 0, 0, 0, 0};
  EXPECT_EQ(tail(aligning(known, false)), none);
  EXPECT_EQ(tail(aligning(known)), fixed);
  EXPECT_EQ(tail(aided(known)), fixed);
  EXPECT_EQ(tail(coasting(known, 5)), none);
}

// 0x82,0x49 of mip_sdk, data_filter.hpp: the second of the week, heading and uncertainty in rad, and what is valid.
TEST(MipSolution, AntennasReportWhatTheyMeasure) {
  const Sample known = over_boulder();
  FilterUnit gq7("3dm-gq7", {0x49});
  Sample sample = between_fixes(with_antennas(known, 1.25, 0.003), std::chrono::milliseconds(150), 0);
  sample.q_LP = exp(Vector3(0, 0, 1.2)) * exp(Vector3(0.3, 0.1, 0));
  const auto look = [&] { return field(gq7.packet(sample), 0x49); };
  Bytes data = look();
  EXPECT_NEAR(number(data, 1), 1.25, 1e-6) << "not the filter's";
  EXPECT_FLOAT_EQ(number(data, 2), 0.003F);
  EXPECT_EQ(Bytes(data.begin() + 12, data.end()), (Bytes{2, 0, 7, 0, 1}));
  // The vehicle's x is the sensor's y: its heading is a quarter of a turn further.
  EXPECT_EQ(gq7.unit().code(command(0x0C, 0x31, {1, 0, 0, 0, 0, 0, 0, 0, 0, 0x3F, 0xC9, 0x0F, 0xDB})), 0);
  sample.q_LP = exp(Vector3(0, 0, 1.2));
  data = look();
  EXPECT_NEAR(std::abs(number(data, 1) - 1.25), units::pi / 2, 1e-6);
  // Between two epochs the heading stays, with its time, which is not late.
  sample.solution->since_epoch = 20;
  sample.q_LP = Quaternion::Identity();
  sample.solution->receiver.antennas.age = std::chrono::milliseconds(100);
  const Bytes later = look();
  EXPECT_EQ(number(later, 1), number(data, 1));
  const double now = 1e-9 * static_cast<double>(known.navigation.gps_ns % gps_week_ns);
  EXPECT_NEAR(number(later, 0), now - 0.1, 0.04) << "a float";
  // An upright line has no heading.
  sample.solution->receiver.antennas.direction_L = {0, 0.1, -0.99};
  data = look();
  EXPECT_EQ(data, Bytes(17, 0));
}

// The receivers' time, and the one of their heading, which stays between two epochs.
TEST(MipSolution, ReceiversReportTheTimeOfTheirFix) {
  const Sample known = over_boulder();
  const double now = 1e-9 * static_cast<double>(known.navigation.gps_ns % gps_week_ns);
  Unit unit({{"model", std::string("3dm-gx5-45")}});
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x81, 2, 0x08, 0, 1, 0x09, 0, 1})), 0);
  const auto gnss = [&](const Sample& sample) {
    unit.sample = sample;
    Bytes last;
    for (const Bytes& one : unit.run(500))
      if (one[2] == 0x81) last = one;
    return last;
  };
  const Bytes old = gnss(between_fixes(known, std::chrono::milliseconds(150)));
  EXPECT_NEAR(number_at<double>(field(old, 0x09), 0), now - 0.15, 1e-9);
  const Bytes utc = field(old, 0x08);
  EXPECT_EQ(number_at<std::uint32_t>(utc, 7), static_cast<unsigned>(std::lround(1e3 * (now - 0.15))) % 1000U) << "ms";
  EXPECT_NEAR(number_at<double>(field(gnss(aided(known)), 0x09), 0), now, 1e-9) << "each sample has a fix";

  FilterUnit gq7("3dm-gq7", {0x49});
  Sample east = between_fixes(known, std::chrono::milliseconds(100), 0);
  east.q_LP = exp(Vector3(0, 0, units::pi / 2));
  const auto heading = [&](const Sample& sample) { return number(field(gq7.packet(sample), 0x49), 1); };
  EXPECT_NEAR(heading(east), units::pi / 2, 1e-6);
  EXPECT_NEAR(heading(between_fixes(known, std::chrono::milliseconds(150))), units::pi / 2, 1e-6) << "as measured";
  EXPECT_NEAR(number(field(gq7.packet(between_fixes(known, std::chrono::milliseconds(150))), 0x49), 0), now - 0.15,
              0.04)
      << "a float";
  EXPECT_NEAR(heading(between_fixes(known, {}, 0)), 0, 1e-6);
}

// A receiver that has lost its fix goes on with its last place, but not into another alignment.
TEST(MipSolution, TheLastFixEndsWithTheAlignmentsBegin) {
  const Sample known = over_boulder();
  Unit unit({{"model", std::string("3dm-gx5-45")}});
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x81, 1, 0x03, 0, 1})), 0);
  const auto latitude = [&](const Sample& sample) {
    unit.sample = sample;
    Bytes last;
    for (const Bytes& one : unit.run(500))
      if (one[2] == 0x81) last = field(one, 0x03);
    EXPECT_FALSE(last.empty());
    return number_at<double>(last, 0);
  };
  EXPECT_EQ(latitude(aligning(known, false)), 0);
  EXPECT_DOUBLE_EQ(latitude(aided(known)), 40);
  EXPECT_DOUBLE_EQ(latitude(coasting(known, 5)), 40);
  EXPECT_EQ(latitude(aligning(known, false)), 0);
}

// The biases are in the axes of the sensor; rate and accelerations, of the vehicle, are reduced by them.
Vector3 three(const Bytes& packet, std::uint8_t descriptor) {
  const Bytes data = field(packet, descriptor);
  return {number(data, 0), number(data, 1), number(data, 2)};
}

TEST(MipSolution, BiasesAndTheirUncertainties) {
  FilterUnit ins("3dm-gx5-45", {0x06, 0x0B, 0x0E, 0x1C, 0x0D, 0x05});
  // Yaw of the sensor in the vehicle: x of the vehicle is y of the sensor.
  EXPECT_EQ(ins.unit().code(command(0x0D, 0x11,
                                    hex("010000000000000000"
                                        "3FC90FDB"))),
            0);
  Sample sample = aided(over_boulder());
  sample.rate = {0.5, 0.25, 0};
  sample.specific_force = {1, 2, -10};
  sample.solution->gyro_bias = {0.125F, 0, 0};
  sample.solution->gyro_bias_sigma = {0.001F, 0.002F, 0.003F};
  sample.solution->accelerometer_bias = {0, 0.5F, 0};
  const Bytes with = ins.packet(sample);
  EXPECT_EQ(three(with, 0x06), Vector3(0.125, 0, 0));
  EXPECT_LT((three(with, 0x0B) - Vector3(0.001, 0.002, 0.003)).norm(), 1e-9);
  sample.solution->gyro_bias.setZero();
  sample.solution->accelerometer_bias.setZero();
  const Bytes without = ins.packet(sample);
  const Vector3 of_rate = three(without, 0x0E) - three(with, 0x0E),
                of_force = three(without, 0x1C) - three(with, 0x1C);
  EXPECT_NEAR(of_rate.norm(), 0.125, 1e-6);
  EXPECT_NEAR(std::abs(of_rate.y()), 0.125, 1e-6) << "of the sensor's x";
  EXPECT_NEAR(of_force.norm(), 0.5, 1e-6);
  EXPECT_NEAR(std::abs(of_force.x()), 0.5, 1e-6) << "of the sensor's y";
  EXPECT_LT((three(without, 0x0D) - three(with, 0x0D) - of_force).norm(), 1e-6);
}

// The filter's biases include those that the host has set, which are not subtracted twice.
TEST(MipSolution, BiasesOfTheHostAreSubtractedOnce) {
  FilterUnit ins("3dm-gx5-45", {0x06, 0x0E, 0x1C, 0x0D});
  // 0.0625 rad/s about x, 0.01 g along y.
  EXPECT_EQ(ins.unit().code(command(0x0C, 0x38, hex("013D8000000000000000000000"))), 0);
  EXPECT_EQ(ins.unit().code(command(0x0C, 0x37, hex("01000000003C23D70A00000000"))), 0);
  Sample sample = aided(over_boulder());
  sample.rate = {0.5, 0.25, 0};
  sample.specific_force = {1, 2, -10};
  sample.solution->gyro_bias = {0.125F, 0, 0};
  sample.solution->accelerometer_bias = {0, 0.5F, 0};
  const Bytes both = ins.packet(sample);
  EXPECT_LT((three(both, 0x06) - Vector3(0.0625, 0, 0)).norm(), 1e-7) << "the rest of the filter's";
  EXPECT_LT((three(both, 0x0E) - Vector3(0.375, 0.25, 0)).norm(), 1e-6);
  EXPECT_LT((three(both, 0x1C) - Vector3(1, 1.5, -10)).norm(), 1e-5);
  EXPECT_LT((three(both, 0x0D) - three(both, 0x1C) - Vector3(0, 0, 9.8)).norm(), 0.02) << "less gravity";
  const Bytes aligns = ins.packet(aligning(sample));
  EXPECT_EQ(three(aligns, 0x06), Vector3::Zero());
  EXPECT_LT((three(aligns, 0x0E) - Vector3(0.4375, 0.25, 0)).norm(), 1e-6) << "less the host's";
}

// The accelerometers' are there with a place alone.
TEST(MipSolution, BiasesOfTheAccelerometersAndTheirUncertainties) {
  FilterUnit ins("3dm-gx5-45", {0x07, 0x0C});
  EXPECT_EQ(ins.unit().code(command(0x0C, 0x37, hex("01000000003C23D70A00000000"))), 0);  // 0.01 g along y
  Sample sample = aided(over_boulder());
  sample.solution->accelerometer_bias = {0.25F, 0.5F, -0.125F};
  sample.solution->accelerometer_bias_sigma = {0.01F, 0.02F, 0.03F};
  const auto valid = [](const Bytes& packet) {
    return number_at<std::uint16_t>(field(packet, 0x07), 12) + 2 * number_at<std::uint16_t>(field(packet, 0x0C), 12);
  };
  const Bytes navigates = ins.packet(sample);
  EXPECT_LT((three(navigates, 0x07) - Vector3(0.25, 0.5 - 0.0980665, -0.125)).norm(), 1e-6) << "beside the host's";
  EXPECT_LT((three(navigates, 0x0C) - Vector3(0.01, 0.02, 0.03)).norm(), 1e-8);
  EXPECT_EQ(valid(navigates), 3);
  const Bytes aligns = ins.packet(aligning(sample));
  EXPECT_EQ(three(aligns, 0x07), Vector3::Zero());
  EXPECT_EQ(valid(aligns), 0);
  EXPECT_EQ(valid(ins.packet(levelled(sample))), 0);
  const Bytes of_truth = ins.packet(over_boulder());
  EXPECT_EQ(three(of_truth, 0x07), Vector3::Zero());
  EXPECT_GT(three(of_truth, 0x0C).minCoeff(), 0);
  EXPECT_EQ(valid(of_truth), 3);
}

// Scale factors, in the axes of the sensor: the rest after the biases is divided by them.
TEST(MipSolution, ScaleFactorsAndTheirUncertainties) {
  FilterUnit ins("3dm-gx5-45", {0x16, 0x17, 0x18, 0x19, 0x0E, 0x1C});
  EXPECT_EQ(ins.unit().code(command(0x0D, 0x11,
                                    hex("010000000000000000"
                                        "3FC90FDB"))),
            0)
      << "x of the vehicle is y of the sensor";
  const auto valid = [](const Bytes& packet) {
    int all = 0;
    for (const std::uint8_t descriptor : Bytes{0x16, 0x17, 0x18, 0x19})
      all = 2 * all + number_at<std::uint16_t>(field(packet, descriptor), 12);
    return all;
  };
  Sample sample = aided(over_boulder());
  sample.rate = {0.5, 0.25, 0};
  sample.specific_force = {1, 2, -10};
  const Bytes without = ins.packet(sample);
  EXPECT_EQ(valid(without), 0) << "the filter does not estimate them";
  EXPECT_EQ(three(without, 0x18), Vector3::Zero());
  sample.solution->gyro_bias = {0.125F, 0, 0};
  sample.solution->gyro_scale = {0.25F, 0, 0};
  sample.solution->gyro_scale_sigma = {0.001F, 0.002F, 0.003F};
  const Bytes with = ins.packet(sample);
  EXPECT_EQ(three(with, 0x16), Vector3(0.25, 0, 0));
  EXPECT_LT((three(with, 0x18) - Vector3(0.001, 0.002, 0.003)).norm(), 1e-9);
  EXPECT_EQ(valid(with), 0b1010) << "the gyros' alone";
  const Vector3 of_rate = three(with, 0x0E);  // (0.5 - 0.125)/1.25 about the sensor's x
  EXPECT_NEAR(std::abs(of_rate.y()), 0.3, 1e-6);
  EXPECT_NEAR(std::abs(of_rate.x()), 0.25, 1e-6);
  EXPECT_LT((three(with, 0x1C) - three(without, 0x1C)).norm(), 1e-9);
  sample.solution->accelerometer_scale = {0, 0, -0.5F};
  sample.solution->accelerometer_scale_sigma = {0.001F, 0.002F, 0.003F};
  const Bytes both = ins.packet(sample);
  EXPECT_EQ(valid(both), 0b1111);
  EXPECT_EQ(three(both, 0x17), Vector3(0, 0, -0.5));
  EXPECT_NEAR(three(both, 0x1C).z(), -20, 1e-5);
  EXPECT_EQ(valid(ins.packet(aligning(over_boulder()))), 0);
  EXPECT_EQ(valid(ins.packet(over_boulder())), 0) << "the solution is the truth";
}

// Returns source, type and indicator of each aid.
std::vector<std::array<int, 3>> aids_in(const Bytes& packet) {
  std::vector<std::array<int, 3>> all;
  for (std::size_t at = 4; at + 2 < packet.size() - 2; at += packet[at])
    if (packet[at + 1] == 0x46) all.push_back({packet[at + 6], packet[at + 7], packet[at + 8]});
  return all;
}
using Aids = std::vector<std::array<int, 3>>;

TEST(MipSolution, AidsThatAreUsedOrRejected) {
  const Sample known = over_boulder();
  FilterUnit gq7("3dm-gq7", {0x46});
  const int enabled = 1, used = 3, rejected = 5;
  Sample sample = aided(known);
  sample.solution->used = aid::position | aid::velocity | aid::pressure;
  sample.solution->rejected = aid::antennas_heading;
  const Bytes packet = gq7.packet(sample);
  EXPECT_EQ(aids_in(packet), (Aids{{1, 1, used}, {2, 1, used}, {0, 2, rejected}, {0, 4, used}, {0, 5, enabled}}));
  EXPECT_NEAR(number(field(packet, 0x46), 0), 277'585.25, 0.05) << "s of the week";
  sample = coasting(known, 5);
  sample.solution->used = aid::magnetic_heading;
  EXPECT_EQ(aids_in(gq7.packet(sample)),
            (Aids{{1, 1, enabled}, {2, 1, enabled}, {0, 2, enabled}, {0, 4, enabled}, {0, 5, used}}));
  EXPECT_EQ(gq7.unit().code(command(0x0D, 0x50, {1, 0, 4, 0})), 0);
  EXPECT_EQ(aids_in(gq7.packet(sample)).back(), (std::array{0, 5, 0})) << "the host has switched it off";
  FilterUnit truthful("3dm-gq7", {0x46});
  EXPECT_EQ(aids_in(truthful.packet(known))[2], (std::array{0, 2, enabled})) << "the truth, without antennas";
  EXPECT_EQ(aids_in(truthful.packet(with_antennas(known, 1, 0.01)))[2], (std::array{0, 2, used}));
  FilterUnit cv7("3dm-cv7-ins", {0x46});
  EXPECT_EQ(aids_in(cv7.packet(known)), (Aids{{1, 34, used}, {1, 41, used}, {0, 4, enabled}, {0, 5, enabled}}));
  sample = aided(known);
  sample.solution->used = aid::position;
  sample.solution->rejected = aid::velocity;
  EXPECT_EQ(aids_in(cv7.packet(sample)), (Aids{{1, 34, used}, {1, 41, rejected}, {0, 4, enabled}, {0, 5, enabled}}));
}

// u-blox ZED-F9P interface description, CFG-TP: the pulse of a receiver that has lost its time has a setting of its
// own, with which it is absent.
TEST(MipSolution, AReceiverWithoutAFixHasNoPulse) {
  Unit unit({{"model", std::string("3dm-gq7")}});
  const Sample known = over_boulder();
  const auto synchronization = [&](Sample sample, std::int64_t after_s) {
    sample.navigation.gps_ns += after_s * 1'000'000'000;
    unit.sample = sample;
    unit.run(1);
    const auto sent = unit.send(command(0x0C, 0x0D, {0xA0, 0, 1, 0x02}));
    return sent.size() == 2 ? field(sent[1], 0x02) : Bytes();
  };
  EXPECT_EQ(synchronization(aligning(known, false), 0), (Bytes{0, 255})) << "never";
  EXPECT_EQ(synchronization(aligning(known), 0), (Bytes{1, 0}));
  EXPECT_EQ(synchronization(aided(known), 0), (Bytes{1, 0}));
  EXPECT_EQ(synchronization(coasting(known, 7), 7), (Bytes{0, 7})) << "s since the last one";
  EXPECT_EQ(synchronization(coasting(known, 999), 999), (Bytes{0, 255})) << "at most";
  EXPECT_EQ(synchronization(known, 0), (Bytes{1, 0})) << "of the truth";
}

// While the filter aligns its attitude is not valid, and the time is the receiver's.
TEST(MipSolution, ValidityWhileAligning) {
  FilterUnit ins("3dm-gx5-45", {0x01, 0x05, 0x08, 0x11});
  const Sample known = over_boulder();
  const auto valid = [](const Bytes& packet, std::uint8_t descriptor) {
    const Bytes data = field(packet, descriptor);
    return number_at<std::uint16_t>(data, data.size() - 2);
  };
  const Bytes aligns = ins.packet(aligning(known));
  for (const std::uint8_t descriptor : Bytes{0x01, 0x05, 0x08}) EXPECT_EQ(valid(aligns, descriptor), 0) << descriptor;
  EXPECT_EQ(valid(aligns, 0x11), 1);
  EXPECT_GT(number_at<double>(field(aligns, 0x11), 0), 1e4) << "s of the week";
  const Bytes coasts = ins.packet(coasting(known, 60, far_off));
  for (const std::uint8_t descriptor : Bytes{0x01, 0x05, 0x08, 0x11}) EXPECT_EQ(valid(coasts, descriptor), 1);
  EXPECT_EQ(number(field(coasts, 0x08), 2), 11) << "m down";
}

}  // namespace
}  // namespace imud::mip_test
