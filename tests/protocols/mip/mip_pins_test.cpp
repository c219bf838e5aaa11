// The pins of a MIP device: pulse per second in and out, events that an edge triggers, and general output.
#include <gtest/gtest.h>

#include "tests/protocols/mip/mip_unit.hpp"

namespace imud::mip_test {
namespace {

Unit unit_with_pins(const char* model) { return Unit({{"model", std::string(model)}}); }

Bytes polled(Unit& unit, std::uint8_t set, std::uint8_t descriptor) {
  const auto answers = unit.send(command(0x0C, 0x0D, {set, 0, 1, descriptor}));
  return answers.size() < 2 ? Bytes() : field(answers[1], descriptor);
}
Bytes synchronization(Unit& unit) { return polled(unit, 0xA0, 0x02); }

// Edges once a second, `after` the whole milliseconds of the clock; returns the pulses out.
std::vector<Device::Pulse> run_with_pulses(Unit& unit, int seconds, Nanoseconds after) {
  std::vector<Device::Pulse> pulses;
  for (int k = 0; k < 1000 * seconds; ++k) {
    if (k % 1000 == 0) unit.device->pps(unit.now + after);
    unit.run(1);
    if (const auto pulse = unit.device->pulse()) pulses.push_back(*pulse);
  }
  return pulses;
}

// The packet is that of the manual of the CV7, "Synchronized Square Wave Output".
TEST(MipPins, AreConfiguredSavedAndRead) {
  Unit unit = unit_with_pins("3dm-cv7-ins");
  const auto pin = [&](std::uint8_t number) {
    return field(unit.send(command(0x0C, 0x41, {2, number})).at(0), 0xC1);
  };
  for (std::uint8_t number = 1; number <= 4; ++number) EXPECT_EQ(pin(number), (Bytes{number, 0, 0, 0})) << "unused";
  EXPECT_EQ(unit.code(hex("75650c07074101010102003a64")), 0) << "pin 1: output, low";
  EXPECT_EQ(pin(1), (Bytes{1, 1, 2, 0}));
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {3, 0})), 0) << "all are saved";
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 1, 0, 0, 0})), 0);
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  EXPECT_EQ(pin(1), (Bytes{1, 1, 2, 0}));
  // No such pin; encoder, UART, analog; a behavior that the feature has not, or none; both pull-up and pull-down.
  for (const Bytes& wrong : {Bytes{5, 1, 1, 0},
                             {0, 1, 1, 0},
                             {1, 3, 1, 0},
                             {1, 5, 0x21, 0},
                             {1, 6, 1, 0},
                             {1, 2, 3, 0},
                             {1, 1, 4, 0},
                             {1, 1, 0, 0},
                             {1, 0, 1, 0},
                             {1, 1, 1, 6},
                             {1, 1, 1, 8}}) {
    Bytes data = wrong;
    data.insert(data.begin(), 1);
    EXPECT_EQ(unit.code(command(0x0C, 0x41, data)), 3) << unsigned{wrong[0]} << ' ' << unsigned{wrong[1]};
  }
  Unit gq7 = unit_with_pins("3dm-gq7"), gx5 = unit_with_pins("3dm-gx5-25");
  EXPECT_EQ(gq7.code(command(0x0C, 0x41, {1, 3, 3, 1, 0})), 0) << "a GQ7 has an encoder";
  EXPECT_EQ(gx5.code(command(0x0C, 0x41, {1, 1, 2, 1, 0})), 1);
  EXPECT_EQ(gx5.code(command(0x0C, 0x28, {1, 3})), 1);
}

// The functions 4 and 5 of the command for one pin, or for all, have the effects of a write.
TEST(MipPins, AreLoadedAndResetOneByOne) {
  Unit unit = unit_with_pins("3dm-cv7-ins");
  const auto feature = [&](std::uint8_t number) {
    return field(unit.send(command(0x0C, 0x41, {2, number})).at(0), 0xC1).at(1);
  };
  const auto states = [&] { return polled(unit, 0xA0, 0x03).at(0); };
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 1, 1, 3, 0})), 0) << "output, high";
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 2, 2, 1, 0})), 0) << "pulse per second, input";
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {3, 0})), 0) << "saved";
  EXPECT_EQ(states(), 1);
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {5, 1})), 0);
  EXPECT_EQ(states(), 0) << "unused";
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {4, 1})), 0);
  EXPECT_EQ(states(), 1);
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 3, 2, 1, 0})), 0);
  EXPECT_EQ(feature(2), 0) << "pin 3 is the input now";
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {4, 2})), 0);
  EXPECT_EQ(feature(2), 2);
  EXPECT_EQ(feature(3), 0) << "there is one input";
  EXPECT_EQ(unit.code(command(0x0C, 0x42, {1, 1, 0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {3, 1})), 0);
  EXPECT_EQ(states(), 0) << "a save drives no pin";
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {4, 0})), 0);
  EXPECT_EQ(states(), 1) << "all are loaded";
}

TEST(MipPins, TheSourceOfThePulse) {
  Unit unit = unit_with_pins("3dm-cv7-ins"), gq7 = unit_with_pins("3dm-gq7");
  const auto source = [](Unit& of) { return field(of.send(command(0x0C, 0x28, {2})).at(0), 0xA8); };
  EXPECT_EQ(source(unit), Bytes{0});
  EXPECT_EQ(source(gq7), Bytes{1});
  for (const std::uint8_t receiver : Bytes{1, 2}) {
    EXPECT_EQ(unit.code(command(0x0C, 0x28, {1, receiver})), 3) << "has none";
    EXPECT_EQ(gq7.code(command(0x0C, 0x28, {1, receiver})), 0);
  }
  EXPECT_EQ(unit.code(command(0x0C, 0x28, {1, 4})), 0);
  EXPECT_EQ(source(unit), Bytes{4});
  EXPECT_EQ(unit.code(command(0x0C, 0x28, {1, 5})), 3);
}

TEST(MipPins, APulseSynchronizesTheTime) {
  Unit unit = unit_with_pins("3dm-cv7-ins");
  run_with_pulses(unit, 2, 300us);
  EXPECT_EQ(synchronization(unit), (Bytes{0, 255})) << "no pin is an input";
  EXPECT_EQ(unit.code(hex("75650c07074101010201003a65")), 0) << "pin 1: pulse per second, input";
  run_with_pulses(unit, 2, 300us);
  EXPECT_EQ(synchronization(unit), (Bytes{0, 255})) << "is not the source";
  EXPECT_EQ(unit.code(hex("75650c04042801031a54")), 0) << "source: GPIO";
  run_with_pulses(unit, 2, 300us);
  EXPECT_EQ(synchronization(unit), (Bytes{1, 0}));
  EXPECT_EQ(number_at<std::uint16_t>(polled(unit, 0x80, 0x12), 10) & 1, 1);
  // The time of the host is that of the last edge, and from then on begins its seconds at edges.
  EXPECT_EQ(number_at<std::uint16_t>(polled(unit, 0x80, 0xD7), 8), 0) << "which second is not known";
  unit.device->pps(unit.now + 300us);
  unit.run(101);  // the second command must come within 250 ms after the edge
  EXPECT_EQ(unit.code(command(0x01, 0x72, {1, 2, 0, 4, 0x3C, 0x51})), 0) << "second 277585";
  EXPECT_EQ(unit.code(command(0x01, 0x72, {1, 1, 0, 0, 0x09, 0x68})), 0) << "week 2408";
  const auto tow = [&] { return number_at<double>(polled(unit, 0x80, 0xD3), 0); };
  EXPECT_NEAR(tow(), 277585 + 0.1007, 1e-9) << "100.7 ms after its edge";
  EXPECT_EQ(number_at<std::uint16_t>(polled(unit, 0x80, 0xD3), 10), 3);
  const Bytes external = polled(unit, 0x80, 0xD7);
  EXPECT_EQ(number_at<std::uint64_t>(external, 0), (2408ULL * 604'800 + 277'585) * 1'000'000'000 + 100'700'000);
  EXPECT_EQ(number_at<std::uint16_t>(external, 8), 1);
  // A sensor's clock that is 200 ppm slow would be 200 us behind after a second.
  unit.run(899);
  unit.device->pps(unit.now + 100us);
  EXPECT_NEAR(tow(), 277586 - 0.0001, 1e-9) << "steered to the edge that comes in 0.1 ms";
  unit.run(1500);
  EXPECT_EQ(synchronization(unit), (Bytes{0, 1})) << "lost";
  EXPECT_EQ(number_at<std::uint16_t>(polled(unit, 0x80, 0xD7), 8), 0);
  EXPECT_EQ(number_at<std::uint16_t>(polled(unit, 0x80, 0xD3), 10), 3) << "the time goes on";
  EXPECT_NEAR(tow(), 277587.4999, 1e-9);
  unit.run(300'000);
  EXPECT_EQ(synchronization(unit), (Bytes{0, 255}));
  // Another input takes the pulse over.
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 3, 2, 1, 0})), 0);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x41, {2, 1})).at(0), 0xC1), (Bytes{1, 0, 0, 0})) << "was reset";
  unit.device->pps(unit.now);
  EXPECT_EQ(synchronization(unit), (Bytes{1, 0}));
  unit.device->power_on(unit.now);
  EXPECT_EQ(synchronization(unit), (Bytes{0, 255}));
}

TEST(MipPins, AGx5HasAnInputWithoutSettings) {
  Unit unit = unit_with_pins("3dm-gx5-25");
  unit.run(10);
  EXPECT_EQ(number_at<std::uint16_t>(polled(unit, 0x80, 0x12), 10), 0);
  unit.device->pps(unit.now);
  EXPECT_EQ(number_at<std::uint16_t>(polled(unit, 0x80, 0x12), 10), 1) << "pulse present";
  unit.run(1102);
  EXPECT_EQ(number_at<std::uint16_t>(polled(unit, 0x80, 0x12), 10), 0);
  unit.device->trigger(unit.now);
  EXPECT_FALSE(unit.device->pulse());
}

// The manual of the CV7, "PPS": a square wave of 50 %, whose rising edge begins a second.
TEST(MipPins, APulsePerSecondOut) {
  Unit unit = unit_with_pins("3dm-cv7-ins");
  EXPECT_EQ(unit.code(command(0x0C, 0x28, {1, 4})), 0) << "generated";
  EXPECT_TRUE(run_with_pulses(unit, 2, 300us).empty()) << "no pin is an output";
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 2, 2, 2, 0})), 0);
  const auto check = [&](Nanoseconds into_second) {
    const auto pulses = run_with_pulses(unit, 3, 300us);
    ASSERT_EQ(pulses.size(), 3U);
    for (const auto& [begin, end] : pulses) {
      EXPECT_EQ((begin.ns - into_second.count()) % 1'000'000'000, 0);
      EXPECT_EQ(end - begin, 500ms);
    }
  };
  check(0ns);
  EXPECT_EQ(synchronization(unit), (Bytes{1, 0}));
  EXPECT_EQ(unit.code(command(0x0C, 0x28, {1, 3})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 1, 2, 1, 0})), 0);
  const std::int64_t begun = unit.now.ns % 1'000'000'000;
  check(Nanoseconds(begun) + 300us);  // the input is passed on
  Unit gq7 = unit_with_pins("3dm-gq7");
  EXPECT_EQ(gq7.code(command(0x0C, 0x41, {1, 1, 2, 2, 0})), 0);
  EXPECT_TRUE(run_with_pulses(gq7, 2, 0ns).empty()) << "no fix";
  gq7.sample.navigation.is_known = true;
  gq7.sample.navigation.gps_ns = 1'000'000'000'250'000'000;  // and stands still
  gq7.run(1);
  EXPECT_FALSE(gq7.device->pulse());
  gq7.sample.navigation.gps_ns = 1'000'000'001'000'000'000 + 400'000;
  gq7.run(1);
  ASSERT_TRUE(gq7.device->pulse());
  EXPECT_EQ(gq7.device->pulse()->begin, gq7.now - 400us) << "of GPS time";
}

// mip_sdk e5a847d, commands_3dm.h: "For events, this is the time of the event trigger".
TEST(MipPins, AnEdgeTriggersAMessage) {
  Unit unit({{"model", std::string("3dm-cv7-ins")},
             {"sensor_fields", std::vector<std::string>{}},
             {"filter_fields", std::vector<std::string>{}}});
  unit.sample.rate = {1, 2, 3};
  const auto edge = [&] {
    unit.device->trigger(unit.now + 250us);
    return unit.run(1);
  };
  unit.run(1000);
  EXPECT_EQ(unit.code(command(0x0C, 0x2E, {1, 2, 1, 3, 4})), 0) << "trigger 2: an edge at pin 3";
  EXPECT_EQ(unit.code(command(0x0C, 0x2F, {1, 5, 2, 2, 0x80, 0, 0, 4, 0xD0, 0xD5, 0x05, 0xD3})), 0)
      << "action 5, by trigger 2: a message";
  EXPECT_TRUE(edge().empty()) << "the pin is unused";
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 3, 4, 1, 0})), 0) << "pin 3 stamps rising edges";
  EXPECT_TRUE(edge().empty()) << "the trigger is disabled";
  EXPECT_EQ(unit.code(command(0x0C, 0x2B, {1, 2, 1})), 0);
  const DeviceTime before = unit.now;
  const auto sent = edge();
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0][2], 0x80);
  EXPECT_EQ(field(sent[0], 0xD0), Bytes{2});
  EXPECT_EQ(number_at<std::uint64_t>(field(sent[0], 0xD5), 0), static_cast<std::uint64_t>(before.ns + 250'000));
  EXPECT_EQ(number(field(sent[0], 0x05), 2), 3);
  EXPECT_TRUE(unit.run(1).empty()) << "once";
  unit.device->trigger(unit.now + 100us);
  unit.device->trigger(unit.now + 600us);
  EXPECT_EQ(unit.run(1).size(), 2U);
  for (const std::uint8_t falling : Bytes{2, 0}) {
    EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 3, static_cast<std::uint8_t>(falling != 0 ? 4 : 0), falling, 0})), 0);
    EXPECT_TRUE(edge().empty());
  }
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 3, 4, 3, 0})), 0) << "either edge";
  EXPECT_EQ(edge().size(), 1U);
  EXPECT_EQ(unit.code(command(0x01, 0x02)), 0);
  EXPECT_TRUE(edge().empty()) << "idle";
  EXPECT_EQ(unit.code(command(0x01, 0x06)), 0);
  unit.device->trigger(unit.now + 1us);
  unit.device->power_on(unit.now);
  EXPECT_TRUE(unit.run(1).empty()) << "what happened before power on";
  // A flood makes as many frames as there is room for.
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 3, 4, 1, 0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x2E, {1, 2, 1, 3, 4})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x2F, {1, 5, 2, 2, 0x80, 0, 0, 1, 0xD0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x2B, {1, 2, 1})), 0);
  for (int k = 0; k < 100; ++k) unit.device->trigger(unit.now + 1us);
  EXPECT_EQ(unit.run(1).size(), 16U);
}

// An edge may be delivered after a power cycle that follows it.
TEST(MipPins, AnEdgeFromBeforePowerOnIsIgnored) {
  Unit unit({{"model", std::string("3dm-cv7-ins")},
             {"sensor_fields", std::vector<std::string>{}},
             {"filter_fields", std::vector<std::string>{}}});
  for (const auto& [setting, data] : {std::pair<std::uint8_t, Bytes>{0x41, {1, 3, 4, 1, 0}},
                                      {0x41, {1, 1, 2, 1, 0}},
                                      {0x28, {1, 3}},
                                      {0x2E, {1, 2, 1, 3, 4}},
                                      {0x2B, {1, 2, 1}},
                                      {0x2F, {1, 5, 2, 2, 0x80, 0, 0, 1, 0xD5}},
                                      {0x30, {3}}})
    EXPECT_EQ(unit.code(command(0x0C, setting, data)), 0) << unsigned{setting};
  unit.run(1000);
  unit.wait(500us);
  unit.device->power_on(unit.now);
  unit.device->trigger(unit.now - 200us);
  unit.device->pps(unit.now - 100us);
  EXPECT_TRUE(unit.run(1).empty());
  EXPECT_EQ(synchronization(unit), (Bytes{0, 255}));
  unit.device->trigger(unit.now + 200us);
  unit.device->pps(unit.now + 100us);
  const auto sent = unit.run(1);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(number_at<std::uint64_t>(field(sent[0], 0xD5), 0), 1'200'000U) << "ns since power-on";
  EXPECT_EQ(synchronization(unit), (Bytes{1, 0}));
}

TEST(MipPins, AnEdgeDrivesAnOutput) {
  Unit unit = unit_with_pins("3dm-cv7-ahrs");
  unit.run(1);
  const auto states = [&] { return polled(unit, 0xA0, 0x03).at(0); };
  const auto edge = [&] {
    unit.device->trigger(unit.now + 250us);
    unit.run(1);
    return unit.device->pulse();
  };
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 3, 4, 1, 0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 1, 1, 2, 0})), 0) << "output, low";
  EXPECT_EQ(unit.code(command(0x0C, 0x2E, {1, 1, 1, 3, 4})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x2B, {1, 1, 1})), 0);
  const auto act = [&](std::uint8_t mode) { return unit.code(command(0x0C, 0x2F, {1, 1, 1, 1, 1, mode})); };
  EXPECT_EQ(act(1), 0) << "high while active";
  const auto pulse = edge();
  ASSERT_TRUE(pulse);
  EXPECT_EQ(pulse->begin, unit.now) << "at the next tick";
  EXPECT_EQ(pulse->end - pulse->begin, 1ms);
  EXPECT_EQ(states(), 0);
  unit.run(1);
  EXPECT_FALSE(unit.device->pulse());
  const std::pair<std::uint8_t, int> expected[] = {{5, 1}, {6, 0}, {7, 1}, {7, 0}, {0, 0}};
  for (const auto& [mode, state] : expected) {
    EXPECT_EQ(act(mode), 0);
    EXPECT_FALSE(edge());
    EXPECT_EQ(states(), state) << unsigned{mode};
  }
  EXPECT_EQ(act(5), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x2F, {1, 1, 1, 1})), 0) << "neither pin nor mode";
  edge();
  EXPECT_EQ(states(), 0) << "nothing is left of the action before";
  // The host sets and reads the pin itself.
  EXPECT_EQ(unit.code(command(0x0C, 0x42, {1, 1, 1})), 0);
  EXPECT_EQ(field(unit.send(command(0x0C, 0x42, {2, 1})).at(0), 0xC2), (Bytes{1, 1}));
  EXPECT_EQ(unit.code(command(0x0C, 0x42, {1, 3, 1})), 0) << "an input has no effect";
  EXPECT_EQ(states(), 1);
  for (const Bytes& wrong : {Bytes{1, 0, 1}, {1, 5, 1}, {1, 1, 2}, {1, 1}, {3, 1}, {2, 0}, {2}})
    EXPECT_EQ(unit.code(command(0x0C, 0x42, wrong)), 3);
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {1, 2, 1, 3, 0})), 0) << "output, high";
  EXPECT_EQ(states(), 3);
  EXPECT_EQ(unit.code(command(0x0C, 0x41, {3, 0})), 0);
  EXPECT_EQ(unit.code(command(0x0C, 0x42, {1, 2, 0})), 0);
  EXPECT_EQ(states(), 1);
  EXPECT_EQ(unit.code(command(0x01, 0x7E)), 0);
  EXPECT_EQ(states(), 2) << "restored during system startup";
}

TEST(MipPins, AnEdgeThatWaitsForItsSampleEndsWithThePower) {
  Unit unit({{"model", std::string("3dm-cv7-ins")},
             {"sensor_fields", std::vector<std::string>{}},
             {"filter_fields", std::vector<std::string>{}}});
  for (const auto& [setting, data] : {std::pair<std::uint8_t, Bytes>{0x41, {1, 3, 4, 1, 0}},
                                      {0x2E, {1, 2, 1, 3, 4}},
                                      {0x2B, {1, 2, 1}},
                                      {0x2F, {1, 5, 2, 2, 0x80, 0, 0, 1, 0xD5}},
                                      {0x30, {3}}})
    EXPECT_EQ(unit.code(command(0x0C, setting, data)), 0) << unsigned{setting};
  unit.run(1000);
  unit.device->trigger(unit.now + 300us);
  unit.device->power_on(unit.now + 200us);
  EXPECT_TRUE(unit.run(1).empty());
  unit.device->trigger(unit.now + 300us);
  EXPECT_EQ(unit.run(1).size(), 1U) << "the settings are saved";
}

}  // namespace
}  // namespace imud::mip_test
