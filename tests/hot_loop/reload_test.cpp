// The sampling thread allocates nothing when it changes over to another configuration.
#include "emulator/imu/reload.hpp"

#include <fcntl.h>

#include <thread>

#include "emulator/config/load_config.hpp"
#include "emulator/engine/engine.hpp"
#include "emulator/engine/run_control.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/locks.hpp"

namespace imud {
namespace {

TEST_F(LiveTest, AReloadAllocatesNothing) {
  const auto config = [&](const std::string& keys) {
    return load_config(write("config.toml", "clock = \"lockstep\"\n[control]\nfaults = true\n[truth]\nport = \"" +
                                                simulator_.port() +
                                                "\"\n[[imu]]\nname = \"imu1\"\nprotocol = \"native\"\nport = "
                                                "\"file:" +
                                                path("out") + "\"\nmodel = \"stim300\"\n" + keys));
  };
  const Config before = config("rate_hz = 500\ngyro.low_pass_hz = 0\ngyro.boxcar_samples = 7\n");
  const Config after = config(
      "rate_hz = 1000\ngyro.low_pass_hz = 0\ngyro.boxcar_samples = 900\ntemperature.profile_s = [0, 1, "
      "2]\ntemperature.profile_c = [1, 2, "
      "3]\nvibration.sine_hz = [10, 20, 30]\nvibration.sine_g = [[1, 2, 3], [1, 2, 3], [1, 2, 3]]\n");
  Engine engine(before);
  Reload there(before, after, before.imus, before.seed), back(after, before, before.imus, before.seed);
  for (Reload* reload : {&there, &back}) {
    ASSERT_EQ(reload->sensors.size(), 1U);
    const std::uint64_t allocated = allocations();
    const Step::Content content{.reload = reload};
    engine.apply(Step::command({.kind = Command::Kind::reload}, HostTime{1}, &content));
    EXPECT_EQ(allocations() - allocated, 0U);
  }
  EXPECT_EQ(engine.channels()[0]->sensor.grid().period(), std::chrono::milliseconds(2));
}

// From a pty with a reader to a file, to a slow pty, and back to a file; with faults, the port under them.
TEST_F(LiveTest, AnExchangeOfPortsAllocatesAndLocksNothing) {
  for (const bool faults : {false, true}) {
    const auto config = [&](const std::string& port, const std::string& pace) {
      return load_config(
          write("config.toml",
                fmt::format(
                    "clock = \"realtime\"\n[control]\nfaults = {}\n[truth]\nport = \"{}\"\n[[imu]]\nname = \"imu1\"\n"
                    "protocol = \"native\"\nrate_hz = 50\nport = \"{}\"\npace = \"{}\"\n"
                    "gyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n",
                    faults, simulator_.port(), port, pace)));
    };
    const std::vector<Config> configs = {config("pty:" + path("one"), "none"), config("file:" + path("out"), "none"),
                                         config("pty:" + path("two") + "?baud=115200", "line"),
                                         config("file:" + path("other"), "none")};
    Engine engine(configs[0]);
    const FileDescriptor reader(::open(path("one").c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK));
    ASSERT_TRUE(reader);
    Channel& channel = *engine.channels()[0];
    EXPECT_EQ(faults, engine.faults().capacity() > 0);
    for (std::size_t i = 1; i < configs.size(); ++i) {
      Reload reload(configs[i - 1], configs[i], configs[0].imus, configs[0].seed);
      ASSERT_EQ(reload.lines.size(), 1U);
      EXPECT_TRUE(reload.sensors.empty());
      EXPECT_TRUE(reload.open_ports(engine.channels()).empty());
      const Port* const opened = reload.lines[0].port.get();
      std::uint64_t allocated = 0, locked = 0;
      std::thread([&] {
        count_locks_of_this_thread();
        allocated = allocations();
        locked = locks_taken();
        const Step::Content content{.reload = &reload};
        engine.apply(Step::command({.kind = Command::Kind::reload}, HostTime{1}, &content));
        allocated = allocations() - allocated;
        locked = locks_taken() - locked;
      }).join();
      EXPECT_EQ(allocated, 0U);
      EXPECT_EQ(locked, 0U);
      EXPECT_NE(reload.lines[0].port.get(), opened);
      EXPECT_EQ(&*channel.lines.all()[0].port == opened, !faults);
    }
  }
}

}  // namespace
}  // namespace imud
