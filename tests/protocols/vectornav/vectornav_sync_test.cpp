// SyncIn and SyncOut of a VectorNav, and its pulse per second: registers 32, 33 and 55 (VN-100 user manual
// UM001 2.22, pages 66 to 69 and 75; VN-200 user manual UM004, pages 38, 39 and 42).
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "tests/protocols/vectornav/vectornav_unit.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
using namespace vectornav_test;

// Reports an edge at SyncIn `before` the next sample, and takes that sample.
std::vector<std::string> after_edge(Unit& unit, Nanoseconds before = 500us) {
  unit.device->trigger(unit.now + unit.period - before);
  return unit.run(1);
}

std::string status(Unit& unit) {
  const std::string answer = unit.ask("VNRRG,33");
  return answer.substr(10, answer.find('*') - 10);
}

TEST(VectorNavSync, TheManualsRegister32) {
  Unit unit;
  EXPECT_EQ(unit.send("$VNRRG,32*72\r\n"), "$VNRRG,32,3,0,0,0,6,1,0,100000000,0*6B\r\n");
  EXPECT_EQ(unit.ask("VNWRG,32,6,0,0,0,6,1,0,100000000,0"), with_xor("VNWRG,32,6,0,0,0,6,1,0,100000000,0"));
  EXPECT_EQ(unit.send("$VNRRG,32*72\r\n"), "$VNRRG,32,6,0,0,0,6,1,0,100000000,0*6E\r\n") << "UM004, page 38";
}

TEST(VectorNavSync, Register32HasItsRanges) {
  Unit unit;
  for (const char* wrong :
       {"1,0,0,0,0,0,0,0,0", "2,0,0,0,0,0,0,0,0", "7,0,0,0,0,0,0,0,0", "3,2,0,0,0,0,0,0,0", "3,0,65536,0,0,0,0,0,0",
        "3,0,0,0,4,0,0,0,0", "3,0,0,0,5,0,0,0,0", "3,0,0,0,7,0,0,0,0", "3,0,0,0,0,2,0,0,0", "3,0,0,0,0,0,65536,0,0",
        "3,0,0,0,0,0,0,4294967296,0", "3,0,0,0,0,0,0,-1,0", "3,0,0,0,x,0,0,0,0"}) {
    EXPECT_EQ(unit.ask("VNWRG,32," + std::string(wrong)), with_xor("VNERR,07")) << wrong;
  }
  for (const char* right : {"0,0,0,0,0,0,0,0,0", "6,1,65535,0,6,1,65535,4294967295,0"}) {
    const std::string body = "VNWRG,32," + std::string(right);
    EXPECT_EQ(unit.ask(body), with_xor(body));
  }
}

TEST(VectorNavSync, EventsAreCountedAndTimed) {
  Unit unit({{"async_type", std::int64_t{0}}, {"binary_1", std::string("1,1,03,2004,0090")}});
  unit.run(1);
  EXPECT_EQ(status(unit), "0,0,0");
  for (std::uint32_t count = 1; count <= 3; ++count) {
    const auto sent = after_edge(unit);
    ASSERT_EQ(sent.size(), 1U) << "the outputs keep their rate";
    // Common TimeSyncIn, SyncInCnt; Time TimeSyncIn, SyncInCnt.
    EXPECT_EQ(number_at<std::uint64_t>(sent[0], 6), 500'000U);
    EXPECT_EQ(number_at<std::uint32_t>(sent[0], 14), count);
    EXPECT_EQ(number_at<std::uint64_t>(sent[0], 18), 500'000U);
    EXPECT_EQ(number_at<std::uint32_t>(sent[0], 26), count);
    EXPECT_EQ(number_at<std::uint64_t>(unit.run(1).at(0), 6), 1'750'000U);
  }
  unit.wait(1ms);
  EXPECT_EQ(status(unit), "3,2750,0") << "us since the last one";
  EXPECT_EQ(unit.ask("VNWRG,33,7,0,7"), with_xor("VNWRG,33,7,0,7"));
  EXPECT_EQ(status(unit), "3,2750,0") << "only a zero has an effect";
  EXPECT_EQ(unit.ask("VNWRG,33,0,0,7"), with_xor("VNWRG,33,0,0,7"));
  EXPECT_EQ(status(unit), "0,2750,0");
  unit.device->step_clock(-10s);
  unit.now = unit.now - 10s;
  EXPECT_EQ(status(unit), "0,2750,0") << "a clock that is set changes no duration";
  unit.device->power_on(unit.now);
  EXPECT_EQ(status(unit), "0,0,0");
  unit.ask("VNWRG,32,0,0,0,0,0,0,0,0,0");
  after_edge(unit);
  EXPECT_EQ(status(unit), "0,0,0") << "disabled";
}

// With a skip factor of 4, a signal of 1 kHz makes 200 events per second (UM004, page 39).
TEST(VectorNavSync, TheSkipFactorDividesEdges) {
  Unit unit;
  unit.ask("VNWRG,32,3,0,4,0,0,0,0,0,0");
  unit.run(1);
  for (int k = 0; k < 14; ++k) after_edge(unit);
  EXPECT_EQ(status(unit).substr(0, 2), "2,");
  after_edge(unit);
  EXPECT_EQ(status(unit).substr(0, 2), "3,");
}

// Register 30, parameter 1: SyncIn count, SyncIn time, SyncOut count (UM001, page 69).
TEST(VectorNavSync, TextHasTheCountsAppended) {
  Unit unit({{"async_type", std::int64_t{1}}, {"async_hz", std::int64_t{200}}});
  unit.ask("VNWRG,32,3,0,0,0,2,1,0,1000,0");
  const auto appended = [&](const char* mode) {
    unit.ask("VNWRG,30," + std::string(mode) + ",0,0,0,1,0,1");
    unit.run(3);
    const std::string text = after_edge(unit, 250us).at(0);
    return text.substr(text.rfind(','), text.find('*') - text.rfind(','));
  };
  unit.run(1);
  EXPECT_EQ(appended("1"), ",T1");
  EXPECT_EQ(appended("2"), ",T250");
  EXPECT_EQ(appended("3"), ",T13");
  EXPECT_EQ(appended("4"), ",T0") << "a VN-100 has no receiver";
}

TEST(VectorNavSync, AllOutputsWaitForEventsInMode5) {
  Unit unit({{"binary_1", std::string("1,8,01,0001")}, {"binary_2", std::string("1,0,01,0020")}});
  unit.ask("VNWRG,32,5,0,0,0,0,0,0,0,0");
  EXPECT_TRUE(unit.run(800).empty());
  for (int k = 0; k < 3; ++k) {
    const auto sent = after_edge(unit);
    ASSERT_EQ(sent.size(), 3U);
    EXPECT_EQ(sent[0].substr(0, 7), "$VNYMR,");
    EXPECT_TRUE(unit.run(10).empty());
  }
}

TEST(VectorNavSync, OutputsOfRate0WaitForEventsInMode6) {
  Unit unit({{"binary_1", std::string("1,8,01,0001")},
             {"binary_2", std::string("1,0,01,0020")},
             {"async_hz", std::int64_t{0}}});
  EXPECT_EQ(unit.run(8).size(), 1U);
  EXPECT_EQ(after_edge(unit).size(), 1U) << "not in mode 3";
  unit.run(7);
  unit.ask("VNWRG,32,6,0,0,0,0,0,0,0,0");
  EXPECT_EQ(unit.run(800).size(), 100U) << "the other output keeps its rate";
  unit.run(1);
  const auto sent = after_edge(unit);
  ASSERT_EQ(sent.size(), 2U);
  EXPECT_EQ(sent[0].substr(0, 7), "$VNYMR,");
  EXPECT_EQ(sent[1].substr(0, 4), std::string("\xFA\x01\x20\x00", 4));
}

TEST(VectorNavSync, TheImuSamplesAtEventsInMode4) {
  Unit unit({{"async_type", std::int64_t{0}}, {"binary_1", std::string("1,2,01,0820")}});
  unit.ask("VNWRG,32,4,0,0,0,2,1,0,1000,0");
  unit.sample.delta_angle = {1e-3, 0, 0};
  unit.sample.rate = {0.5, 0, 0};
  EXPECT_TRUE(unit.run(100).empty());
  EXPECT_FALSE(unit.device->pulse());
  EXPECT_EQ(unit.ask("VNRRG,19"), with_xor("VNRRG,19,+00.000000,+00.000000,+00.000000")) << "no sample yet";
  EXPECT_EQ(unit.ask("VNRRG,54").find("+00.500000"), std::string::npos) << "nor as sensed";
  EXPECT_EQ(after_edge(unit).size(), 1U);
  EXPECT_TRUE(unit.device->pulse());
  EXPECT_EQ(unit.ask("VNRRG,19"), with_xor("VNRRG,19,+00.500000,+00.000000,+00.000000"));
  unit.run(9);
  EXPECT_TRUE(after_edge(unit).empty()) << "the divisor is of the IMU's samples";
  unit.run(9);
  const auto sent = after_edge(unit);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_FLOAT_EQ(real_at(sent[0], 4 + 12), 20 / 800.0F) << "no increment is lost";
  EXPECT_FLOAT_EQ(real_at(sent[0], 4 + 12 + 4), static_cast<float>(20e-3 / units::degree));
}

TEST(VectorNavSync, APulseLeavesAtEachSample) {
  for (const char* mode : {"1", "2", "3"}) {
    Unit unit;
    unit.ask("VNWRG,32,3,0,0,0," + std::string(mode) + ",1,0,500000,0");
    for (int k = 1; k <= 3; ++k) {
      unit.run(1);
      ASSERT_TRUE(unit.device->pulse());
      EXPECT_EQ(unit.device->pulse()->begin, unit.now);
      EXPECT_EQ(unit.device->pulse()->end - unit.now, 500us);
      EXPECT_EQ(status(unit), "0,0," + std::to_string(k));
    }
  }
  Unit unit;
  unit.ask("VNWRG,32,3,0,0,0,0,1,0,500000,0");
  unit.run(1);
  EXPECT_FALSE(unit.device->pulse());
}

TEST(VectorNavSync, TheSkipFactorDividesPulses) {
  Unit unit;
  unit.ask("VNWRG,32,3,0,0,0,2,1,7,1000,0");
  int pulses = 0;
  for (int k = 1; k <= 800; ++k) {
    unit.run(1);
    if (!unit.device->pulse()) continue;
    EXPECT_EQ(k % 8, 0);
    ++pulses;
  }
  EXPECT_EQ(pulses, 100);
  EXPECT_EQ(status(unit), "0,0,100");
  EXPECT_EQ(unit.ask("VNWRG,33,7,0,0"), with_xor("VNWRG,33,7,0,0"));
  EXPECT_EQ(status(unit), "0,0,0");
}

// Time TimeGpsPps of a VN-200 whose GPS time is 300 us after a whole second at its first sample.
TEST(VectorNavSync, TheReceiverHasAPulsePerSecond) {
  Unit unit(
      {{"model", std::string("vn-200")}, {"async_type", std::int64_t{0}}, {"binary_1", std::string("1,1,02,0020")}});
  unit.sample.navigation.is_known = true;
  std::int64_t gps_ns = 1'420'000'000'000'300'000;
  const auto since_pulse = [&] {
    unit.sample.navigation.gps_ns = gps_ns;
    gps_ns += unit.period.count();
    return number_at<std::uint64_t>(unit.run(1).at(0), 4);
  };
  for (int k = 0; k < 800; ++k) {
    EXPECT_EQ(since_pulse(), 0U) << "there was none yet";
    EXPECT_FALSE(unit.device->pulse());
  }
  EXPECT_EQ(since_pulse(), 300'000U);
  ASSERT_TRUE(unit.device->pulse()) << "SyncOut is in mode 6 as delivered";
  EXPECT_EQ(unit.device->pulse()->begin, unit.now - 300us);
  EXPECT_EQ(unit.device->pulse()->end - unit.device->pulse()->begin, 100ms);
  EXPECT_EQ(since_pulse(), 1'550'000U);
  EXPECT_FALSE(unit.device->pulse());
  unit.device->pps(unit.now + 1ms);
  EXPECT_EQ(since_pulse(), 2'800'000U) << "the pin is for an external receiver";
}

// GPS time is stepped where the first truth follows rest, and where a run follows another.
TEST(VectorNavSync, AStepOfGpsTimeIsNoPulse) {
  Unit unit({{"model", std::string("vn-200")}});
  unit.sample.navigation.is_known = true;
  std::int64_t gps_ns = 1'420'000'000'000'300'000;
  const auto run = [&] {
    unit.sample.navigation.gps_ns = gps_ns;
    gps_ns += unit.period.count();
    unit.run(1);
    return unit.device->pulse().has_value();
  };
  for (const std::int64_t step_ns : {0LL, 1'000'000'000LL, 7'300'000'000LL, -2'500'000'000LL}) {
    gps_ns += step_ns;
    for (int k = 0; k < 80; ++k) EXPECT_FALSE(run()) << step_ns << " ns, sample " << k;
  }
  gps_ns += 1'000'000'000 - gps_ns % 1'000'000'000 - 3 * unit.period.count() / 2;
  for (const bool is_whole_second : {false, false, true, false}) EXPECT_EQ(run(), is_whole_second);
  for (int k = 0; k < 796; ++k) EXPECT_FALSE(run());
  unit.device->step_clock(-20s);
  unit.now = unit.now - 20s;
  EXPECT_FALSE(run());
  EXPECT_FALSE(run());
  EXPECT_TRUE(run()) << "a step of the sensor's clock changes nothing";
}

TEST(VectorNavSync, AnExternalReceiversPulseComesInByAPin) {
  for (const bool is_sync_in : {false, true}) {
    Unit unit({{"model", std::string("vn-200")},
               {"async_type", std::int64_t{0}},
               {"binary_1", std::string("1,1,02,0020")}});
    unit.ask(is_sync_in ? "VNWRG,55,1,2,5,0,0" : "VNWRG,55,1,0,5,0,0");
    const auto since_pulse = [&] { return number_at<std::uint64_t>(unit.run(1).at(0), 4); };
    const auto edge = [&] {
      const DeviceTime time = unit.now + 1ms;
      if (is_sync_in)
        unit.device->trigger(time);
      else
        unit.device->pps(time);
    };
    since_pulse();
    edge();
    EXPECT_EQ(since_pulse(), 250'000U);
    EXPECT_FALSE(unit.device->pulse()) << "no fix";
    unit.sample.navigation.is_known = true;
    since_pulse();
    edge();
    EXPECT_EQ(since_pulse(), 250'000U);
    ASSERT_TRUE(unit.device->pulse());
    EXPECT_EQ(unit.device->pulse()->begin, unit.now - 250us);
  }
}

}  // namespace
}  // namespace imud
