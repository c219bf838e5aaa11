// DroneCAN: the measurements, byte for byte as pydronecan encodes them (github.com/dronecan/pydronecan at 08cda37,
// DSDL at b4653c7), and transfers of several frames.
#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "protocols/dronecan/gnss.hpp"
#include "protocols/dronecan/messages.hpp"
#include "tests/protocols/dronecan/dronecan_unit.hpp"
#include "tests/protocols/solution_phases.hpp"

namespace imud {
namespace {

using namespace dronecan_test;

constexpr std::string_view golden_raw_imu =
    "1403EB2A#0BAB15CD5B070080 1403EB2A#00000AD7233C6620 1403EB2A#2E66B2CD346F1200 1403EB2A#833A6F1203BBA620 "
    "1403EB2A#9B443B003E80C000 1403EB2A#E8C88FC2753CEC20 1403EB2A#51B8BCA7E8C8BD40";

Sample golden_sample() {
  Sample sample;
  sample.rate = {0.1, -0.2, 0.3};
  sample.specific_force = {1.5, -2.25, -9.81};
  sample.delta_angle = 0.01 * sample.rate;
  sample.delta_velocity = 0.01 * sample.specific_force;
  sample.q_LP = Quaternion(0.927, 0.1, -0.2, 0.3);
  sample.magnetic_field = {0.2e-4, -0.05e-4, 0.45e-4};
  sample.pressure = 101325;
  sample.temperature_c = 25;
  return sample;
}

TEST(DroneCan, EncodesAndDecodesRawImuByteForByte) {
  Unit unit("sample_rate_hz=100 raw_imu_hz=100 priority=20 timestamp=device");
  unit.now.ns = 123'456'789'000;
  EXPECT_EQ(unit.sample(golden_sample()), golden_raw_imu);
  const std::vector<Measurement> decoded = unit.decoded(golden_raw_imu);
  ASSERT_EQ(decoded.size(), 1U);
  const Sample& sample = decoded[0].sample;
  EXPECT_EQ(decoded[0].fields, Measurement::rate | Measurement::specific_force | Measurement::delta_angle |
                                   Measurement::delta_velocity | Measurement::time);
  EXPECT_EQ(sample.time.ns, 123'456'789'000);
  EXPECT_EQ(sample.specific_force, Vector3(1.5, -2.25, -9.8125)) << "the float16 next to -9.81";
  EXPECT_EQ(sample.rate, Vector3(0x1.998p-4, -0x1.998p-3, 0x1.334p-2));
  EXPECT_EQ(sample.delta_angle, Vector3(0.001F, -0.002F, 0.003F));
  EXPECT_EQ(sample.delta_velocity, Vector3(0.015F, -0.0225F, -0.0981F));
}

TEST(DroneCan, SendsAllMessagesOfASampleInOrderOfTheirIdentifiers) {
  Unit unit(
      "sample_rate_hz=100 raw_imu_hz=100 solution_hz=100 magnetic_field_hz=100 static_pressure_hz=100 "
      "static_temperature_hz=100 priority=20 timestamp=device sensor_id=1");
  unit.now.ns = 123'456'789'000;
  EXPECT_EQ(unit.sample(golden_sample()),
            "1403E82A#72FD15CD5B070080 1403E82A#0000662E66B2CD20 1403E82A#346A3B00662E6600 "
            "1403E82A#B2CD3400003E8020 1403E82A#C0E8C840 1403EA2A#01663266AA3337C0 " +
                std::string(golden_raw_imu) + " 1404042A#80E6C5470000C0 1404052A#A95C0000C0");
  Sample nowhere = golden_sample();
  nowhere.magnetic_field.setZero();
  nowhere.pressure = 0;
  EXPECT_EQ(frames_in(unit.sample(nowhere)), 5U + 7U + 1U) << "neither magnetic field nor pressure is known";
}

// Fix2 and Auxiliary of a receiver with a fix, and their place in the order of the identifiers.
TEST(DroneCan, SendsTheFixOfAReceiver) {
  Unit unit("sample_rate_hz=100 raw_imu_hz=0 gnss_fix2_hz=100 gnss_auxiliary_hz=100 priority=20 timestamp=device");
  OwnFigures figures;
  figures.position = {0.5, 0.5, 2};
  figures.velocity = {0.1, 0.1, 0.2};
  unit.device->set_figures(figures);
  unit.now.ns = 123'456'789'000;
  Sample sample;
  Navigation& place = sample.navigation;
  place.is_known = true;
  place.gps_ns = 1'400'000'000'123'456'789;
  place.longitude = 149.16523012 * units::degree;
  place.latitude = -35.36326145 * units::degree;
  place.height = -12.345;
  place.v_L = {1.5, -2.25, 0.1};
  EXPECT_EQ(unit.sample(sample),
            "1404252A#BE069A3EC33D6680 1404252A#3ACD3C663A8F3820 1404252A#8F38186040 "
            "1404272A#897215CD5B070080 1404272A#0000C019492FA920 1404272A#180640001B041400 1404272A#18791FFF89B96F20 "
            "1404272A#F1F3FFFE3E7FFF00 1404272A#0000C03F00001020 1404272A#C0CDCCCC3D330000 1404272A#0600340034004420 "
            "1404272A#1F211F211F29C300 1404272A#3D60");
  place.accuracy_factor = 2;
  EXPECT_NE(unit.sample(sample).find("#06003C003C004C2"), std::string::npos) << "four times the variance";
}

TEST(DroneCan, AFixHasItsOwnTime) {
  Sample known;
  known.navigation.is_known = true;
  known.navigation.gps_ns = 1'400'000'000'250'000'000;
  Sample earlier = known;
  earlier.navigation.gps_ns -= 150'000'000;
  const auto old = dronecan::fix2_of(between_fixes(known, 150ms), {}, 0), wanted = dronecan::fix2_of(earlier, {}, 0);
  EXPECT_TRUE(std::ranges::equal(old.bytes(), wanted.bytes()));
  EXPECT_FALSE(std::ranges::equal(old.bytes(), dronecan::fix2_of(aided(known), {}, 0).bytes()));
}

TEST(DroneCan, AReceiverWithoutAPlaceHasNoFix) {
  Unit unit("sample_rate_hz=100 raw_imu_hz=0 gnss_fix2_hz=100 gnss_auxiliary_hz=50");
  const std::string fix = unit.sample();
  ASSERT_EQ(frames_in(fix), 10U) << "Auxiliary is sent with every second sample";
  const std::string zeros = "#00000000000000";
  std::size_t empty = 0;
  for (std::size_t at = fix.find(zeros); at != fix.npos; at = fix.find(zeros, at + 1)) ++empty;
  EXPECT_EQ(empty, 7U) << "neither time, place, velocity nor status";
  const std::string both = unit.sample();
  EXPECT_EQ(frames_in(both), 13U);
  const std::string three_unknown = "007E007E007E";  // dilutions that are not a number
  EXPECT_NE(both.find(three_unknown), std::string::npos) << both;
}

TEST(DroneCan, IntegratesOverTheIntervalOfEachMessage) {
  Unit unit("raw_imu_hz=200 static_temperature_hz=1");
  Sample sample;
  std::vector<Measurement> measurements;
  std::size_t temperatures = 0;
  double sent = 0, got = 0;
  for (int i = 1; i <= 1000; ++i) {
    unit.pass(1ms);
    sample.delta_angle = {1e-3 * i, 0, 0};
    sample.delta_velocity = {0, -1e-3 * i, 0};
    const std::string text = unit.sample(sample);
    for (const Measurement& one : unit.decoded(text)) measurements.push_back(one);
    temperatures += text.find("1004052A#") != text.npos;
    ASSERT_EQ(text.empty(), i % 5 != 0) << i;
    sent += sample.delta_angle.x();
    if (!text.empty()) {
      ASSERT_FALSE(measurements.empty());
      EXPECT_EQ(text.substr(39, 8), "0AD7A33B") << "the interval: 0.005F";
      got += measurements.back().sample.delta_angle.x();
      EXPECT_NEAR(got, sent, 1e-4);
      EXPECT_EQ(measurements.back().sample.delta_velocity.y(), -measurements.back().sample.delta_angle.x());
    }
  }
  EXPECT_EQ(measurements.size(), 200U);
  EXPECT_EQ(temperatures, 1U);
}

TEST(DroneCan, MayHaveNoIntegrals) {
  Unit unit("sample_rate_hz=100 raw_imu_hz=100 integrals=false");
  const std::vector<Measurement> decoded = unit.decoded(unit.sample(golden_sample()));
  ASSERT_EQ(decoded.size(), 1U);
  EXPECT_EQ(decoded[0].fields, Measurement::rate | Measurement::specific_force);
  EXPECT_TRUE(decoded[0].sample.delta_angle.isZero(0));
}

TEST(DroneCan, MeasuresOnceItIsOperational) {
  Unit unit("start_up_ms=1500 raw_imu_hz=1000");
  Sample sample;
  sample.delta_angle = {1, 0, 0};
  std::size_t measured = 0;
  for (int i = 1; i <= 2000; ++i) {
    unit.pass(1ms);
    const std::string text = unit.sample(sample);
    EXPECT_EQ(text.empty(), i < 1500) << i;
    if (i >= 1500 && measured++ == 0) {
      EXPECT_EQ(unit.decoded(text).at(0).sample.delta_angle.x(), 1) << "nothing was integrated before";
    }
  }
  EXPECT_EQ(measured, 501U);
}

TEST(DroneCan, ADeviceTimeIsTheTimeSincePowerOn) {
  Unit unit("raw_imu_hz=1000 timestamp=device");
  const auto time = [&] { return unit.decoded(unit.sample()).at(0).sample.time.ns; };
  unit.pass(5s);
  EXPECT_EQ(time(), 5'000'000'000);
  unit.device->step_clock(-2s);
  unit.now = unit.now - 2s;
  EXPECT_EQ(time(), 5'000'000'000);
  unit.device->power_on(unit.now);
  unit.pass(3ms);
  EXPECT_EQ(time(), 3'000'000);
}

TEST(DroneCan, EveryTransferHasTheNextId) {
  Unit unit("raw_imu_hz=1000");
  for (unsigned i = 0; i < 100; ++i) {
    const std::string text = unit.sample();
    ASSERT_EQ(frames_in(text), 7U);
    char tail[3];
    std::snprintf(tail, sizeof tail, "%02X", 0x40 + i % 32);
    EXPECT_EQ(text.substr(text.size() - 2), tail);
  }
}

// Every double is rounded to the nearest float16; a reference that tries both neighbours.
TEST(DroneCan, RoundsToTheNearestHalf) {
  using namespace dronecan;
  const auto value = [](std::uint16_t bits) { return from_half(Half(bits)); };
  std::size_t ties = 0;
  for (unsigned bits = 0; bits < 0x7BFF; ++bits) {
    const auto low = static_cast<std::uint16_t>(bits), high = static_cast<std::uint16_t>(bits + 1);
    const double middle = (value(low) + value(high)) / 2;
    const double below = std::nextafter(middle, 0), above = std::nextafter(middle, 1e9);
    ASSERT_EQ(to_half(value(low)).value(), low);
    ASSERT_EQ(to_half(below).value(), low);
    ASSERT_EQ(to_half(above).value(), high);
    ASSERT_EQ(to_half(middle).value(), bits % 2 == 0 ? low : high);
    ASSERT_EQ(to_half(-above).value(), high | 0x8000);
    ++ties;
  }
  EXPECT_EQ(ties, 31743U);
  for (const double huge : {65504.0, 65519.0, 65520.0, 1e300}) EXPECT_EQ(to_half(huge).value(), 0x7BFF);
  EXPECT_EQ(to_half(-1e300).value(), 0xFBFF);
  EXPECT_EQ(to_half(1e-300).value(), 0);
}

TEST(DroneCan, DecodesOneNodeOfSeveral) {
  Unit one("raw_imu_hz=1000 node_id=7"), other("raw_imu_hz=1000 node_id=8"), any("node_id=0");
  Sample sample;
  std::string mixed;
  for (int i = 1; i <= 10; ++i) {
    sample.rate.x() = i;
    const std::string a = one.sample(sample);
    sample.rate.x() = -i;
    const std::string b = other.sample(sample);
    for (std::size_t at = 0; at < a.size(); at += 26) mixed += a.substr(at, 25) + ' ' + b.substr(at, 25) + ' ';
  }
  for (Unit* unit : {&one, &other}) {
    const std::vector<Measurement> decoded = unit->decoded(mixed);
    ASSERT_EQ(decoded.size(), 10U);
    for (int i = 1; i <= 10; ++i)
      EXPECT_EQ(decoded[static_cast<std::size_t>(i) - 1].sample.rate.x(), unit == &one ? i : -i);
  }
  const std::vector<Measurement> first = any.decoded(mixed);
  ASSERT_EQ(first.size(), 10U) << "of the first node from which a whole transfer comes";
  for (const Measurement& measurement : first) EXPECT_LT(measurement.sample.rate.x(), 0);
}

// A covariance, and a time that ns cannot express, are no faults; another length is.
TEST(DroneCan, ChecksTheContentOfRawImu) {
  const auto& protocol = protocol_named("dronecan");
  const auto decode = [&](std::size_t size, std::uint64_t time, std::uint16_t rate) {
    dronecan::RawImuWire wire{};
    wire.time_us = time;
    wire.rate[0] = rate;
    std::array<std::byte, 200> payload = {};
    write_wire(wire, payload);
    FrameBuffer frames;
    dronecan::send({.type = 1003, .source = 42}, dronecan::raw_imu, 0, std::span(payload).first(size), frames);
    Recording recording;
    const auto decoder = protocol.make_decoder(Settings(protocol.settings));
    for (const Frame& frame : frames.frames()) decoder->feed(frame, recording);
    EXPECT_EQ(decoder->errors().malformed, recording.measurements.empty());
    return recording.measurements.size();
  };
  constexpr std::uint64_t latest = (std::uint64_t{1} << 56) - 1;
  EXPECT_EQ(decode(47, 0, 0), 1U);
  EXPECT_EQ(decode(47 + 72, latest, 0), 1U);
  EXPECT_EQ(decode(46, 0, 0), 0U);
  EXPECT_EQ(decode(48, 0, 0), 0U);
  EXPECT_EQ(decode(47 + 74, 0, 0), 0U);
  EXPECT_EQ(decode(5, 0, 0), 0U);
  EXPECT_EQ(decode(47, 0, 0x7C00), 0U) << "infinite";
}

// --- Clocks that are held up or stepped

TEST(DroneCan, AfterAHoldUpThereIsOneNodeStatus) {
  Unit unit;
  unit.pass(10s);
  unit.now = unit.now + 5500ms;
  EXPECT_EQ(frames_in(unit.pass(0s)), 1U);
  EXPECT_EQ(unit.pass(499ms), "");
  EXPECT_EQ(frames_in(unit.pass(1ms)), 1U) << "on its grid";
}

TEST(DroneCan, AStepOfTheClockForgetsNoTransfer) {
  for (const Nanoseconds step : {Nanoseconds(100s), Nanoseconds(-100s)}) {
    Unit unit;
    unit.pass(200s);
    const std::string request = "1E01AA8A#C5";  // GetNodeInfo
    EXPECT_GT(frames_in(unit.answer(request)), 1U);
    unit.device->step_clock(step);
    unit.now = unit.now + step;
    unit.pass(1999ms);
    EXPECT_EQ(unit.answer(request), "") << "it is a repetition";
    unit.pass(1ms);
    EXPECT_GT(frames_in(unit.answer(request)), 1U) << "no more";
    // A transfer that has begun before the step has its 2 s.
    unit.answer("1E0BAA8A#0062000164000083");
    unit.device->step_clock(step);
    unit.now = unit.now + step;
    unit.pass(1999ms);
    EXPECT_EQ(unit.count("transfers_timed_out"), 0U);
    unit.pass(1ms);
    EXPECT_EQ(unit.count("transfers_timed_out"), 1U);
  }
}

TEST(DroneCan, TheOldestTransferGivesWay) {
  const auto from = [](unsigned source, unsigned part) {
    const char* const parts[] = {"0062000164000083", "0000000000726123", "775F696D755F6803", "7A63"};
    char text[48];
    std::snprintf(text, sizeof text, "1E0BAA%02X#%s", 0x80U | source, parts[part]);
    return std::string(text);
  };
  Unit unit;
  for (unsigned part = 0; part < 4; ++part)
    for (unsigned node = 1; node <= 20; ++node) {
      const bool has_answer = !unit.answer(from(node, part)).empty();
      EXPECT_EQ(has_answer, part == 3 && node > 4) << node;
    }
}

TEST(DroneCan, TheTransferIdOfTheMasterOfTimeWraps) {
  const auto sync = [](unsigned transfer_id, unsigned previous_us) {
    char text[48];
    std::snprintf(text, sizeof text, "1400047F#%02X%02X%02X%02X000000%02X", previous_us & 0xFFU,
                  previous_us >> 8 & 0xFFU, previous_us >> 16 & 0xFFU, previous_us >> 24, 0xC0U + transfer_id);
    return std::string(text);
  };
  Unit unit("raw_imu_hz=1000");
  unit.pass(10s);
  unit.answer(sync(31, 0));
  unit.pass(1s);
  unit.answer(sync(0, 5'000'000));
  const auto measurements = unit.decoded(unit.sample());
  ASSERT_EQ(measurements.size(), 1U);
  EXPECT_EQ(measurements[0].sample.time.ns, 6'000'000'000);
}

}  // namespace
}  // namespace imud
