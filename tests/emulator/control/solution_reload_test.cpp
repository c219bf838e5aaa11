// A reload of a unit that computes its own solution, and of what decides the columns of `csv`.
#include "tests/emulator/control/control_client.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/support/text.hpp"

namespace imud {
namespace {

class SolutionReloadTest : public LiveTest {
 protected:
  std::string config_of(const std::string& errors) const {
    return fmt::format(
        "clock = \"lockstep\"\n[control]\nsocket = \"{}\"\nfaults = false\n[truth]\nport = \"{}\"\n[earth]\n"
        "frame = \"local\"\nlatitude_deg = 48\nlongitude_deg = 11\n[[imu]]\nname = \"imu1\"\nrate_hz = 1000\n"
        "protocol = \"csv\"\nport = \"file:{}/out1\"\naccelerometer.max_m_per_s2 = 1000\ngyro.max_rad_per_s = 100\n"
        "navigation.solution = \"filter\"\n{}",
        path("socket"), simulator_.port(), folder_, errors);
  }
};

// Without faults nothing judges the solution; a reload did bring a judge, and the run ended by a fault of memory.
TEST_F(SolutionReloadTest, NeedsNoFaults) {
  Program imud("imud");
  start(imud, write("config.toml", config_of("")), {});
  ControlClient client(path("socket"));
  for (int i = 0; i <= 6; ++i) {
    ASSERT_TRUE(simulator_.exchange(Simulator::truth(10 * i, static_cast<std::uint32_t>(i), true))) << imud.errors();
    if (i != 2) continue;
    write("config.toml", config_of("gyro.bias_rad_per_s = [0.25, 0, 0]\n"));
    const nlohmann::json answer = client.call("reload");
    EXPECT_TRUE(answer.contains("result")) << answer;
  }
  client.call("quit");
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
  EXPECT_EQ(rows(read_file(path("out1"))).size(), 61U);
}

// The header row has left: inclinometers that are added would not show.
TEST_F(SolutionReloadTest, TheColumnsOfCsvStay) {
  Program imud("imud");
  start(imud, write("config.toml", config_of("")), {});
  ControlClient client(path("socket"));
  ASSERT_TRUE(simulator_.exchange(Simulator::truth(0, 0, true))) << imud.errors();
  write("config.toml", config_of("[imu.inclinometer]\nbias_m_per_s2 = 1\n"));
  const std::string why = client.call("reload")["error"]["message"];
  EXPECT_TRUE(contains(why, "imu.imu1.inclinometer.")) << why;
  EXPECT_TRUE(contains(why, "the columns cannot change while the run goes on")) << why;
  client.call("quit");
  EXPECT_EQ(imud.wait(), 0) << imud.errors();
}

}  // namespace
}  // namespace imud
