// A sensor of a unit with a receiver: its search for satellites, and what goes on after a reload.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <optional>
#include <string>

#include "emulator/config/load_config.hpp"
#include "emulator/imu/reload.hpp"
#include "emulator/imu/sensor.hpp"
#include "tests/core/gnss/yuma_text.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

class SensorExchangeTest : public testing::Test {
 protected:
  Config config(const std::string& navigation, const std::string& more = {}) const {
    const std::string file = folder_ / "imud.toml";
    std::ofstream(file) << "[truth]\nport = \"udp:127.0.0.1:9810\"\n[earth]\nframe = \"local\"\nlatitude_deg = "
                           "45\nlongitude_deg = 0\n"
                           "height_m = 100\nstart = 2026-01-07T16:44:30Z\n[[imu]]\nprotocol = \"native\"\n"
                           "port = \"pty:imu1\"\nrate_hz = 50\ngyro.max_rad_per_s = 10\n"
                           "accelerometer.max_m_per_s2 = 200\n"
                        << more << "[imu.navigation]\n"
                        << navigation;
    return load_config(file);
  }
  // At rest in N's origin.
  static Truth rest(TruthTime time) {
    Truth truth;
    truth.time = time;
    truth.has_position = truth.has_velocity = truth.has_specific_force = true;
    truth.specific_force_B = {0, 0, -9.80665};
    return truth;
  }
  // Takes samples until `end`, and calls `look` with each.
  template <class Look>
  static void sense(Sensor& sensor, std::uint64_t end, Look look) {
    Timeline timeline;
    const Grid truths(100);
    std::uint64_t pushed = 0;
    for (std::uint64_t k = sensor.imu().next(); k < end; ++k) {
      for (; truths.offset(pushed) <= sensor.grid().offset(k); ++pushed)
        timeline.push(rest(TruthTime{} + truths.offset(pushed)));
      sensor.sense(timeline, TruthTime{} + sensor.grid().offset(k), k);
      look(sensor.sample());
    }
  }

  ScratchFolder folder_;
};

// A reload has brought a solution with the seed of the configuration.
TEST_F(SensorExchangeTest, AntennasKeepTheSeedOfACommand) {
  const std::string filter = "solution = \"filter\"\nalignment = \"truth\"\nantennas_heading_deg = 1\n";
  const Config before = config(filter), after = config(filter, "gyro.bias_rad_per_s = [0.001, 0, 0]\n");
  const auto heading = [&](std::uint64_t seed, std::optional<std::uint64_t> command) {
    Sensor sensor(before.imus[0], seed, nullptr);
    sensor.begin_run(TruthTime{});
    if (command) sensor.set_seed(*command);
    Reload reload(before, after, before.imus, seed);
    if (reload.sensors.size() != 1) throw std::runtime_error("no sensor is exchanged");
    sensor.exchange(reload.sensors[0]);
    sense(sensor, 200, [](const Sample&) {});
    return sensor.sample().q_LP.z();
  };
  EXPECT_NE(heading(5, std::nullopt), heading(99, std::nullopt));
  EXPECT_EQ(heading(5, 99), heading(99, std::nullopt));
}

// At 50 Hz the first fix of 2 s is in sample 100; a reload keeps it, and a power on loses it.
TEST_F(SensorExchangeTest, TheReceiverSearches) {
  const std::string search = "gnss_first_fix_s = 2\n";
  const Config before = config(search), after = config(search, "gyro.bias_rad_per_s = [0.001, 0, 0]\n");
  Sensor sensor(before.imus[0], 1, nullptr);
  sensor.begin_run(TruthTime{});
  int without = 0;
  const auto count = [&without](const Sample& sample) { without += sample.navigation.is_known ? 0 : 1; };
  sense(sensor, 150, count);
  EXPECT_EQ(without, 100);
  Reload reload(before, after, before.imus, 1);
  ASSERT_EQ(reload.sensors.size(), 1U);
  sensor.exchange(reload.sensors[0]);
  sense(sensor, 200, count);
  EXPECT_EQ(without, 100);
  sensor.restart();  // the last sample counts as the first after it
  EXPECT_FALSE(sensor.sample().navigation.is_known);
  sense(sensor, 400, count);
  EXPECT_EQ(without, 199);
}

// With an almanac, whose week is given modulo 1024, the errors of the position are larger by the dilution.
TEST_F(SensorExchangeTest, AnAlmanacChangesFixes) {
  std::ofstream(folder_ / "mine.yuma") << yuma_text(constellation_week - 2048);
  const std::string errors = "position_noise_m = 2\n", almanac = errors + "gnss_almanac = \"mine.yuma\"\n";
  const auto fix = [&](const std::string& navigation) {
    Sensor sensor(config(navigation).imus[0], 1, nullptr);
    sensor.begin_run(TruthTime{});
    sense(sensor, 1, [](const Sample&) {});
    return sensor.sample().navigation;
  };
  const Navigation without = fix(errors), with = fix(almanac), true_place = fix("");
  EXPECT_EQ(without.satellites, 12);
  EXPECT_EQ(with.satellites, 9);
  EXPECT_NEAR(with.dilution.position, 2.212, 0.005);  // of the constellation's time, 18 s apart
  EXPECT_FLOAT_EQ(with.accuracy_factor, with.dilution.position / 1.44F);
  EXPECT_NEAR((with.r_E - true_place.r_E).norm(),
              double{with.accuracy_factor} * (without.r_E - true_place.r_E).norm(), 1e-6);
  EXPECT_FALSE(fix(almanac + "gnss_mask_deg = 60\n").is_known);
}

}  // namespace
}  // namespace imud
