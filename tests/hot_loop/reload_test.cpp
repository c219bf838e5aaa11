// The sampling thread allocates nothing when it changes over to another configuration.
#include "emulator/engine/reload.hpp"

#include "emulator/config/load_config.hpp"
#include "emulator/drive/execute.hpp"
#include "emulator/engine/run_control.hpp"
#include "emulator/engine/session.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/support/allocations.hpp"

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
  Session session(before);
  Reload there(before, after, before.imus, before.seed), back(after, before, before.imus, before.seed);
  for (Reload* reload : {&there, &back}) {
    ASSERT_EQ(reload->sensors.size(), 1U);
    const std::uint64_t allocated = allocations();
    session.set_reload(reload);
    execute(session, {.kind = Command::Kind::reload}, HostTime{1});
    EXPECT_EQ(allocations() - allocated, 0U);
  }
  EXPECT_EQ(session.channels()[0]->grid().period(), std::chrono::milliseconds(2));
}

}  // namespace
}  // namespace imud
