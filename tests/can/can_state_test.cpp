// The states of a CAN bus and of its interface: error warning, error passive, bus-off, missing, renamed. Runs in
// tools/with-vcan.
#include <fmt/ranges.h>
#include <linux/can/error.h>

#include <string>

#include "tests/can/can_bus.hpp"
#include "tests/emulator/run/live_test.hpp"
#include "tests/transports/port_error.hpp"

namespace imud {
namespace {

// Sends an error frame with the controller's status, and lets the port receive it.
void report(const Node& node, Port& port, std::uint8_t status) {
  node.send(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, status, 0, 0, 0, 0, 0, 0});
  ASSERT_TRUE(receive_next(port).has_value());
}

TEST_F(Can, ErrorFramesGiveTheStateOfTheController) {
  const Node node("vcan0");
  const auto port = open("vcan0");
  struct Step {
    std::uint8_t status;
    PortState state;
    std::uint64_t warnings, passives;
  };
  const Step steps[] = {{CAN_ERR_CRTL_RX_WARNING, PortState::error_warning, 1, 0},
                        {CAN_ERR_CRTL_TX_WARNING, PortState::error_warning, 1, 0},
                        {CAN_ERR_CRTL_RX_OVERFLOW, PortState::error_warning, 1, 0},
                        {CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_PASSIVE, PortState::error_passive, 1, 1},
                        {CAN_ERR_CRTL_TX_WARNING, PortState::error_warning, 2, 1},
                        {CAN_ERR_CRTL_ACTIVE, PortState::ready, 2, 1}};
  std::uint64_t frames = 0;
  for (const Step& step : steps) {
    report(node, *port, step.status);
    EXPECT_EQ(port->state(), step.state) << int{step.status};
    send_sample(*port, 1, 3);
    EXPECT_EQ(port->state(), step.state) << "frames leave, and do not change it";
    EXPECT_EQ(port->counters().bus_errors, ++frames);
    EXPECT_EQ(port->counters().error_warnings, step.warnings);
    EXPECT_EQ(port->counters().error_passives, step.passives);
  }
  EXPECT_EQ(port->counters().sent, 3 * frames);
  EXPECT_EQ(port->counters().dropped, 0U);
  EXPECT_EQ(port->counters().lost_count, 0U);
}

TEST_F(Can, BusOffAndRestartAreCountedOnce) {
  const Node node("vcan0");
  const auto port = open("vcan0");
  for (std::uint64_t time = 1; time <= 2; ++time) {
    report(node, *port, CAN_ERR_CRTL_TX_PASSIVE);
    for (int i = 0; i < 2; ++i) {
      node.send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
      ASSERT_TRUE(receive_next(*port).has_value());
    }
    EXPECT_EQ(port->state(), PortState::lost);
    EXPECT_EQ(port->counters().bus_offs, time);
    node.send(CAN_ERR_FLAG | CAN_ERR_RESTARTED, {0, 0, 0, 0, 0, 0, 0, 0});
    ASSERT_TRUE(receive_next(*port).has_value());
    EXPECT_EQ(port->state(), PortState::ready) << "a controller that restarts is error active";
    EXPECT_EQ(port->counters().bus_restarts, time);
    EXPECT_EQ(port->counters().error_passives, time);
  }
}

TEST_F(Can, ARealDriverReportsItsStates) {
  LineController controller;
  ASSERT_TRUE(ip(fmt::format("link set {} up type can bitrate 500000", controller.name)));
  const auto port = open(controller.name);
  const auto after = [&](std::string_view report) {
    controller.send(report);
    EXPECT_TRUE(receive_next(*port).has_value()) << report;
    return port->state();
  };
  EXPECT_EQ(after("sw000100\r"), PortState::error_warning);
  EXPECT_EQ(after("sp000130\r"), PortState::error_passive);
  send_sample(*port, 1, 3);
  EXPECT_EQ(controller.frames(3), 3U);
  EXPECT_EQ(port->state(), PortState::error_passive);
  EXPECT_EQ(after("sa000000\r"), PortState::ready);
  EXPECT_EQ(after("sw100000\r"), PortState::error_warning);
  EXPECT_EQ(after("sb000256\r"), PortState::lost);
  EXPECT_EQ(port->counters().error_warnings, 2U);
  EXPECT_EQ(port->counters().error_passives, 1U);
  EXPECT_EQ(port->counters().bus_offs, 1U);
  EXPECT_EQ(port->counters().bus_errors, 5U);
}

TEST_F(Can, AMissingInterfaceIsWaitedForIfThatIsWanted) {
  ASSERT_TRUE(ip(fmt::format("link del {}", own)));
  EXPECT_TRUE(mentions(error_of(fmt::format("can:{}", own)), "wait=yes waits for it"));
  const auto port = open(fmt::format("{}?wait=yes", own));
  EXPECT_EQ(port->state(), PortState::lost);
  EXPECT_EQ(port->descriptor(), -1);
  send_sample(*port, 1, 3);
  EXPECT_EQ(port->counters().dropped, 3U);
  make_own();
  wait_until_back(*port);
  const Node node(own);
  SampleFrames sample;
  port->send(sample.add({.id = 1, .fd = true}, 64));
  const auto got = node.receive();
  ASSERT_TRUE(got.has_value());
  EXPECT_TRUE(got->fd);
}

TEST_F(Can, ARenamedInterfaceIsKept) {
  const auto port = open(own);
  send_sample(*port, 1, 3);
  ASSERT_TRUE(ip(fmt::format("link set {} down", own)));
  EXPECT_EQ(port->receive(), std::nullopt);
  EXPECT_EQ(port->state(), PortState::lost);
  ASSERT_TRUE(ip(fmt::format("link set {} name imudnew", own)));
  ASSERT_TRUE(ip("link set imudnew up"));
  const Node node("imudnew");
  send_sample(*port, 2, 3);
  SampleFrames sample;
  port->send(sample.add({.id = 1, .fd = true}, 64));
  EXPECT_EQ(port->state(), PortState::ready);
  EXPECT_EQ(node.receive_all().size(), 4U);
  EXPECT_EQ(port->counters().sent, 7U);
  node.send(0x321, {1});
  EXPECT_TRUE(receive_next(*port).has_value());
  ip("link del imudnew");
}

class CanStateRun : public LiveTest {
 protected:
  // The other end of the line has received these samples.
  struct Samples {
    std::vector<int> counters;  // their low 8 bits
    int cut = 0;                // those of which frames are missing
  };
  static Samples samples_of(const std::vector<std::string>& lines) {
    Samples samples;
    std::size_t frame = 0;
    for (const std::string& line : lines) {
      const std::size_t next = static_cast<std::size_t>(std::stoi(line.substr(1, 3), nullptr, 16)) - 0x100;
      const int counter = std::stoi(line.substr(next == 0 ? 5 : 19, 2), nullptr, 16);
      const bool begins = samples.counters.empty() || counter != samples.counters.back();
      if (begins ? next != 0 || (!samples.counters.empty() && frame != 6) : next != frame + 1) ++samples.cut;
      if (begins) samples.counters.push_back(counter);
      frame = next;
    }
    return samples;
  }
  std::string config_for(const LineController& controller) const {
    return config("realtime", "udp:127.0.0.1:0", "native", 20, "native-can",
                  fmt::format("can:{}?max_age_ms=50", controller.name));
  }
};

// A bus that is blocked for a second, then bus-off, then a restart: the sensor samples on, its counter shows the
// holes, and no old frames follow but those that the interface had taken.
TEST_F(CanStateRun, SamplingGoesOnWhileTheBusStandsStill) {
  LineController controller;
  ASSERT_TRUE(ip(fmt::format("link set {} txqueuelen 10 up type can bitrate 1000000", controller.name)));
  Program imud("imud");
  imud.start({"run", config_for(controller), "--set", "imu.0.before_first=rest", "--set",
              "realtime.skip_after_ms=3600000", "--summary", path("summary.json")});
  ASSERT_GE(controller.frames(70), 70U);
  controller.reading = false;
  std::this_thread::sleep_for(1s);  // 20 samples
  controller.reading = true;
  const std::uint64_t stalled = controller.frames(0);
  ASSERT_GE(controller.frames(stalled + 70), stalled + 70);
  controller.send("sw000100\r");
  EXPECT_TRUE(imud.wait_for_errors("error warning"));
  controller.send("sp000130\r");
  EXPECT_TRUE(imud.wait_for_errors("error passive"));
  controller.send("sb000256\r");
  EXPECT_TRUE(imud.wait_for_errors("is lost"));
  const std::uint64_t off = controller.frames(0);
  std::this_thread::sleep_for(1s);
  ASSERT_TRUE(ip(fmt::format("link set {} down", controller.name)));
  ASSERT_TRUE(ip(fmt::format("link set {} up", controller.name)));
  EXPECT_TRUE(imud.wait_for_errors("takes frames"));
  ASSERT_GE(controller.frames(off + 70), off + 70);
  EXPECT_EQ(imud.stop(), 0);

  const auto imu = summary()["imus"][0];
  EXPECT_EQ(imu["error_warnings"], 1);
  EXPECT_EQ(imu["error_passives"], 1);
  EXPECT_EQ(imu["bus_offs"], 1);
  EXPECT_EQ(imu["bus_errors"], 3);
  EXPECT_EQ(imu["frames"].get<std::uint64_t>() + imu["dropped"].get<std::uint64_t>(),
            7 * imu["samples"].get<std::uint64_t>())
      << "it samples at its rate, whatever the bus does";
  // Counters advance, whatever was not sent. In bus-off the interface discards frames that it had taken: the sample
  // that was under way is cut.
  const Samples samples = samples_of(controller.lines());
  int holes = 0;
  for (std::size_t i = 1; i < samples.counters.size(); ++i) {
    const int step = (samples.counters[i] - samples.counters[i - 1] + 256) % 256;
    EXPECT_LT(step, 128) << "an old sample";
    holes += step >= 10 ? 1 : 0;
  }
  // A guest that its host holds up for half a second has further ones.
  EXPECT_GE(holes, 2) << fmt::format("{}", fmt::join(samples.counters, " "));
  EXPECT_LE(samples.cut, 1);
}

}  // namespace
}  // namespace imud
