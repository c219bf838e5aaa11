// The CANopen device on the bus: states, supervision, emergencies, stored parameters.
#include "tests/protocols/canopen/canopen_unit.hpp"

namespace imud {
namespace {

using canopen_test::Unit;
using namespace std::chrono_literals;

// --- States

TEST(Canopen, BootsUpAndIsPreOperational) {
  Unit unit;
  EXPECT_EQ(unit.device->deadline(), DeviceTime{});
  EXPECT_EQ(unit.pass(0s), "70A#00");
  EXPECT_EQ(unit.step(), "") << "no PDO before a master starts the node";
  EXPECT_EQ(unit.pass(2s), "70A#7F 70A#7F");
}

TEST(Canopen, IsSilentWhileItStartsUp) {
  Unit unit("start_up_ms=50 self_start=true heartbeat_ms=0");
  EXPECT_EQ(unit.step(49ms), "");
  EXPECT_EQ(unit.send("000#0100 60A#4000100000000000 7E5#4C00000000000000 70A#R"), "");
  EXPECT_EQ(unit.step(1ms), "70A#00 18A#000100FE40F60100 28A#000200FC00080100");
  for (const char* reset : {"000#8100", "000#820A"}) {
    EXPECT_EQ(unit.send(reset), "");
    EXPECT_EQ(unit.step(49ms), "");
    EXPECT_EQ(unit.send("60A#4000100000000000"), "");
    EXPECT_EQ(unit.pass(1ms), "70A#00");
    EXPECT_EQ(unit.send("60A#4000100000000000"), "58A#430010009A010400");
  }
}

TEST(Canopen, FollowsTheMastersCommands) {
  Unit unit;
  unit.pass(0s);
  const auto heartbeat = [&] { return unit.pass(1s); };
  EXPECT_EQ(unit.send("000#010B"), "") << "another node";
  EXPECT_EQ(heartbeat(), "70A#7F");
  unit.send("000#010A");
  EXPECT_EQ(heartbeat(), "70A#05");
  EXPECT_EQ(unit.step(0s), "18A#000100FE40F60000 28A#000200FC00080000");
  unit.send("000#0200");
  EXPECT_EQ(heartbeat(), "70A#04");
  EXPECT_EQ(unit.step(0s), "");
  EXPECT_EQ(unit.send("60A#4000100000000000"), "") << "no SDO while stopped";
  unit.send("000#800A");
  EXPECT_EQ(heartbeat(), "70A#7F");
  EXPECT_EQ(unit.send("60A#4000100000000000"), "58A#430010009A010400");
  for (const char* refused : {"000#010A00", "000#01", "000#030A", "000#FF0A"}) EXPECT_EQ(unit.send(refused), "");
  EXPECT_EQ(heartbeat(), "70A#7F");
  EXPECT_EQ(unit.send("000#8200"), "70A#00");
  EXPECT_EQ(unit.send("000#810A"), "70A#00");
  EXPECT_EQ(heartbeat(), "70A#7F");
}

TEST(Canopen, StartsItselfIfItIsTold) {
  Unit unit("self_start=true");
  EXPECT_EQ(unit.pass(1s), "70A#00 70A#05");
  EXPECT_EQ(unit.write(0x1F80, 0, 4, 4), 0U);
  EXPECT_EQ(unit.write(0x1F80, 0, 8, 4), 0x06090030U);
  EXPECT_EQ(unit.send("000#8200"), "70A#00");
  EXPECT_EQ(unit.pass(1s), "70A#05") << "the parameter is loaded again at a reset";
}

TEST(Canopen, ResetOfTheCommunicationKeepsOtherParameters) {
  Unit unit;
  unit.pass(0s);
  EXPECT_EQ(unit.write(0x1017, 0, 500, 2), 0U);
  EXPECT_EQ(unit.write(0x6000, 0, 100, 2), 0U);
  unit.send("000#820A");
  EXPECT_EQ(unit.read(0x1017), 1000U);
  EXPECT_EQ(unit.read(0x6000), 100U);
  unit.send("000#810A");
  EXPECT_EQ(unit.read(0x6000), 10U);
}

// --- Supervision

TEST(Canopen, HeartbeatsKeepTheirGridAndTheirPeriodCanChange) {
  Unit unit("heartbeat_ms=7");
  unit.pass(0s);
  for (int k = 1; k <= 100; ++k) {
    EXPECT_EQ(unit.device->deadline(), DeviceTime{} + k * 7ms);
    EXPECT_EQ(unit.pass(7ms), "70A#7F");
  }
  EXPECT_EQ(unit.write(0x1017, 0, 100, 2), 0U);
  EXPECT_EQ(unit.device->deadline(), unit.now + 100ms);
  EXPECT_EQ(unit.write(0x1017, 0, 0, 2), 0U);
  EXPECT_FALSE(unit.device->deadline());
}

TEST(Canopen, AnswersNodeGuardingWithAToggle) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  EXPECT_EQ(unit.send("70A#R"), "70A#7F");
  EXPECT_EQ(unit.send("70A#R"), "70A#FF");
  unit.send("000#0100");
  EXPECT_EQ(unit.send("70A#R"), "70A#05");
  unit.send("000#8200");
  EXPECT_EQ(unit.send("70A#R"), "70A#7F") << "the toggle begins again";
  Unit beating;
  beating.pass(0s);
  EXPECT_EQ(beating.send("70A#R"), "") << "only one of both";
}

TEST(Canopen, ALifeTimeWithoutGuardingIsAnError) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  unit.write(0x100C, 0, 100, 2);
  unit.write(0x100D, 0, 3, 1);
  unit.send("000#0100");
  EXPECT_EQ(unit.pass(10s), "") << "the first request begins it";
  EXPECT_EQ(unit.send("70A#R"), "70A#05");
  EXPECT_EQ(unit.pass(299ms), "");
  EXPECT_EQ(unit.send("70A#R"), "70A#85");
  EXPECT_EQ(unit.pass(299ms), "");
  EXPECT_EQ(unit.pass(1ms), "08A#3081110400000000");
  EXPECT_EQ(unit.read(0x1001), 0x11U);
  EXPECT_EQ(unit.pass(1s), "");
  EXPECT_EQ(unit.send("70A#R"), "70A#7F 08A#0000000400000000") << "it was operational";
}

TEST(Canopen, NoticesThatAHeartbeatIsLost) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  EXPECT_EQ(unit.write(0x1016, 1, 0x0001'00C8, 4), 0U);  // node 1, 200 ms
  EXPECT_EQ(unit.write(0x1016, 2, 0x0001'0064, 4), 0x06040043U) << "the same node twice";
  EXPECT_EQ(unit.write(0x1016, 2, 0x0080'0064, 4), 0x06090030U);
  EXPECT_EQ(unit.write(0x1016, 2, 0x0002'0064, 4), 0U);
  unit.send("000#0100");
  EXPECT_EQ(unit.pass(10s), "") << "the first heartbeat begins it";
  EXPECT_EQ(unit.send("701#05 703#05"), "");
  EXPECT_EQ(unit.pass(199ms), "");
  EXPECT_EQ(unit.send("701#05"), "");
  EXPECT_EQ(unit.pass(199ms), "");
  EXPECT_EQ(unit.count("heartbeats_lost"), 0U);
  EXPECT_EQ(unit.pass(1ms), "08A#3081110301000000");
  EXPECT_EQ(unit.count("heartbeats_lost"), 1U);
  EXPECT_EQ(unit.read(0x1003, 0), 1U);
  EXPECT_EQ(unit.read(0x1003, 1), 0x0001'8130U);
  EXPECT_EQ(unit.step(), "") << "pre-operational";
  EXPECT_EQ(unit.pass(1s), "");
  EXPECT_EQ(unit.send("701#05"), "08A#0000000301000000");
  EXPECT_EQ(unit.read(0x1001), 0U);
}

// Otherwise the error of what is not supervised any more would last until a reset.
TEST(Canopen, AnErrorEndsWithItsSupervision) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  unit.write(0x1015, 0, 0, 2);
  unit.write(0x1016, 1, 0x0001'00C8, 4);
  unit.write(0x1016, 2, 0x0002'00C8, 4);
  unit.send("701#05 702#05");
  EXPECT_EQ(unit.pass(200ms), "08A#3081110301000000");
  EXPECT_EQ(unit.write(0x1016, 1, 0, 4), 0U);
  EXPECT_EQ(unit.read(0x1001), 0x11U) << "node 2 is still lost";
  EXPECT_EQ(unit.send(unit.request(0x23, 0x1016, 2, 0)), "58A#6016100200000000 08A#0000000301000000");
  unit.write(0x100C, 0, 100, 2);
  unit.write(0x100D, 0, 2, 1);
  unit.send("70A#R");
  EXPECT_EQ(unit.pass(200ms), "08A#3081110400000000");
  EXPECT_EQ(unit.write(0x1017, 0, 0, 2), 0U) << "as before";
  EXPECT_EQ(unit.send(unit.request(0x2F, 0x100D, 0, 0)), "58A#600D100000000000 08A#0000000400000000");
  unit.write(0x1006, 0, 10'000, 4);
  unit.send("080#");
  EXPECT_EQ(unit.pass(15ms), "08A#0081110500000000");
  EXPECT_EQ(unit.send(unit.request(0x23, 0x1006, 0, 0)), "58A#6006100000000000 08A#0000000500000000");
}

// A node has either (CiA 301, 7.2.8): a master that prefers heartbeats need not go on guarding.
TEST(Canopen, HeartbeatsEndTheLifeTime) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  unit.write(0x100C, 0, 100, 2);
  unit.write(0x100D, 0, 3, 1);
  unit.send("000#0100 70A#R");
  EXPECT_EQ(unit.write(0x1017, 0, 400, 2), 0U);
  EXPECT_EQ(unit.pass(400ms), "70A#05");
}

TEST(Canopen, WhatAnErrorOfTheCommunicationDoesIsASetting) {
  const char* expected[] = {"70A#7F", "70A#05", "70A#04"};
  for (unsigned behaviour = 0; behaviour < 3; ++behaviour) {
    Unit unit;
    unit.pass(0s);
    EXPECT_EQ(unit.write(0x1029, 1, behaviour, 1), 0U);
    EXPECT_EQ(unit.write(0x1016, 1, 0x0001'00C8, 4), 0U);
    unit.send("000#0100 701#05");
    EXPECT_EQ(unit.pass(200ms), "08A#3081110301000000");
    EXPECT_EQ(unit.pass(800ms), expected[behaviour]);
  }
  Unit unit;
  unit.pass(0s);
  EXPECT_EQ(unit.write(0x1029, 1, 3, 1), 0x06090031U);
}

// --- Emergencies

TEST(Canopen, ReportsSaturationAndItsEnd) {
  Unit unit("self_start=true heartbeat_ms=0 tpdo1_enabled=false tpdo2_enabled=false");
  unit.pass(0s);
  unit.sample.status = status::gyro_saturated_x << 1;
  EXPECT_EQ(unit.step(), "08A#01FF810002000000");
  EXPECT_EQ(unit.step(), "") << "it goes on";
  unit.sample.status = 0;
  EXPECT_EQ(unit.step(), "") << "within the inhibit time";
  unit.sample.status = status::accelerometer_saturated_x;
  EXPECT_EQ(unit.step(), "");
  unit.sample.status = 0;
  EXPECT_EQ(unit.step(), "");
  EXPECT_EQ(unit.step(60ms), "08A#0000810002000000") << "the register has what is not reported yet";
  EXPECT_EQ(unit.step(100ms), "08A#02FF810108000000") << "a saturation that was short";
  EXPECT_EQ(unit.pass(1s), "08A#0000000108000000");
  EXPECT_EQ(unit.read(0x1003, 0), 2U);
  EXPECT_EQ(unit.read(0x1003, 1), 0x0008'FF02U);
  EXPECT_EQ(unit.read(0x1003, 2), 0x0002'FF01U);
  // CiA 301, 7.5.2.4, and CANopenNode 4, CO_Emergency.c, OD_read_1003(): there is no such error, and no data.
  EXPECT_EQ(unit.read_abort(0x1003, 3), 0x08000024U);
  EXPECT_EQ(unit.write(0x1003, 0, 1, 1), 0x06090030U);
  EXPECT_EQ(unit.write(0x1003, 0, 0, 1), 0U);
  EXPECT_EQ(unit.read(0x1003, 0), 0U);
  EXPECT_EQ(unit.read_abort(0x1003, 1), 0x08000024U);
}

TEST(Canopen, TheIdentifierOfEmergenciesCanChangeOrBeInvalid) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  EXPECT_EQ(unit.read(0x1014), 0x8AU);
  EXPECT_EQ(unit.write(0x1014, 0, 0xB0, 4), 0x06090030U) << "it is valid";
  EXPECT_EQ(unit.write(0x1014, 0, 0x8000'008A, 4), 0U);
  unit.sample.status = status::not_valid;
  EXPECT_EQ(unit.step(), "");
  EXPECT_EQ(unit.read(0x1003, 1), 0x0100'5000U) << "the history has it all the same";
  EXPECT_EQ(unit.write(0x1014, 0, 0x8000'00B0, 4), 0U);
  for (const unsigned restricted : {0x000U, 0x05FU, 0x181U & 0x17FU, 0x60AU, 0x7E5U, 0x2000'008AU})
    EXPECT_EQ(unit.write(0x1014, 0, restricted, 4), 0x06090030U) << restricted;
  EXPECT_EQ(unit.write(0x1014, 0, 0xB0, 4), 0U);
  unit.sample.status = 0;
  EXPECT_EQ(unit.step(), "0B0#0000000200010000");
}

TEST(Canopen, KeepsTheNewestErrors) {
  Unit unit("heartbeat_ms=0");
  unit.pass(0s);
  EXPECT_EQ(unit.write(0x1015, 0, 0, 2), 0U);
  for (unsigned k = 0; k < 20; ++k) {
    unit.sample.status = k % 2 == 0 ? status::gyro_saturated_x << k % 3 : 0;
    EXPECT_EQ(unit.step().size(), 20U);
  }
  EXPECT_EQ(unit.read(0x1003, 0), 8U);
  EXPECT_EQ(unit.read(0x1003, 1), 0x0001'FF01U);
  EXPECT_EQ(unit.read(0x1003, 2), 0x0002'FF01U);
}

TEST(Canopen, AnotherNodeWithItsIdentifiersIsCounted) {
  Unit unit;
  unit.pass(0s);
  unit.send("70A#05 58A#0000000000000000 08A#0000000000000000 18A#01 28A#01");
  EXPECT_EQ(unit.count("node_id_conflicts"), 5U);
  unit.send("70B#05 60A#4000100000000000 70A#R 18B#01 38A#01 000#0100 080#");
  EXPECT_EQ(unit.count("node_id_conflicts"), 5U) << "TPDO3 is not valid";
  EXPECT_EQ(unit.count("syncs"), 1U);
}

// --- Stored parameters

TEST(Canopen, StoresAndRestoresParameters) {
  Unit unit;
  unit.pass(0s);
  unit.write(0x1017, 0, 300, 2);
  unit.write(0x6000, 0, 100, 2);
  EXPECT_EQ(unit.write(0x1010, 1, 0x12345678, 4), 0x08000020U);
  EXPECT_EQ(unit.write(0x1010, 2, 0x65766173, 4), 0U);  // the communication's
  unit.device->power_on(unit.now);
  EXPECT_EQ(unit.pass(0s), "70A#00");
  EXPECT_EQ(unit.read(0x1017), 300U);
  EXPECT_EQ(unit.read(0x6000), 10U);
  unit.write(0x6000, 0, 100, 2);
  EXPECT_EQ(unit.write(0x1010, 1, 0x65766173, 4), 0U);
  unit.device->power_on(unit.now);
  unit.pass(0s);
  EXPECT_EQ(unit.read(0x6000), 100U);
  EXPECT_EQ(unit.write(0x1011, 3, 0x65766173, 4), 0x08000020U);
  EXPECT_EQ(unit.write(0x1011, 3, 0x64616F6C, 4), 0U);  // the application's
  EXPECT_EQ(unit.read(0x6000), 100U) << "until the next reset";
  unit.send("000#8100");
  EXPECT_EQ(unit.read(0x6000), 10U);
  EXPECT_EQ(unit.read(0x1017), 300U);
  EXPECT_EQ(unit.write(0x1011, 1, 0x64616F6C, 4), 0U);
  unit.device->power_on(unit.now);
  unit.pass(0s);
  EXPECT_EQ(unit.read(0x1017), 1000U);
}

// --- Time

TEST(Canopen, NothingChangesWhenItsClockIsStepped) {
  Unit one("self_start=true"), other("self_start=true");
  DeviceTime& now = other.now;
  std::string first, second;
  for (Unit* unit : {&one, &other}) {
    unit->pass(0s);
    unit->write(0x1016, 1, 0x0001'00C8, 4);
    unit->write(0x1800, 5, 30, 2);
    unit->send("701#05");
    unit->sample.status = 1;
  }
  for (int k = 0; k < 100; ++k) {
    first += one.step();
    if (k % 7 == 3) {
      const Nanoseconds by = k % 2 == 0 ? 100s : -50s;
      other.device->step_clock(by);
      now = now + by;
    }
    second += other.step();
    one.sample.status = other.sample.status = k % 13 == 0 ? 1 : 0;
  }
  EXPECT_EQ(first, second);
  EXPECT_GT(first.size(), 500U);
}

TEST(Canopen, ListsNothingWithoutANodeId) {
  const Protocol& protocol = protocol_named("canopen");
  EXPECT_TRUE(protocol.can_messages(settings_of(protocol, "node_id=255"), 100).empty());
  const auto messages = protocol.can_messages(
      settings_of(protocol, "tpdo1_type=4 tpdo2_event_ms=20 tpdo3_enabled=true heartbeat_ms=0"), 200);
  ASSERT_EQ(messages.size(), 7U);
  const double expected[] = {10, 50, 50, 200, 0, 0, 1};
  for (std::size_t i = 0; i < messages.size(); ++i) EXPECT_EQ(messages[i].max_frames_per_s, expected[i]) << i;
  for (const char* wrong : {"node_id=128", "tpdo1=rate_f32", "tpdo1=speed", "tpdo3_type=241", "tpdo3_type=251",
                            "tpdo1_type=256", "tpdo4_type=256"})
    EXPECT_THROW(protocol.make(settings_of(protocol, wrong)), std::invalid_argument) << wrong;
}

// 1029:1 = 0 makes an operational node pre-operational, and changes nothing else.
TEST(Canopen, AnErrorLeavesANodeThatIsNotOperationalAsItIs) {
  for (const auto& [command, state] :
       {std::pair("000#0200", "70A#04"), {"000#8000", "70A#7F"}, {"000#0100", "70A#7F"}}) {
    Unit unit;
    unit.pass(0s);
    EXPECT_EQ(unit.write(0x1016, 1, 0x0001'00C8, 4), 0U);
    unit.send("000#0100 701#05");
    unit.send(command);
    unit.pass(900ms);
    EXPECT_EQ(unit.pass(100ms), state) << command;
  }
}

TEST(Canopen, AfterAHoldUpThereIsOneHeartbeat) {
  Unit unit;
  unit.pass(0s);
  unit.now = unit.now + 5500ms;
  EXPECT_EQ(unit.pass(0s), "70A#7F");
  EXPECT_EQ(unit.pass(499ms), "");
  EXPECT_EQ(unit.pass(1ms), "70A#7F") << "on its grid";
}

}  // namespace
}  // namespace imud
