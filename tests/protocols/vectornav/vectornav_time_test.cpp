// A VectorNav's clock runs from power on, whether samples come or not.
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "tests/protocols/vectornav/vectornav_unit.hpp"

namespace imud {
namespace {

using namespace std::chrono_literals;
using namespace vectornav_test;

// Polls output 2, which consists of Common TimeStartup, and returns it, ns.
std::uint64_t polled_startup(Unit& unit) {
  unit.ask("VNWRG,76,1,0,01,0001");
  return number_at<std::uint64_t>(unit.ask("VNBOM,2"), 4);
}

TEST(VectorNavTime, ACommandCutOffTimesOutWithoutSamples) {
  Unit unit;
  EXPECT_EQ(unit.send("$VNRRG,0"), "");
  unit.wait(1s);
  EXPECT_EQ(unit.send("1*XX\r\n"), with_xor("VNRRG,01,VN-100S-CR")) << "just in time";
  EXPECT_EQ(unit.send("$VNRRG,0"), "");
  unit.wait(1s + 1ns);
  EXPECT_EQ(unit.send("1*XX\r\n"), "");
  for (int k = 0; k < 3; ++k) {
    unit.send("$VNWRG,07,");
    unit.wait(2s);
    EXPECT_EQ(unit.ask("VNRRG,7"), with_xor("VNRRG,7,40"));
  }
}

TEST(VectorNavTime, PowerOnDiscardsAnUnfinishedCommand) {
  Unit unit;
  unit.send("$VNRRG,0");
  unit.device->power_on(unit.now);
  EXPECT_EQ(unit.send("1*XX\r\n"), "");
}

TEST(VectorNavTime, EveryRegisterIsReadBeforeTheFirstSample) {
  for (const char* model : {"vn-100", "vn-200", "vn-300"}) {
    Unit silent({{"model", std::string(model)}}), unit({{"model", std::string(model)}});
    silent.wait(10s);
    unit.sample = Sample();
    unit.run(1);
    int read = 0;
    for (int id = 0; id < 256; ++id) {
      const std::string answer = silent.ask("VNRRG," + std::to_string(id));
      if (id != 80) {
        EXPECT_EQ(answer, unit.ask("VNRRG," + std::to_string(id)));
      }
      read += !answer.starts_with("$VNERR");
    }
    EXPECT_EQ(silent.ask("VNRRG,80"), silent.ask("VNRRG,80")) << "nothing has been added up";
    EXPECT_EQ(silent.ask("VNRRG,80").substr(0, 19), "$VNRRG,80,+0.000000");
    EXPECT_GE(read, 41) << model;
  }
}

TEST(VectorNavTime, TimeSinceStartupRunsWithoutSamples) {
  Unit unit;
  EXPECT_EQ(polled_startup(unit), 0U);
  unit.wait(2500ms);
  EXPECT_EQ(polled_startup(unit), 2'500'000'000U);
  unit.device->power_on(unit.now);
  unit.wait(250ms);
  EXPECT_EQ(polled_startup(unit), 250'000'000U);
  for (const char* reset : {"VNRST", "VNRFS"}) {
    EXPECT_EQ(unit.ask(reset), with_xor(reset));
    unit.wait(10ms);
    EXPECT_EQ(polled_startup(unit), 10'000'000U);
  }
  unit.run(9);
  EXPECT_EQ(polled_startup(unit), 20'000'000U);
  unit.wait(100us);
  EXPECT_EQ(polled_startup(unit), 20'100'000U);
}

TEST(VectorNavTime, AUnitThatGetsPowerAtItsFirstSampleCountsFromThere) {
  Unit unit({{"async_type", std::int64_t{0}}, {"binary_1", std::string("1,1,01,0001")}});
  unit.wait(1000s);
  unit.device->power_on(unit.now);
  for (std::uint64_t k = 0; k < 3; ++k) EXPECT_EQ(number_at<std::uint64_t>(unit.run(1).at(0), 4), 1'250'000 * k);
}

TEST(VectorNavTime, AClockThatIsSetChangesNoDuration) {
  Unit unit({{"async_type", std::int64_t{0}}, {"binary_1", std::string("1,1,01,0001")}});
  const auto startup = [&] { return number_at<std::uint64_t>(unit.run(1).at(0), 4); };
  const auto set = [&](Nanoseconds by) {
    unit.device->step_clock(by);
    unit.now = unit.now + by;
  };
  unit.wait(1s);
  set(5000s);
  EXPECT_EQ(startup(), 1'000'000'000U);
  unit.run(799);
  set(-6000s);
  EXPECT_EQ(startup(), 2'000'000'000U) << "nor does it go back with the clock";
  unit.send("$VNRRG,0");
  set(-100s);
  unit.wait(1s);
  EXPECT_EQ(unit.send("1*XX\r\n"), with_xor("VNRRG,01,VN-100S-CR"));
  unit.send("$VNRRG,0");
  set(-100s);
  unit.wait(1s + 1ns);
  EXPECT_EQ(unit.send("1*XX\r\n"), "");
}

TEST(VectorNavTime, GpsTimeRunsOnFromTheNewestSample) {
  Unit unit({{"model", std::string("vn-200")}});
  unit.sample.navigation.is_known = true;
  unit.sample.navigation.gps_ns = 1'420'000'000'000'000'000;
  unit.run(1);
  unit.wait(2s);
  unit.ask("VNWRG,76,1,0,01,0002");
  EXPECT_EQ(number_at<std::uint64_t>(unit.ask("VNBOM,2"), 4), 1'420'000'002'000'000'000U);
  unit.device->step_clock(-50s);
  unit.wait(-50s);
  EXPECT_EQ(number_at<std::uint64_t>(unit.ask("VNBOM,2"), 4), 1'420'000'002'000'000'000U);
}

// Measurements do not outlive the power.
TEST(VectorNavTime, PowerOnDiscardsTheNewestSample) {
  Unit unit;
  unit.sample.rate = {1, 2, 3};
  unit.run(10);
  EXPECT_EQ(unit.ask("VNRRG,19"), with_xor("VNRRG,19,+01.000000,+02.000000,+03.000000"));
  for (const bool is_power : {true, false}) {
    if (is_power)
      unit.device->power_on(unit.now);
    else
      unit.ask("VNRST");
    EXPECT_EQ(unit.ask("VNRRG,19"), with_xor("VNRRG,19,+00.000000,+00.000000,+00.000000"));
    EXPECT_EQ(unit.ask("VNRRG,80").substr(0, 19), "$VNRRG,80,+0.000000");
    unit.run(1);
  }
}

}  // namespace
}  // namespace imud
