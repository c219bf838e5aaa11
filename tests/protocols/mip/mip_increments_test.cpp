// Increments, and differences of time and ticks, are those since the last packet that contained them (mip_sdk
// e5a847d, data_sensor.h, delta theta: over the period set by the message format; data_shared.h).
#include <gtest/gtest.h>

#include "tests/protocols/mip/mip_unit.hpp"

namespace imud::mip_test {
namespace {

// A unit at a constant rate: 1 mrad and 1 g ms in each sample.
Unit turning() {
  Unit unit;
  unit.sample.delta_angle = {1e-3, 0, 0};
  unit.sample.delta_velocity = {9.80665e-3, 0, 0};
  return unit;
}
void set_format(Unit& unit, const Bytes& descriptors, std::uint8_t decimation, std::uint8_t set = 0x80) {
  Bytes format = {1, set, static_cast<std::uint8_t>(descriptors.size())};
  for (const std::uint8_t descriptor : descriptors)
    for (const std::uint8_t byte : {descriptor, std::uint8_t{0}, decimation}) format.push_back(byte);
  EXPECT_EQ(unit.code(command(0x0C, 0x0F, format)), 0);
}
// Returns the next packet of that set.
Bytes first(Unit& unit, std::uint8_t set = 0x80) {
  for (int k = 0; k < 2000; ++k)
    for (const Bytes& packet : unit.run(1))
      if (packet[2] == set) return packet;
  return {};
}
void expect_milliseconds(const Bytes& packet, int milliseconds, const char* what) {
  SCOPED_TRACE(what);
  EXPECT_FLOAT_EQ(number(field(packet, delta_angle), 0), 1e-3F * static_cast<float>(milliseconds));
  EXPECT_FLOAT_EQ(number(field(packet, delta_velocity), 0), 1e-3F * static_cast<float>(milliseconds));
  EXPECT_EQ(number_at<std::uint32_t>(field(packet, delta_ticks), 0), static_cast<std::uint32_t>(milliseconds));
  EXPECT_DOUBLE_EQ(number_at<double>(field(packet, delta_time), 0), 1e-3 * milliseconds);
  EXPECT_EQ(number_at<std::uint64_t>(field(packet, reference_delta), 0),
            1'000'000U * static_cast<unsigned>(milliseconds));
}
const Bytes all_of_them = {delta_angle, delta_velocity, delta_ticks, delta_time, reference_delta};

TEST(MipIncrements, BeginWithTheStream) {
  Unit unit = turning();
  unit.run(10'001);
  set_format(unit, all_of_them, 10);
  expect_milliseconds(first(unit), 10, "format, after 10 s of another");
  expect_milliseconds(first(unit), 10, "and on");
  EXPECT_EQ(unit.code(command(0x01, 0x02)), 0);
  unit.run(1000);
  EXPECT_EQ(unit.code(command(0x01, 0x06)), 0);
  expect_milliseconds(first(unit), 10, "idle, resume");
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 0x80, 0})), 0);
  unit.run(1000);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 0x80, 1})), 0);
  expect_milliseconds(first(unit), 10, "stream off and on");
  unit.run(4);
  EXPECT_EQ(unit.code(command(0x0C, 0x11, {1, 0x80, 1})), 0);
  expect_milliseconds(first(unit), 10, "on that was on");
  EXPECT_EQ(unit.code(command(0x0C, 0x08, {3})), 0);
  for (const std::uint8_t command_of : Bytes{0x08, 0x30}) {
    set_format(unit, {reference}, 10);
    unit.run(1000);
    EXPECT_EQ(unit.code(command(0x0C, command_of, {4})), 0);
    expect_milliseconds(first(unit), 10, "load");
  }
  EXPECT_EQ(unit.code(command(0x01, 0x02)), 0);
  unit.run(1004);
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  expect_milliseconds(first(unit), 6, "reset");
  unit.run(4);
  unit.device->power_on(unit.now);
  expect_milliseconds(first(unit), 6, "power");
}

TEST(MipIncrements, EachHasItsOwnPeriod) {
  Unit unit = turning();
  EXPECT_EQ(
      unit.code(command(0x0C, 0x0F, {1, 0x80, 3, reference_delta, 0, 10, delta_time, 0, 20, delta_angle, 0, 5})), 0);
  unit.run(101);
  std::vector<Bytes> sent;
  while (sent.size() < 4) sent.push_back(first(unit));
  for (const Bytes& packet : sent) EXPECT_FLOAT_EQ(number(field(packet, delta_angle), 0), 5e-3F);
  EXPECT_EQ(number_at<std::uint64_t>(field(sent[3], reference_delta), 0), 10'000'000U);
  EXPECT_DOUBLE_EQ(number_at<double>(field(sent[3], delta_time), 0), 0.02) << "whatever the other was sent";
}

TEST(MipIncrements, TwiceInAPacketIsTheSameTwice) {
  Unit unit = turning();
  set_format(unit, {delta_angle, delta_angle, reference_delta, reference_delta}, 10);
  const Bytes packet = first(unit), data(packet.begin() + 4, packet.end() - 2);
  ASSERT_EQ(data.size(), 48U);
  EXPECT_TRUE(std::equal(data.begin(), data.begin() + 14, data.begin() + 14));
  EXPECT_TRUE(std::equal(data.begin() + 28, data.begin() + 38, data.begin() + 38));
  EXPECT_NE(number(field(packet, delta_angle), 0), 0);
}

TEST(MipIncrements, APollTakesNothingFromTheStream) {
  Unit unit = turning();
  set_format(unit, all_of_them, 10);
  first(unit);
  unit.run(4);
  Bytes poll = {0x80, 0, 5};
  for (const std::uint8_t descriptor : all_of_them) poll.push_back(descriptor);
  for (int k = 0; k < 2; ++k)
    expect_milliseconds(unit.send(command(0x0C, 0x0D, poll)).at(1), 1, "the last base period");
  expect_milliseconds(first(unit), 10, "stream");
}

// A fault makes the counter wrong by 100, also while the device is reset.
TEST(MipIncrements, AWrongCounterIsInTheTicksAlone) {
  Unit unit;
  set_format(unit, {ticks, delta_ticks}, 1);
  EXPECT_EQ(unit.code(command(0x0C, 0x08, {3})), 0);
  unit.run(10);
  const auto expect_next = [&](std::uint32_t tick) {
    const Bytes packet = first(unit);
    EXPECT_EQ(number_at<std::uint32_t>(field(packet, ticks), 0), tick);
    EXPECT_EQ(number_at<std::uint32_t>(field(packet, delta_ticks), 0), 1U);
  };
  expect_next(10);
  unit.sample.counter_error = 100;
  expect_next(111);
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  expect_next(101);
  unit.sample.counter_error = 0;
  expect_next(2);
}

// data_shared.h, reference timestamp: "Nanoseconds since initialization"; ticks: "since powerup".
TEST(MipIncrements, ReferenceTimeBeginsWithTheDevice) {
  Unit unit;
  set_format(unit, {reference, 0xD1}, 1);
  EXPECT_EQ(unit.code(command(0x0C, 0x08, {3})), 0);
  unit.run(1000);  // the newest sample is that of 0.999 s
  const auto expect_next = [&](std::uint32_t milliseconds) {
    const Bytes packet = first(unit);
    EXPECT_EQ(number_at<std::uint64_t>(field(packet, reference), 0), 1'000'000U * milliseconds);
    EXPECT_EQ(number_at<std::uint32_t>(field(packet, 0xD1), 0), milliseconds);
  };
  expect_next(1000);
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  expect_next(1);
  unit.run(10);
  unit.device->power_on(unit.now);
  expect_next(1);
}

}  // namespace
}  // namespace imud::mip_test
