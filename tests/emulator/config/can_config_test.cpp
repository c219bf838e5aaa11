// CAN buses in a configuration: the bus load, identifiers that two imus share, and the settings with which a port is
// opened.
#include <gtest/gtest.h>
#include <toml++/toml.h>

#include "emulator/config/config_parts.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/config/load_config.hpp"
#include "emulator/plan/config.hpp"
#include "tests/emulator/run/run_test.hpp"

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

// SAE J1939-81: each NAME is of one node alone. CiA 305: so is each LSS address.
TEST_F(CanConfig, TwoImusHaveDifferentNames) {
  const auto faults_of = [&](const std::string& product, const std::string& first, const std::string& second,
                             const std::string& second_port = "canmcast:0") {
    const std::string text =
        "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nname = \"a\"\nport = \"canmcast:0\"\n" + product + first +
        "[[imu]]\nname = \"b\"\nport = \"" + second_port + "\"\n" + product + second;
    try {
      load_config(write("names.toml", text));
    } catch (const ConfigError& error) {
      return error.faults;
    }
    return std::vector<std::string>();
  };
  const std::string j1939 = "protocol = \"j1939\"\n", first = "device.source_address = 130\n",
                    second = "device.source_address = 131\n";
  const auto name = faults_of(j1939, first, second);
  ASSERT_EQ(name.size(), 1U);
  EXPECT_NE(name[0].find("imu.1.device: the same NAME 0x8000830066E00001 (name_identity) on the same bus as imu.0; "
                         "give another"),
            std::string::npos)
      << name[0];
  EXPECT_EQ(faults_of(j1939, first, second + "device.name_identity = 2\n").size(), 0U);
  EXPECT_EQ(faults_of(j1939, first, second, "canmcast:1").size(), 0U) << "another bus";

  const std::string canopen =
      "protocol = \"canopen\"\nrate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n";
  const std::string waits = "device.node_id = 255\n";
  const auto address = faults_of(canopen, waits, waits);
  ASSERT_EQ(address.size(), 1U);
  EXPECT_NE(
      address[0].find("imu.1.device: the same LSS address 0 1 65536 1 (serial_number) on the same bus as imu.0"),
      std::string::npos)
      << address[0];
  EXPECT_EQ(faults_of(canopen, waits, waits + "device.serial_number = 2\n").size(), 0U);
  EXPECT_EQ(faults_of(canopen, "device.node_id = 10\n", "device.node_id = 11\n").size(), 0U);
}

TEST_F(CanConfig, FramesOfCanFdNeedAPortThatCarriesThem) {
  const auto faults_at = [&](const std::string& port, const std::string& fd) {
    return faults({"imu.1.port=" + port, "imu.1.device.fd=" + fd});
  };
  const auto adapter = faults_at("slcan:/dev/ttyACM0?bitrate=500000", "true");
  ASSERT_EQ(adapter.size(), 1U);
  EXPECT_NE(adapter[0].find("imu.1.port: slcan:/dev/ttyACM0: the device sends frames of CAN FD; give their bit rate, "
                            "such as data_bitrate=2000000"),
            std::string::npos)
      << adapter[0];
  const auto classic = faults_at("can:vcan1?mtu=16", "true");
  ASSERT_EQ(classic.size(), 1U);
  EXPECT_NE(
      classic[0].find("imu.1.port: can:vcan1: mtu=16: the device sends frames of CAN FD, which need 72; omit mtu"),
      std::string::npos)
      << classic[0];
  for (const char* port : {"slcan:/dev/ttyACM0?bitrate=500000&data_bitrate=2000000", "can:vcan1?mtu=72", "can:vcan1"})
    EXPECT_EQ(faults_at(port, "true").size(), 0U) << port;
  for (const char* port : {"slcan:/dev/ttyACM0?bitrate=500000", "can:vcan1?mtu=16"})
    EXPECT_EQ(faults_at(port, "false").size(), 0U) << port;
}

// A log has no host that would start the unit, give it a node id, or ask it.
TEST_F(CanConfig, AUnitThatWaitsForAHostIsSilentAtAFile) {
  const auto warnings_of = [&](const std::string& keys) {
    return load_config(write("silent.toml", "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\n" + keys)).warnings;
  };
  const std::string limits = "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 200\n",
                    log = "port = \"canfile:x.log\"\n";
  struct Waits {
    std::string keys, setting;
  };
  const Waits units[] = {
      {"protocol = \"canopen\"\n" + limits, "self_start = true"},
      {"protocol = \"dronecan\"\ndevice.node_id = 0\n", "node_id = 42"},
      {"protocol = \"nos3-imu\"\n", "with_requests = true"},
      {"protocol = \"canopen\"\ndevice.node_id = 255\n" + limits, "node_id = 10 and device.self_start = true"},
      {"protocol = \"canopen\"\ndevice.node_id = 255\ndevice.self_start = true\n" + limits, "node_id = 10"}};
  for (const Waits& unit : units) {
    const auto warnings = warnings_of(unit.keys + log);
    ASSERT_EQ(warnings.size(), 1U) << unit.keys;
    EXPECT_NE(warnings[0].find("imu.0.port: the unit sends no measurements before a message of a host"),
              std::string::npos)
        << warnings[0];
    EXPECT_NE(warnings[0].find("with device." + unit.setting + " it sends them"), std::string::npos) << warnings[0];
    EXPECT_EQ(warnings_of(unit.keys + "port = \"can:vcan0\"\n").size(), 0U) << unit.keys;
  }
  EXPECT_EQ(warnings_of(units[0].keys + log + "device.self_start = true\n").size(), 0U);
  EXPECT_EQ(warnings_of("protocol = \"dronecan\"\n" + log).size(), 0U);
  EXPECT_EQ(warnings_of(units[2].keys + log + "device.with_requests = true\n").size(), 0U);
}

TEST_F(CanConfig, AnIdentifierOfElevenBitsIsNotThatOfTwentyNine) {
  EXPECT_EQ(faults({"imu.1.device.extended=true"}).size(), 0U);
  EXPECT_EQ(faults({"imu.0.device.extended=true", "imu.1.device.extended=true"}).size(), 1U);
  EXPECT_EQ(faults({"imu.1.port=\"can:vcan1\""}).size(), 0U) << "another bus";
}

TEST_F(CanConfig, AMessageOfADbcFileIsNotMoreFrequentThanTheSamples) {
  const std::string file = write("one.dbc", R"(BO_ 512 Yaw: 8 Imu
 SG_ Rate : 0|16@1- (0.01,0) [0|0] "deg/s" Host
BA_ "GenMsgCycleTime" BO_ 512 8;
)");
  std::vector<std::string> overrides = {"imu.1.protocol=dbc", "imu.1.device.dbc_file=" + file,
                                        "imu.1.device.signals=[\"Rate=rate_z_deg_per_s\"]"};
  const auto too_frequent = faults(overrides);
  ASSERT_EQ(too_frequent.size(), 1U);
  EXPECT_NE(too_frequent[0].find("imu.1.device.dbc_file: line 1: message Yaw: GenMsgCycleTime is 8 ms, but with "
                                 "rate_hz = 100 a sample comes every 10 ms; give rate_hz = 125 or more"),
            std::string::npos)
      << too_frequent[0];
  overrides.push_back("imu.1.rate_hz=125");
  EXPECT_EQ(faults(overrides).size(), 0U);
}

TEST_F(CanConfig, OnlyRealtimeMayDropFramesThatAreLate) {
  const std::string other = "imu.1.device.can_id=0x200";
  EXPECT_EQ(load({other}).imus[0].port_settings.delivery, Delivery::timely);
  EXPECT_FALSE(load({other}).imus[0].port_settings.yields);
  for (const Config& config :
       {load({other, "clock=lockstep"}), load({other, "clock=fast", "truth.port=pcap:t.pcap"})})
    for (const ImuConfig& imu : config.imus) {
      EXPECT_EQ(imu.port_settings.delivery, Delivery::complete);
      EXPECT_EQ(imu.port_settings.yields, config.clock == ClockMode::fast);
      EXPECT_FALSE(imu.port_settings.collects) << "two imus on the bus";
    }
  const Config apart = load({"imu.1.port=can:vcan9", "clock=fast", "truth.port=pcap:t.pcap"});
  for (const ImuConfig& imu : apart.imus) EXPECT_TRUE(imu.port_settings.collects);
  const Config copied =
      load({"imu.1.port=can:vcan9", "imu.1.also=[\"can:vcan0\"]", "clock=fast", "truth.port=pcap:t.pcap"});
  EXPECT_FALSE(copied.imus[0].port_settings.collects) << "copies of the other imu's frames are on its bus";
  EXPECT_TRUE(copied.imus[1].port_settings.collects);
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

// A product that sends transfers of 7 frames of 8 bytes with a 29-bit identifier, as DroneCAN's RawIMU is: 945 bits
// on average and 1120 at most.
TEST_F(CanConfig, AverageAndGreatestLoadAreThoseOfTheTable) {
  Config config = load({"imu.1.device.can_id=0x200"});
  Protocol product = *config.imus[0].protocol;
  product.can_messages = [](const Settings&, double) {
    return std::vector<CanMessage>{{{.id = 0x1403EB2A, .extended = true}, 8, 7 * 1000.0}};
  };
  config.imus[0].protocol = &product;
  const LineLoad load = line_load(config.imus[0]);
  EXPECT_NEAR(load.percent, 112.0, 1e-9);
  EXPECT_NEAR(load.average_percent, 94.5, 0.6);
  EXPECT_NEAR(load.average_bits_per_s, 945'000, 6'000);
  EXPECT_NE(load.text().find(" % on average and 112.0 % at most of the line's 1000000 bit/s"), std::string::npos)
      << load.text();
}

// Small numbers have more stuff bits than random data: the frames of a 10 s flight have 118.9 bits, counted exactly.
TEST_F(CanConfig, TheAverageIsThatOfTypicalSamples) {
  const Config config = load({"imu.1.device.can_id=0x200"});
  const LineLoad load = line_load(config.imus[0]);
  EXPECT_NEAR(load.average_bits_per_s / load.frames_per_s, 118.9, 0.5);
  EXPECT_NEAR(load.average_percent, 1e-4 * load.average_bits_per_s, 1e-9);
}

TEST_F(CanConfig, AGreatestLoadFrom70PercentIsAWarningAndAbove100AFault) {
  const std::string other = "imu.1.port=\"can:vcan1?bitrate=1000000\"";
  EXPECT_EQ(load({other, "imu.0.rate_hz=740"}).warnings.size(), 0U) << "7 frames of 135 bits: 69.93 %";
  const auto warnings = load({other, "imu.0.rate_hz=741"}).warnings;
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("imu.0.port"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[0].find("70.0 % at most"), std::string::npos) << warnings[0];
  EXPECT_EQ(faults({other, "imu.0.rate_hz=1058"}).size(), 0U);
  const auto refused = faults({other, "imu.0.rate_hz=1059"});
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_NE(refused[0].find("% on average and 100.1 % at most of the line's 1000000 bit/s"), std::string::npos)
      << refused[0];
}

// The identifier of a request to one imu is sent by another.
TEST_F(CanConfig, ARequestThatAnotherImuSendsIsAWarning) {
  Config config = load({"imu.1.device.can_id=0x200"});
  static std::vector<CanFilter> filters;
  Protocol product = *config.imus[0].protocol;
  product.can_filters = [](const Settings&) { return filters; };
  config.imus[0].protocol = &product;
  const toml::table tables = toml::parse("[[imu]]\n[[imu]]\n");
  const auto warnings = [&] {
    Faults found("two.toml");
    check_imus_together(config.imus, "", *tables["imu"].as_array(), found);
    EXPECT_EQ(found.all().size(), 0U);
    return found.warnings();
  };
  filters = {{.id = 0x207},
             {.id = 0x200, .mask = 0x7F0},
             {.id = 0x201, .extended = true},
             {.id = 0x202, .inverted = true},
             {.id = 0x203, .data = false, .remote = true},
             {.id = 0x101}};
  EXPECT_EQ(warnings().size(), 0U) << "no identifier of another imu, or not it alone";
  filters.push_back({.id = 0x206});
  ASSERT_EQ(warnings().size(), 1U);
  EXPECT_NE(warnings()[0].find("imu.0.device: it receives the CAN identifier 0x206, which imu.1 sends"),
            std::string::npos)
      << warnings()[0];
}

TEST_F(CanConfig, TheImusOnOneBusLoadItTogether) {
  const std::string other = "imu.1.device.can_id=0x200";
  const Config config = load({other});
  const auto buses = bus_loads(config.imus);
  ASSERT_EQ(buses.size(), 1U);
  EXPECT_EQ(buses[0].address, "can:vcan0");
  EXPECT_EQ(buses[0].imus, (std::vector<std::size_t>{0, 1}));
  EXPECT_NEAR(buses[0].percent, 100.0 * 7 * 135 * 300 / 1e6, 1e-9);
  EXPECT_NEAR(buses[0].average_percent,
              line_load(config.imus[0]).average_percent + line_load(config.imus[1]).average_percent, 1e-9);
  EXPECT_EQ(bus_loads(load({other, "imu.1.port=\"can:vcan1?bitrate=1000000\""}).imus).size(), 2U);
  EXPECT_EQ(bus_loads(load({other, "imu.*.port=\"can:vcan0\""}).imus).size(), 0U) << "no bit rate";
  EXPECT_NEAR(bus_loads(load({other, "imu.0.port=\"can:vcan0\""}).imus).at(0).percent, buses[0].percent, 1e-9)
      << "one gives the bit rate of both";

  const auto warnings = load({other, "imu.*.rate_hz=400"}).warnings;
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("the 2 imus on can:vcan0 load it by"), std::string::npos) << warnings[0];
  const auto refused = faults({other, "imu.*.rate_hz=600"});
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_NE(refused[0].find("113.4 % at most of 1000000 bit/s; reduce"), std::string::npos) << refused[0];
  const auto differ = faults({other, "imu.1.port=\"can:vcan0?bitrate=500000\""});
  ASSERT_EQ(differ.size(), 1U);
  EXPECT_NE(differ[0].find("500000 bit/s, and imu.0 gives 1000000 for the same bus"), std::string::npos) << differ[0];
}

}  // namespace
}  // namespace imud
