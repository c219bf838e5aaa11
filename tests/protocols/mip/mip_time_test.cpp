// A MIP device's clock runs from power on, whether samples come or not.
#include <gtest/gtest.h>

#include "tests/protocols/mip/mip_unit.hpp"

namespace imud::mip_test {
namespace {

const Bytes ping = hex("756501020201e0c6"), pong = hex("7565010404f10100d56a");

Bytes polled(Unit& unit, std::uint8_t descriptor) {
  const auto answers = unit.send(command(0x0C, 0x0D, {0x80, 1, 1, descriptor}));
  return answers.empty() ? Bytes() : field(answers[0], descriptor);
}
std::uint64_t reference_ns(Unit& unit) { return number_at<std::uint64_t>(polled(unit, reference), 0); }

TEST(MipTime, ACommandCutOffTimesOutWithoutSamples) {
  Unit unit;
  EXPECT_TRUE(unit.send(hex("756501ff")).empty()) << "a packet of 261 bytes begins";
  for (int k = 0; k < 3; ++k) {
    unit.wait(2s);
    EXPECT_EQ(unit.send(ping), std::vector<Bytes>{pong});
  }
}

TEST(MipTime, ACommandCutOffTimesOutThoughNobodyPolls) {
  Unit unit;
  EXPECT_TRUE(unit.send(hex("756501ff")).empty());
  for (int k = 0; k < 3; ++k) {
    unit.now = unit.now + 2s;
    EXPECT_EQ(unit.send(ping), std::vector<Bytes>{pong});
  }
}

TEST(MipTime, TheDeadlineIsThatOfTheFirstByte) {
  Unit unit;
  unit.wait(5s);
  EXPECT_FALSE(unit.device->deadline());
  unit.send(hex("756501ff"));
  const DeviceTime begun = unit.now;
  EXPECT_EQ(unit.device->deadline(), begun + 100ms);
  unit.wait(60ms);
  EXPECT_TRUE(unit.send(ping).empty()) << "is part of the packet so far";
  EXPECT_EQ(unit.device->deadline(), begun + 100ms);
  unit.now = begun + 100ms - 1ns;
  EXPECT_TRUE(unit.poll().empty());
  unit.now = begun + 100ms;
  EXPECT_EQ(unit.poll(), std::vector<Bytes>{pong}) << "only the false start is discarded";
  EXPECT_FALSE(unit.device->deadline());
  // At 9600 bit/s: one and a half times 261 bytes of 10 bits.
  EXPECT_EQ(unit.code(command(0x0C, 0x40, {1, 0, 0, 0x25, 0x80})), 0);
  unit.send({ping.begin(), ping.end() - 1});
  EXPECT_EQ(unit.device->deadline(), unit.now + 407ms);
  EXPECT_TRUE(unit.wait(406ms).empty());
  EXPECT_EQ(unit.send({ping.back()}), std::vector<Bytes>{pong});
}

TEST(MipTime, PowerOnDiscardsAnUnfinishedCommand) {
  Unit unit;
  unit.send(hex("756501ff"));
  unit.device->power_on(unit.now);
  EXPECT_FALSE(unit.device->deadline());
  EXPECT_EQ(unit.send(ping), std::vector<Bytes>{pong});
}

// data_shared.h, reference timestamp: "Nanoseconds since initialization".
TEST(MipTime, ReferenceTimeRunsWithoutSamples) {
  Unit unit;
  EXPECT_EQ(reference_ns(unit), 0U);
  unit.wait(2500ms);
  EXPECT_EQ(reference_ns(unit), 2'500'000'000U);
  unit.device->power_on(unit.now);
  unit.wait(250ms);
  EXPECT_EQ(reference_ns(unit), 250'000'000U);
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  unit.wait(10ms);
  EXPECT_EQ(reference_ns(unit), 10'000'000U);
}

TEST(MipTime, TheFirstSampleCarriesTheSensorsClock) {
  Unit unit({{"sensor_rate_hz", std::int64_t{1000}},
             {"sensor_fields", std::vector<std::string>{"reference_time", "ticks"}},
             {"filter_fields", std::vector<std::string>{}}});
  const auto next = [&] { return number_at<std::uint64_t>(field(unit.run(1).at(0), reference), 0); };
  unit.wait(3s);
  unit.device->power_on(unit.now);
  unit.wait(1s);
  EXPECT_EQ(next(), 4'000'000'000U);
  unit.run(999);
  unit.device->power_on(unit.now);
  unit.wait(50ms);
  const Bytes packet = unit.run(1).at(0);
  EXPECT_EQ(number_at<std::uint64_t>(field(packet, reference), 0), 51'000'000U) << "since it has power";
  EXPECT_EQ(number_at<std::uint32_t>(field(packet, ticks), 0), 1U);
}

// Measurements do not outlive the power.
TEST(MipTime, PowerOnDiscardsTheNewestSample) {
  Unit unit;
  unit.sample.rate = {1, 2, 3};
  unit.run(10);
  EXPECT_EQ(number(polled(unit, 0x05), 1), 2);
  unit.device->power_on(unit.now);
  EXPECT_EQ(polled(unit, 0x05), Bytes(12));
}

TEST(MipTime, DifferencesBeginWithTheStreamThoughNoSamplesCame) {
  Unit unit;
  unit.run(1);
  unit.wait(10s);
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, {1, 0x80, 2, delta_time, 0, 1, reference_delta, 0, 1})), 0);
  unit.wait(3ms);
  const auto sent = unit.run(1);
  ASSERT_FALSE(sent.empty());
  EXPECT_DOUBLE_EQ(number_at<double>(field(sent[0], delta_time), 0), 0.005) << "from the sample due before it";
  EXPECT_EQ(number_at<std::uint64_t>(field(sent[0], reference_delta), 0), 5'000'000U);
}

TEST(MipTime, ACaptureEndsWithoutSamples) {
  Unit unit;
  unit.sample.rate = {0.25, -0.5, 0.125};
  unit.run(1);
  const Bytes capture = command(0x0C, 0x39, {0x03, 0xE8});
  EXPECT_TRUE(unit.send(capture).empty());
  const DeviceTime begun = unit.now;
  unit.run(500);
  EXPECT_EQ(unit.device->deadline(), begun + 1s + 1ns) << "a sample at its end belongs to it";
  EXPECT_TRUE(unit.wait(500ms).empty());
  Bytes answer = {4, 0xF1, 0x39, 0, 14, 0x9B};
  for (const char* number : {"3e800000", "bf000000", "3e000000"})
    for (const std::uint8_t byte : hex(number)) answer.push_back(byte);
  EXPECT_EQ(unit.wait(1ns), std::vector<Bytes>{packet(0x0C, answer)}) << "the mean of those that came";
  EXPECT_FALSE(unit.device->deadline());

  EXPECT_TRUE(unit.send(capture).empty());
  EXPECT_EQ(unit.wait(2s), (std::vector<Bytes>{packet(0x0C, {4, 0xF1, 0x39, 4})})) << "of none";
  EXPECT_EQ(field(unit.send(command(0x0C, 0x38, {2})).at(0), 0x9B), Bytes(answer.begin() + 6, answer.end()));

  unit.sample.rate.x() = 0.5;
  EXPECT_TRUE(unit.send(capture).empty());
  unit.run(1);
  answer[6] = 0x3F, answer[7] = 0;
  EXPECT_EQ(unit.wait(2s), std::vector<Bytes>{packet(0x0C, answer)}) << "of one";
}

TEST(MipTime, GpsTimeOfTheHostRunsOnTheDevicesClock) {
  Unit unit;
  unit.wait(10s);
  EXPECT_EQ(unit.code(command(0x01, 0x72, {1, 2, 0, 4, 0x3C, 0x51})), 0) << "second 277585, at 10 s";
  EXPECT_EQ(unit.code(command(0x01, 0x72, {1, 1, 0, 0, 0x09, 0x68})), 0) << "week 2408";
  unit.wait(2250ms);
  const auto expect = [&](double seconds) {
    const Bytes time = polled(unit, gps_time);
    EXPECT_DOUBLE_EQ(number_at<double>(time, 0), seconds);
    EXPECT_EQ(number_at<std::uint16_t>(time, 8), 2408);
    EXPECT_EQ(number_at<std::uint16_t>(time, 10), 3);
  };
  expect(277587.25);
  unit.device->step_clock(1000s);
  unit.now = unit.now + 1000s;
  expect(277587.25);
  unit.sample.navigation.is_known = true;  // and 1980
  unit.wait(1s);
  unit.run(1);
  expect(277588.25);
}

TEST(MipTime, AClockThatIsSetChangesNoDuration) {
  Unit unit({{"sensor_rate_hz", std::int64_t{100}},
             {"sensor_fields", std::vector<std::string>{"reference_time", "delta_time", "reference_delta"}},
             {"filter_fields", std::vector<std::string>{}}});
  unit.run(1001);
  unit.run(5);
  unit.send(hex("756501ff"));
  unit.send(command(0x0C, 0x39, {0x03, 0xE8}));
  const auto before = unit.device->deadline();
  ASSERT_TRUE(before);
  const auto set = [&](Nanoseconds by) {
    unit.device->step_clock(by);
    unit.now = unit.now + by;
  };
  set(-1004ms);
  EXPECT_EQ(unit.device->deadline(), *before - 1004ms);
  const auto sent = unit.run(5);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_DOUBLE_EQ(number_at<double>(field(sent[0], delta_time), 0), 0.01);
  EXPECT_EQ(number_at<std::uint64_t>(field(sent[0], reference_delta), 0), 10'000'000U);
  EXPECT_EQ(number_at<std::uint64_t>(field(sent[0], reference), 0), 6'000'000U) << "the sensor's own clock";
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), -1) << "is part of the packet so far";
  unit.wait(100ms);
  EXPECT_EQ(reference_ns(unit), 5'000'000U) << "since the reset in it, executed 100 ms after its first byte";
  set(-50ms);
  EXPECT_EQ(reference_ns(unit), 5'000'000U);
}

}  // namespace
}  // namespace imud::mip_test
