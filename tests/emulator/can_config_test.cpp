// CAN buses in a configuration: the bus load, identifiers that two imus share, and the settings with which a port is
// opened.
#include <gtest/gtest.h>

#include "emulator/config.hpp"
#include "emulator/line_load.hpp"
#include "tests/emulator/run_test.hpp"

namespace imud {
namespace {

class CanConfig : public RunTest {
 protected:
  // Two imus on one bus.
  Config load(const std::vector<std::string>& overrides) const {
    const std::string text = R"([truth]
port = "udp:127.0.0.1:9810"
[[imu]]
name = "a"
rate_hz = 200
protocol = "native-can"
port = "can:vcan0?bitrate=1000000"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
[[imu]]
name = "b"
rate_hz = 100
protocol = "native-can"
port = "can:vcan0?bitrate=1000000"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
)";
    return load_config(write("two.toml", text), overrides);
  }
  std::vector<std::string> faults(const std::vector<std::string>& overrides) const {
    try {
      load(overrides);
    } catch (const ConfigError& error) {
      return error.faults;
    }
    return {};
  }
};

TEST_F(CanConfig, TwoImusUseDifferentIdentifiers) {
  EXPECT_EQ(faults({"imu.1.device.can_id=0x107"}).size(), 0U);
  const auto same = faults({"imu.1.device.can_id=0x106"});
  ASSERT_EQ(same.size(), 1U);
  EXPECT_NE(same[0].find("0x106"), std::string::npos) << same[0];
  EXPECT_EQ(faults({}).size(), 1U);
}

TEST_F(CanConfig, AnIdentifierOfElevenBitsIsNotThatOfTwentyNine) {
  EXPECT_EQ(faults({"imu.1.device.extended=true"}).size(), 0U);
  EXPECT_EQ(faults({"imu.0.device.extended=true", "imu.1.device.extended=true"}).size(), 1U);
  EXPECT_EQ(faults({"imu.1.port=\"can:vcan1\""}).size(), 0U) << "another bus";
}

TEST_F(CanConfig, OnlyRealtimeMayDropFramesThatAreLate) {
  const std::string other = "imu.1.device.can_id=0x200";
  EXPECT_EQ(load({other}).imus[0].port_settings.delivery, Delivery::timely);
  for (const Config& config :
       {load({other, "clock=lockstep"}), load({other, "clock=fast", "truth.port=pcap:t.pcap"})})
    for (const ImuConfig& imu : config.imus) EXPECT_EQ(imu.port_settings.delivery, Delivery::complete);
}

TEST_F(CanConfig, LoadIsOfEveryMessageThatIsListed) {
  Config config = load({"imu.1.device.can_id=0x200"});
  EXPECT_NEAR(line_load(config.imus[0]).percent, 100.0 * 7 * 135 * 200 / 1e6, 1e-9);
  // Messages that no sample causes: a heartbeat of one byte, and a transfer of three frames in extended format.
  Protocol product = *config.imus[0].protocol;
  product.can_messages = [](const Settings&, double rate_hz) {
    return std::vector<CanMessage>{{{.id = 0x700}, 1, 2.0}, {{.id = 0x1000, .extended = true}, 8, 3 * rate_hz}};
  };
  config.imus[0].protocol = &product;
  const LineLoad load = line_load(config.imus[0]);
  EXPECT_NEAR(load.frames_per_s, 602.0, 1e-9);
  EXPECT_NEAR(load.bits_per_s, 2 * 65 + 600 * 160, 1e-6) << "55 bits without data, and 8 + 2 with a byte";
  EXPECT_NEAR(load.percent, 100.0 * (2 * 65 + 600 * 160) / 1e6, 1e-9);
}

}  // namespace
}  // namespace imud
