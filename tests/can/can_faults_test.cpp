// The faults of a bus, on a real SocketCAN interface: a scenario in lockstep, frame by frame. Runs in
// tools/with-vcan.
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/error.h>

#include <algorithm>
#include <string>

#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

class CanFaultsTest : public LiveTest {};

TEST_F(CanFaultsTest, AScenarioIsOnTheBusFrameByFrame) {
  constexpr std::uint32_t samples = 41, frames = 7;  // of native-can
  std::string text =
      read_file(config("lockstep", simulator_.port(), "native", 100, "native-can", "can:vcan0?bitrate=1000000"));
  const auto fault = [&](const std::string& kind, int first, const std::string& numbers) {
    text += fmt::format("[[fault]]\ntarget = \"wire\"\nkind = \"{}\"\nat_sample = {}\nfor_samples = 5\n{}", kind,
                        first, numbers);
  };
  fault("same_id", 10, "");
  fault("error_frames", 20, "frames_per_s = 500\n");
  fault("bus_off", 30, "");
  const std::string with_faults = write("faults.toml", text);

  Program candump("/usr/bin/candump");
  constexpr std::size_t expected = frames * samples + 5 * frames + 5 * 5 - 5 * frames;
  candump.start({"-L", "-r", "8388608", "-n", std::to_string(expected), "-T", "20000", "vcan0,0:0,#FFFFFFFF"});
  ASSERT_TRUE(eventually([] {
    const std::string all = read_file("/proc/net/can/rcvlist_all"), errors = read_file("/proc/net/can/rcvlist_err");
    return all.find("   vcan0 ") != all.npos && errors.find("   vcan0 ") != errors.npos;
  }));
  Program imud("imud");
  start(imud, with_faults);
  for (std::uint32_t step = 0; step < samples; ++step)
    ASSERT_TRUE(simulator_.exchange(Simulator::truth(10 * step, step, true)).has_value()) << step;
  EXPECT_EQ(imud.stop(), 0) << imud.errors();
  const nlohmann::json imu = summary()["imus"][0];
  EXPECT_EQ(imu["frames"], frames * (samples - 5));
  EXPECT_EQ(imu["dropped"], frames * 5);
  ASSERT_EQ(candump.wait(), 0) << candump.errors();

  const std::vector<std::string> lines = lines_of(candump.output());
  ASSERT_EQ(lines.size(), expected);
  std::size_t at = 0;
  // Returns the data of the next frame, which must have this identifier, as candump prints both.
  const auto next = [&](const std::string& id) {
    const std::string& line = lines[std::min(at++, lines.size() - 1)];
    const std::size_t found = line.find(" " + id + "#");
    EXPECT_NE(found, line.npos) << "frame " << at - 1 << ": " << line << ", not " << id;
    return found == line.npos ? std::string() : line.substr(found + id.size() + 2);
  };
  for (std::uint32_t k = 0; k < samples; ++k) {
    if (k >= 30 && k < 35) continue;  // off the bus
    for (int i = 0; i < 5 && k >= 20 && k < 25; ++i) {
      const std::string error = fmt::format("{:08X}", CAN_ERR_FLAG | CAN_ERR_PROT | CAN_ERR_BUSERROR);
      EXPECT_EQ(next(error).size(), 2U * CAN_ERR_DLC);
    }
    for (std::uint32_t i = 0; i < frames; ++i) {
      const std::string id = fmt::format("{:03X}", 0x100 + i), data = next(id);
      EXPECT_EQ(data.substr(i == 0 ? 0 : 14, 2), fmt::format("{:02X}", k)) << "the counter";
      if (k < 10 || k >= 15) continue;
      const std::string other = next(id);
      EXPECT_EQ(other.size(), data.size());
      EXPECT_NE(other, data);
    }
  }
}

}  // namespace
}  // namespace imud
