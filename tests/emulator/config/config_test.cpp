#include "emulator/plan/config.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/attitude.hpp"
#include "core/gps_time.hpp"
#include "core/units.hpp"
#include "emulator/config/line_load.hpp"
#include "emulator/config/load_config.hpp"
#include "tests/transports/scratch_folder.hpp"

namespace imud {
namespace {

constexpr const char* good = R"(seed = 7
clock = "realtime"
[truth]
port = "udp:127.0.0.1:9810"
[[imu]]
rate_hz = 200
protocol = "native"
port = "pty:imu1"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
)";

class ConfigTest : public testing::Test {
 protected:
  Config load(const std::string& text, const std::vector<std::string>& overrides = {},
              const std::string& capture = {}) {
    std::ofstream(path_) << text;
    return load_config(path_, overrides, capture);
  }
  std::vector<std::string> faults(const std::string& text, const std::vector<std::string>& overrides = {}) {
    try {
      load(text, overrides);
    } catch (const ConfigError& error) {
      return error.faults;
    }
    return {};
  }
  // Returns the only fault of `text`, without the leading path.
  std::string fault(const std::string& text, const std::vector<std::string>& overrides = {}) {
    const auto all = faults(text, overrides);
    if (all.size() != 1) return fmt::format("{} faults", all.size());
    return all[0].substr(path_.size() + 1);
  }

  ScratchFolder folder_;
  const std::string path_ = folder_ / "config.toml";
};

// The units of systemd give the name of their instance as it is: `--set control.name=%i` of imud@1.
TEST_F(ConfigTest, AnOverrideOfATextNeedsNoQuotes) {
  const std::vector<std::string> names = {"1", "042", "1_000", "0x1F", "1e3", "true", "inf", "2024-01-01"};
  for (const std::string& name : names) {
    EXPECT_EQ(load(good, {"control.name=" + name}).control.name, name);
    if (name.find_first_not_of("0123456789") == name.npos) continue;  // selects imus of a list
    const Config named = load(good, {"imu.0.name=wing", "imu.wing.name=" + name});
    EXPECT_EQ(named.imus.at(0).name, name);
    EXPECT_EQ(load(named.resolved()).imus.at(0).name, name);
  }
  EXPECT_EQ(load(good, {"control.name=\"1\""}).control.name, "1") << "in quotes as before";
  EXPECT_EQ(load(good, {"control.name=1", "control.name=left"}).control.name, "left") << "the last one counts";
  EXPECT_TRUE(fault(good, {"control.name=[1]"}).ends_with("control.name: give text in quotes"));
  EXPECT_TRUE(fault(good, {"control.name=1.5"}).ends_with("give at most 40 letters, digits, - and _"));
}

// The right protocol may have a rate and ranges of its own.
TEST_F(ConfigTest, OfAnUnknownProtocolNothingElseIsMissing) {
  const std::string short_one = "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nport = \"pty:imu1\"\n";
  EXPECT_EQ(fault(short_one), "3: imu.0.protocol: missing; give one that `imud list` shows");
  EXPECT_TRUE(
      fault(short_one + "protocol = \"stim30\"\n").starts_with("5: imu.0.protocol: there is no \"stim30\"; "));
  EXPECT_EQ(fault(short_one + "protocol = \"stim300\"\n"), "0 faults");
  EXPECT_EQ(fault(short_one + "protocol = \"native\"\n"), "3 faults");
}

TEST_F(ConfigTest, DefaultsAreTheContracts) {
  const Config c = load(good);
  EXPECT_EQ(c.seed, 7U);
  EXPECT_EQ(c.clock, ClockMode::realtime);
  EXPECT_EQ(c.truth.port, "udp:127.0.0.1:9810");
  EXPECT_EQ(c.truth.format->name, "native");
  ASSERT_EQ(c.imus.size(), 1U);
  EXPECT_EQ(c.imus[0].name, "imu1");
  EXPECT_EQ(c.imus[0].rate_hz, 200.0);
  const ImuModel& m = c.imus[0].model;
  EXPECT_EQ(m.r_SB_B, Vector3::Zero());
  EXPECT_EQ(m.dcm_PB, Matrix3::Identity());
  EXPECT_EQ(m.gyro.max, 10.0);
  EXPECT_EQ(m.accelerometer.max, 200.0);
  EXPECT_EQ(m.gyro.scale_factor, Vector3::Ones());
  EXPECT_EQ(m.gyro.lsb, 0.0);
  EXPECT_EQ(m.gyro.rounding, Rounding::toward_zero);
  EXPECT_FALSE(m.gyro.carry);
  EXPECT_EQ(m.gyro.walk_transition, Matrix3::Identity());
  EXPECT_EQ(m.gyro.walk_sqrt_cov, Matrix3::Zero());
  EXPECT_EQ(m.delta_angle, DeltaAngle::rotation_vector);
  EXPECT_EQ(m.delta_velocity, DeltaVelocity::integral);
  EXPECT_EQ(c.truth.clock.delay.count(), 0);
  EXPECT_EQ(c.truth.clock.automatic_percent, 99.0);
  EXPECT_EQ(c.truth.when_stopped, WhenStopped::hold);
  EXPECT_GT(c.realtime.priority, 0);
  EXPECT_FALSE(c.realtime.cpu.has_value());
  EXPECT_TRUE(c.realtime.lock_memory);
  EXPECT_EQ(c.realtime.spin.count(), 0);
  EXPECT_EQ(c.realtime.skip_after.count(), 1'000'000'000);
  EXPECT_EQ(c.realtime.epoch, Epoch::none);
  EXPECT_FALSE(c.realtime.allow_unsynchronised);
  EXPECT_EQ(c.imus[0].grid.offset(200).count(), 1'000'000'000);
}

TEST_F(ConfigTest, TimingKeysArrive) {
  const Config c =
      load(good, {"truth.delay_ms=auto", "truth.auto_delay_percent=95", "truth.when_stopped=silence",
                  "realtime.priority=80", "realtime.cpu=0", "realtime.lock_memory=false", "realtime.spin_us=62.5",
                  "realtime.skip_after_ms=250.5", "realtime.epoch=tai", "realtime.allow_unsynchronised=true",
                  "imu.0.clock_error_ppm=-50", "imu.0.phase_us=125.5"});
  EXPECT_EQ(c.truth.clock.automatic_percent, 95.0);
  EXPECT_EQ(c.truth.when_stopped, WhenStopped::silence);
  EXPECT_EQ(c.realtime.priority, 80);
  EXPECT_EQ(c.realtime.cpu, 0U);
  EXPECT_FALSE(c.realtime.lock_memory);
  EXPECT_EQ(c.realtime.spin.count(), 62'500);
  EXPECT_EQ(c.realtime.skip_after.count(), 250'500'000);
  EXPECT_EQ(c.realtime.epoch, Epoch::tai);
  EXPECT_TRUE(c.realtime.allow_unsynchronised);
  EXPECT_EQ(epoch_of(c), Epoch::tai);
  EXPECT_EQ(epoch_of(load(good, {"realtime.epoch=tai", "clock=lockstep", "truth.delay_ms=0"})), Epoch::none);
  EXPECT_EQ(c.imus[0].grid.nominal_offset(200).count(), 1'000'125'500);
  EXPECT_EQ(c.imus[0].grid.offset(200).count(), 1'000'050'003 + 125'500);  // 1 s / (1 - 5e-5)
  EXPECT_EQ(load(good, {"truth.delay_ms=auto"}).truth.clock.automatic_percent, 99.0);
}

// Left out, it is automatic where live truth is sampled by the host's clock.
TEST_F(ConfigTest, TheDelayIsAutomaticUnlessItIsGiven) {
  const auto percent = [&](const std::vector<std::string>& overrides) {
    return load(good, overrides).truth.clock.automatic_percent;
  };
  EXPECT_EQ(percent({}), 99.0);
  EXPECT_EQ(percent({"truth.auto_delay_percent=90"}), 90.0);
  EXPECT_EQ(percent({"truth.delay_ms=0"}), 0.0);
  EXPECT_EQ(percent({"clock=lockstep"}), 0.0);
  EXPECT_EQ(percent({"truth.port=pcap:truth.pcap"}), 0.0);
  EXPECT_EQ(percent({"truth.port=pcap:truth.pcap", "clock=fast"}), 0.0);
  EXPECT_NE(load(good, {}).resolved().find("delay_ms = \"auto\""), std::string::npos) << load(good, {}).resolved();
  EXPECT_NE(load(good, {"clock=lockstep"}).resolved().find("delay_ms = 0.0"), std::string::npos);
  EXPECT_NE(fault(good, {"clock=lockstep", "truth.delay_ms=auto"}).find("truth.delay_ms: needs clock = \"realtime\""),
            std::string::npos);
}

TEST_F(ConfigTest, EveryKeyArrives) {
  const Config c = load(R"(
seed = "18446744073709551615"
clock = "fast"
[truth]
port = "file:truth.csv"
format = "csv"
accumulated_dv = "body_sum"
columns = ["time_ns", "sigma_BN_1", "sigma_BN_2", "sigma_BN_3", "omega_BN_B_x", "omega_BN_B_y", "omega_BN_B_z"]
stream = 3
delay_ms = 12.5
extrapolate_ms = 50
max_gap_ms = 2000
[[imu]]
name = "nose"
rate_hz = 262.5
protocol = "native-can"
port = "can:vcan0?bitrate=1000000"
temperature_c = 40
[imu.device]
can_id = 0x200
fd = true
[imu.mounting]
position_m = [1, 2, 3]
dcm_PB = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
[imu.gyro]
bias_rad_per_s = [0.1, 0.2, 0.3]
scale_factor = [1.1, 1.2, 1.3]
max_rad_per_s = 5
lsb_rad_per_s = 0.01
rounding = "nearest"
carry = true
walk_transition = [0.5, 0.6, 0.7]
walk_sqrt_cov = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
walk_bound = [1, 0, 2]
[imu.accelerometer]
bias_m_per_s2 = [4, 5, 6]
max_m_per_s2 = 50
lsb_m_per_s2 = 0.02
rounding = "away_from_zero"
[imu.increments]
delta_angle = "integral"
delta_velocity = "memo"
)");
  EXPECT_EQ(c.seed, ~std::uint64_t{0});
  EXPECT_EQ(c.clock, ClockMode::fast);
  EXPECT_EQ(c.truth.format->name, "csv");
  EXPECT_EQ(c.truth.settings.text("accumulated_dv"), "body_sum");
  EXPECT_EQ(c.truth.settings.list("columns").size(), 7U);
  EXPECT_EQ(c.truth.stream, 3U);
  EXPECT_EQ(c.truth.clock.delay.count(), 12'500'000);
  EXPECT_EQ(c.truth.limits.extrapolate.count(), 50'000'000);
  EXPECT_EQ(c.truth.limits.max_gap.count(), 2'000'000'000);
  const ImuConfig& imu = c.imus.at(0);
  EXPECT_EQ(imu.name, "nose");
  EXPECT_EQ(imu.settings.integer("can_id"), 0x200);
  EXPECT_TRUE(imu.settings.flag("fd"));
  EXPECT_EQ(imu.model.temperature_c, 40.0);
  EXPECT_EQ(imu.model.r_SB_B, Vector3(1, 2, 3));
  EXPECT_EQ(imu.model.dcm_PB(0, 1), 1.0);
  EXPECT_EQ(imu.model.gyro.bias, Vector3(0.1, 0.2, 0.3));
  EXPECT_EQ(imu.model.gyro.scale_factor, Vector3(1.1, 1.2, 1.3));
  EXPECT_EQ(imu.model.gyro.rounding, Rounding::nearest);
  EXPECT_TRUE(imu.model.gyro.carry);
  EXPECT_EQ(imu.model.gyro.walk_transition, Matrix3(Vector3(0.5, 0.6, 0.7).asDiagonal()));
  EXPECT_EQ(imu.model.gyro.walk_sqrt_cov(1, 2), 6.0);
  EXPECT_EQ(imu.model.gyro.walk_bound, Vector3(1, 0, 2));
  EXPECT_EQ(imu.model.accelerometer.rounding, Rounding::away_from_zero);
  EXPECT_EQ(imu.model.delta_angle, DeltaAngle::integral);
  EXPECT_EQ(imu.model.delta_velocity, DeltaVelocity::memo);
}

TEST_F(ConfigTest, ADescriptionOfFramesIsNoConfiguration) {
  EXPECT_EQ(
      fault("name = \"x\"\nframe_version = 1\n[[message]]\nlayout = [\"AA\"]\n"),
      "2: frame_version: this file describes the frames of a sensor; give it as device.frame_file of an [[imu]] "
      "with protocol = \"frame\"");
}

// By the same code as in a run.
TEST_F(ConfigTest, ColumnsThatAreNotEnoughAreAFaultOfTheirKey) {
  std::string text = good;
  text.replace(text.find("[[imu]]"), 0, "format = \"csv\"\ncolumns = [\"t\", \"x\"]\n");
  const std::string wanted =
      "6: truth.columns: missing time_ns, sigma_BN_1, sigma_BN_2, sigma_BN_3, omega_BN_B_x, omega_BN_B_y, "
      "omega_BN_B_z; give at most 256 names, among them time_ns, sigma_BN_1 to _3, omega_BN_B_x to _z";
  EXPECT_EQ(fault(text), wanted);
}

TEST_F(ConfigTest, TheOnlySenderThatIsAdmitted) {
  EXPECT_FALSE(load(good).truth.port_settings.from);
  EXPECT_EQ(load(good, {"truth.from=192.168.0.5"}).truth.port_settings.from, Endpoint::parse("192.168.0.5"));
  EXPECT_EQ(load(good, {"truth.from=[::1]:40000"}).truth.port_settings.from, Endpoint::parse("[::1]:40000"));
  EXPECT_EQ(fault(good, {"truth.from=simulator"}),
            " truth.from: 'simulator': no numeric address; right would be ADDR or ADDR:PORT, such as 192.168.0.5, "
            "192.168.0.5:40000 or [::1]:40000");
  EXPECT_NE(
      fault(good, {"truth.from=127.0.0.1", "truth.port=file:truth.csv", "truth.format=csv"})
          .find("truth.from: file: has no senders; omit it, or give truth.port \"pcap:PATH\" or \"udp:ADDR:PORT\""),
      std::string::npos);
  // A capture takes the place of the port.
  EXPECT_TRUE(load(good, {"truth.from=127.0.0.1", "truth.format=csv"}, "file:truth.csv").truth.port_settings.from);
}

TEST_F(ConfigTest, AProductIsItsDefaults) {
  const std::string bare =
      "truth.port = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"stim300\"\nport = \"pty:imu1\"\n";
  const ImuConfig imu = load(bare).imus[0];
  EXPECT_EQ(imu.rate_hz, 2000.0);
  EXPECT_EQ(imu.port, "pty:imu1") << "as written";
  EXPECT_EQ(imu.port_settings.uart, UartSettings{921'600});
  EXPECT_DOUBLE_EQ(imu.model.gyro.max, 480 * units::degree);
  EXPECT_DOUBLE_EQ(imu.model.accelerometer.max, 11 * units::standard_gravity);
  // 0.15 deg/sqrt(h): of white noise at 2000 Hz the deviation that adds up to 0.15 deg in an hour.
  const ImuModel white = load(bare, {"imu.0.model=white"}).imus[0].model;
  EXPECT_NEAR(white.gyro.walk_sqrt_cov(0, 0) * std::sqrt(3600.0 * 2000) / 2000, 0.15 * units::degree, 1e-12);
  EXPECT_DOUBLE_EQ(line_load(imu).percent, 100.0 * 590'000 / 921'600);
  const std::vector<std::string> slow = {"imu.0.port=serial:/dev/ttyUSB0", "imu.0.device.parity=odd",
                                         "imu.0.device.bit_rate=374400", "imu.0.device.sample_rate=500"};
  EXPECT_EQ(load(bare, slow).imus[0].port_settings.uart, (UartSettings{374'400, Parity::odd, 1}));
  EXPECT_NE(fault(bare, std::vector(slow.begin(), slow.end() - 1)).find("imu.0.device.sample_rate: "),
            std::string::npos);
  EXPECT_EQ(load(bare, {"imu.0.gyro.max_rad_per_s=5"}).imus[0].model.gyro.max, 5.0);
  EXPECT_EQ(load(bare, {"imu.0.device.accelerometer_range_g=30"}).imus[0].model.accelerometer.max,
            33 * units::standard_gravity);
  EXPECT_NE(fault(bare, {"imu.0.rate_hz=1000"}).find("imu.0.rate_hz: stim300 always samples at 2000 Hz"),
            std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.port=pty:imu1?baud=115200"}).find("imu.0.port: baud is set by the device"),
            std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.device.bit_rate=500000"}).find("give 374400, 460800, 921600 or 1843200"),
            std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.device.sample_rate=300"}).find("give 125, 250, 500, 1000 or 2000"),
            std::string::npos);
  EXPECT_TRUE(faults(bare, {"truth.when_stopped=flag"}).empty());
}

TEST_F(ConfigTest, PinsAreConnectedByUdp) {
  const std::string bare =
      "truth.port = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"stim300\"\nport = \"pty:imu1\"\n";
  const std::string trigger = "imu.0.sync.trigger_port=udp:127.0.0.1:9811",
                    tov = "imu.0.sync.tov_port=udp:127.0.0.1:9813";
  const SyncConfig sync = load(bare, {trigger, tov, "imu.0.device.sample_rate=0"}).imus[0].sync;
  EXPECT_EQ(sync.trigger_port, "udp:127.0.0.1:9811");
  EXPECT_EQ(sync.pps_port, "");
  EXPECT_EQ(sync.tov_port, "udp:127.0.0.1:9813");
  EXPECT_NE(fault(bare, {"imu.0.sync.pps_port=pty:pps"}).find("imu.0.sync.pps_port: "), std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.sync.pps_port=file:pps"}).find("edges are received and sent by \"udp:ADDR:PORT\""),
            std::string::npos);
  EXPECT_NE(
      fault(bare, {trigger, "imu.0.sync.pps_port=udp:127.0.0.1:9811"}).find("the same as imu.0.sync.trigger_port"),
      std::string::npos);
  EXPECT_EQ(load(bare, {"imu.0.protocol=mip", trigger}).imus[0].sync.trigger_port, "udp:127.0.0.1:9811");
  EXPECT_NE(fault(good, {trigger}).find("native has no such pin; omit the key"), std::string::npos);
}

TEST_F(ConfigTest, AMipDeviceIsItsDefaults) {
  const std::string bare = "truth.port = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"mip\"\nport = \"pty:imu1\"\n";
  const ImuConfig imu = load(bare).imus[0];
  EXPECT_EQ(imu.rate_hz, 1000.0);
  EXPECT_EQ(imu.port, "pty:imu1");
  EXPECT_EQ(imu.port_settings.uart, UartSettings{115'200});
  EXPECT_LT(line_load(imu).percent, 100.0);
  EXPECT_DOUBLE_EQ(imu.model.gyro.max, 300 * units::degree);
  EXPECT_DOUBLE_EQ(load(bare, {"imu.0.device.model=3dm-cv7-ahrs"}).imus[0].model.gyro.max, 500 * units::degree);
  EXPECT_NE(fault(bare, {"imu.0.device.sensor_rate_hz=1000"}).find("imu.0.device: "), std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.device.sensor_rate_hz=1000"}).find("% of the line's 115200 bit/s"),
            std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.device.sensor_rate_hz=300"}).find("sensor_rate_hz: give a divisor of 1000"),
            std::string::npos);
  EXPECT_NE(
      fault(bare, {"imu.0.device.sensor_fields=[\"rat\"]"}).find("there is no \"rat\"; known: acceleration rate"),
      std::string::npos);
}

TEST_F(ConfigTest, AVectorNavIsItsDefaults) {
  const std::string bare =
      "truth.port = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"vectornav\"\nport = \"pty:imu1\"\n";
  EXPECT_EQ(load(bare).imus[0].rate_hz, 800.0);
  EXPECT_EQ(load(bare, {"imu.0.device.model=vn-300"}).imus[0].rate_hz, 400.0);
  EXPECT_EQ(
      load(bare, {"imu.0.device.binary_1=\"1,2,01,0121\"", "imu.0.device.baud=921600"}).imus[0].port_settings.uart,
      UartSettings{921'600});
  EXPECT_NE(fault(bare, {"imu.0.device.binary_1=\"1,2,01\""}).find("binary_1: give mode, divisor, groups"),
            std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.device.async_hz=33"}).find("async_hz: give 1, 2, 4, 5"), std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.device.binary_1=\"1,1,01,7FFF\""}).find("% of the line's 115200 bit/s"),
            std::string::npos);
}

TEST_F(ConfigTest, ASecondPortIsForAProductWithASecondUart) {
  const std::string bare =
      "truth.port = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"vectornav\"\nport = \"pty:imu1\"\n";
  EXPECT_EQ(load(bare).imus[0].second_port, "");
  const std::string second = "imu.0.second_port=pty:imu2";
  const ImuConfig imu =
      load(bare, {second, "imu.0.pace=line", "imu.0.device.uart=2", "imu.0.device.baud=230400"}).imus[0];
  EXPECT_EQ(imu.second_port, "pty:imu2");
  EXPECT_EQ(imu.second_port_settings.uart, UartSettings{230'400});
  EXPECT_TRUE(imu.second_port_settings.paced);
  EXPECT_EQ(load(bare, {second, "clock=lockstep"}).imus[0].second_port_settings.delivery, Delivery::complete);
  EXPECT_NE(fault(good, {second}).find("imu.0.second_port: native has no second UART; omit the key"),
            std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.second_port=pty:imu1"}).find("imu.0.second_port: the same as imu.0; give another"),
            std::string::npos);
  EXPECT_NE(fault(bare, {"imu.0.second_port=can:vcan0"}).find("imu.0.second_port: a UART needs a port for bytes"),
            std::string::npos);
  EXPECT_NE(
      fault(bare, {"imu.0.second_port=pty:imu2?baud=9600"}).find("imu.0.second_port: baud is set by the device"),
      std::string::npos);
  EXPECT_EQ(faults(bare, {"imu.0.second_port=ptty:imu2"}).size(), 1U);
  EXPECT_NE(fault(bare, {"imu.0.device.binary_1=\"2,1,01,7FFF\"", second}).find("at the second port"),
            std::string::npos);
  EXPECT_TRUE(faults(bare, {"imu.0.device.binary_1=\"2,1,01,7FFF\""}).empty()) << "nothing is connected there";
  EXPECT_EQ(faults(bare, {"imu.0.device.uart=3"}).size(), 1U);
}

TEST_F(ConfigTest, CopiesHaveTheLineOfThePortButNoPace) {
  EXPECT_TRUE(load(good).imus[0].also.empty());
  const ImuConfig imu = load(good, {"imu.0.also=[\"pty:imu2\", \"file:imu.bin\"]", "imu.0.port=pty:imu1?baud=9600",
                                    "imu.0.pace=line", "imu.0.rate_hz=1"})
                            .imus[0];
  EXPECT_EQ(imu.also, (std::vector<std::string>{"pty:imu2", "file:imu.bin"}));
  ASSERT_EQ(imu.also_settings.size(), 2U);
  EXPECT_TRUE(imu.port_settings.paced);
  EXPECT_FALSE(imu.also_settings[0].paced);
  EXPECT_EQ(imu.also_settings[1].role, Role::device);
  const auto delivery = [&](const char* clock) {
    return load(good, {"imu.0.also=[\"file:imu.bin\"]", clock}).imus[0].also_settings[0].delivery;
  };
  EXPECT_EQ(delivery("clock=realtime"), Delivery::timely);
  EXPECT_EQ(delivery("clock=lockstep"), Delivery::complete);
  EXPECT_EQ(faults(good, {"imu.0.also=[1]"}).size(), 1U);
}

TEST_F(ConfigTest, YawPitchRollIsThreeTwoOne) {
  const Config c = load(good, {"imu.0.mounting.yaw_pitch_roll_deg=[90, 0, 0]"});
  // The platform is turned by +90 deg about z: the body's x axis is the platform's -y.
  EXPECT_TRUE((c.imus[0].model.dcm_PB * Vector3::UnitX()).isApprox(-Vector3::UnitY(), 1e-15));
  const Config all = load(good, {"imu.0.mounting.yaw_pitch_roll_deg=[10, 20, 30]"});
  EXPECT_TRUE(all.imus[0].model.dcm_PB.isApprox(
      dcm_from_yaw_pitch_roll(10 * units::degree, 20 * units::degree, 30 * units::degree), 1e-15));
}

TEST_F(ConfigTest, EachFaultNamesLineKeyAndRemedy) {
  const auto with = [](const std::string& line) { return good + line + "\n"; };
  EXPECT_EQ(fault(with("[imu.gyr]")), "11: imu.0.gyr: unknown key; did you mean \"gyro\"?");
  EXPECT_EQ(fault(with("rate = 5")), "11: imu.0.rate: unknown key; did you mean \"rate_hz\"?");
  EXPECT_EQ(fault(with("gyro.walk_bound = [1, 2]")),
            "11: imu.0.gyro.walk_bound: give three finite numbers, [x, y, z]");
  EXPECT_EQ(fault(with("gyro.walk_bound = [1, 2, nan]")),
            "11: imu.0.gyro.walk_bound: give three finite numbers, [x, y, z]");
  EXPECT_EQ(fault(with("gyro.walk_bound = [1, -1, 0]")),
            "11: imu.0.gyro.walk_bound: give numbers of at least 0 (0: no bound)");
  EXPECT_EQ(fault(with("barometer.bias = 1")), "11: imu.0.barometer.bias: unknown key; did you mean \"bias_pa\"?");
  EXPECT_EQ(fault(with("barometer.bais = 1")), "11: imu.0.barometer.bais: unknown key; did you mean \"bias_pa\"?");
  EXPECT_EQ(fault(with("gyro.carry = 1")), "11: imu.0.gyro.carry: give true or false");
  EXPECT_EQ(fault(with("gyro.lsb_rad_per_s = -1")),
            "11: imu.0.gyro.lsb_rad_per_s: -1 is out of range; give a number from 0 to 1000000000");
  EXPECT_EQ(fault(with("gyro.rounding = \"up\"")),
            "11: imu.0.gyro.rounding: give one of \"toward_zero\", \"nearest\", \"away_from_zero\"");
  EXPECT_EQ(fault(with("gyro.walk_transition = [[1, 0, 0], [0, 1, 0], 1]")),
            "11: imu.0.gyro.walk_transition: give three finite numbers (the diagonal), or three rows of three: "
            "[[..], [..], [..]]");
  EXPECT_NE(fault(with("mounting.dcm_PB = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]"))
                .find("11: imu.0.mounting.dcm_PB: not a rotation"),
            std::string::npos);
  EXPECT_NE(fault(with("mounting.dcm_PB = [[1, 0, 0], [0, 1, 0.001], [0, 0, 1]]")).find("off by 0.001"),
            std::string::npos);
  EXPECT_NE(fault(with("mounting = { yaw_pitch_roll_deg = [1, 2, 3], dcm_PB = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }"))
                .find("not both"),
            std::string::npos);
  EXPECT_NE(fault(with("seed = 1\nseed = 2")).find("12: TOML: "), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.rate_hz=0"}).find("imu.0.rate_hz: 0 is out of range"), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.rate_hz=1e5"}).find("out of range; give a number from 0.001 to 10000"),
            std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.protocol=nativ"}).find("there is no \"nativ\"; did you mean \"native\"?"),
            std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.port=tty:x"}).find("there is no \"tty\""), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.port=nonsense"}).find("imu.0.port: "), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.port=can:vcan0"}).find("native is for byte links"), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.protocol=native-can"}).find("native-can is for a CAN bus"), std::string::npos);
  EXPECT_NE(fault(good, {"clock=fast"}).find("clock: \"fast\" reads a capture"), std::string::npos);
  EXPECT_NE(fault(good, {"truth.port=pty:x"}).find("truth.port: cannot carry truth; give "), std::string::npos);
  EXPECT_NE(fault(good, {"truth.port=file:x.csv"}).find("truth.port: native truth is binary"), std::string::npos);
  EXPECT_NE(fault(good, {"truth.format="}).find("truth.format: there is no \"\"; known: ardupilot-json, basilisk, "),
            std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.protocol="}).find("imu.0.protocol: there is no \"\"; known: bosch-mm5, "),
            std::string::npos);
  const auto replaced = [](std::string text, const std::string& was, const std::string& is) {
    return text.replace(text.find(was), was.size(), is);
  };
  EXPECT_TRUE(fault(replaced(good, "pty:imu1", "")).starts_with("8: imu.0.port: '': no scheme"));
  EXPECT_TRUE(fault(replaced(good, "udp:127.0.0.1:9810", "")).starts_with("4: truth.port: '': no scheme"));
  EXPECT_EQ(fault(replaced(good, "\"native\"", "3")), "7: imu.0.protocol: give text in quotes");
  EXPECT_EQ(fault(replaced(good, "\"pty:imu1\"", "3")), "8: imu.0.port: give text in quotes");
  EXPECT_NE(fault(good, {"imu.0.port=pcap:x"}).find("imu.0.port: pcap:x: can only be read"), std::string::npos);
  EXPECT_NE(fault(good, {"truth.format=simulator"}).find("truth.format: there is no \"simulator\""),
            std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.device.can_id=3"}).find("imu.0.device.can_id: unknown key"), std::string::npos);
  EXPECT_NE(fault(good, {"imu.7.rate_hz=3"}).find("\"7\" is not an index below 1"), std::string::npos);
  EXPECT_NE(
      fault(good, {"truth.delay_ms=soon"}).find("truth.delay_ms: give milliseconds from 0 to 1000, or \"auto\""),
      std::string::npos);
  EXPECT_NE(fault(good, {"truth.delay_ms=-1"}).find("truth.delay_ms: -1 is out of range"), std::string::npos);
  EXPECT_NE(fault(good, {"truth.auto_delay_percent=90", "truth.delay_ms=0"}).find("needs delay_ms = \"auto\""),
            std::string::npos);
  EXPECT_NE(fault(good, {"truth.when_stopped=stop"}).find("give one of \"hold\", \"flag\", \"silence\""),
            std::string::npos);
  EXPECT_NE(fault(good, {"truth.when_stopped=flag", "imu.0.protocol=native-can", "imu.0.port=can:vcan0"})
                .find("imu.0.protocol: native-can cannot mark a sample as not valid"),
            std::string::npos);
  EXPECT_TRUE(faults(good, {"truth.when_stopped=flag", "imu.0.protocol=native-can", "imu.0.port=can:vcan0",
                            "imu.0.device.fd=true"})
                  .empty());
  EXPECT_TRUE(faults(good, {"truth.when_stopped=flag", "imu.0.protocol=csv"}).empty());
  EXPECT_NE(fault(good, {"realtime.priority=100"}).find("realtime.priority: "), std::string::npos);
  EXPECT_NE(fault(good, {"realtime.cpu=4096"}).find("realtime.cpu: "), std::string::npos);
  EXPECT_NE(fault(good, {"realtime.spin_us=1e6"}).find("realtime.spin_us: "), std::string::npos);
  EXPECT_NE(fault(good, {"realtime.epoch=gps"}).find("realtime.epoch: "), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.clock_error_ppm=2e5"}).find("imu.0.clock_error_ppm: "), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.phase_us=-1"}).find("imu.0.phase_us: "), std::string::npos);
  EXPECT_NE(fault(good, {"rate_hz"}).find("give KEY=VALUE"), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.port=serial:/dev/ttyUSB0?baud=921600&speed=3"}).find("imu.0.port: "),
            std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.port=serial:/dev/ttyUSB0?parity=maybe"}).find("imu.0.port: "), std::string::npos);
}

TEST_F(ConfigTest, AllFaultsInOneGo) {
  const auto all = faults(R"(seed = -1
clock = "now"
colour = "red"
[truth]
[[imu]]
rate_hz = "fast"
[[imu]]
name = "imu1"
rate_hz = 100
protocol = "native"
port = "pty:a"
gyro.max_rad_per_s = inf
accelerometer.max_m_per_s2 = 1
)");
  // seed, clock, colour, truth.port; imu.0: rate_hz, protocol, port; imu.1: name, max.
  EXPECT_EQ(all.size(), 9U) << fmt::format("{}", fmt::join(all, "\n"));
}

TEST_F(ConfigTest, ARateThatTheLineCannotCarryIsAFault) {
  const std::string line = "imu.0.port=serial:/dev/ttyUSB0?baud=115200";
  EXPECT_NE(fault(good, {line}).find("imu.0.rate_hz: "), std::string::npos);  // 200 Hz of 124 bytes: 248 kbit/s
  EXPECT_TRUE(faults(good, {line, "imu.0.rate_hz=92"}).empty());
  EXPECT_FALSE(faults(good, {line, "imu.0.rate_hz=93"}).empty());
  EXPECT_TRUE(faults(good, {"imu.0.port=pty:imu1?baud=921600", "imu.0.rate_hz=743"}).empty());
  EXPECT_FALSE(faults(good, {"imu.0.port=pty:imu1?baud=921600", "imu.0.rate_hz=744"}).empty());
  // Twelve bits for each of 124 characters: 619.4 Hz.
  const std::string slow = "imu.0.port=pty:imu1?baud=921600&parity=odd&stop=2";
  EXPECT_TRUE(faults(good, {slow, "imu.0.rate_hz=619", "imu.0.pace=line"}).empty());
  EXPECT_NE(fault(good, {slow, "imu.0.rate_hz=620", "imu.0.pace=line"}).find("100.1 % of the line's 921600 bit/s"),
            std::string::npos);
}

TEST_F(ConfigTest, ThePaceIsThatOfALine) {
  const std::string product =
      "truth.port = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"stim300\"\nport = \"pty:imu1\"\n";
  EXPECT_FALSE(load(good).imus[0].port_settings.paced);
  EXPECT_FALSE(load(good, {"imu.0.pace=none"}).imus[0].port_settings.paced);
  const ImuConfig paced = load(product, {"imu.0.pace=line", "imu.0.device.parity=odd"}).imus[0];
  EXPECT_TRUE(paced.port_settings.paced);
  EXPECT_EQ(paced.port_settings.uart, (UartSettings{921'600, Parity::odd, 1}));
  EXPECT_EQ(paced.port, "pty:imu1") << "as written";
  const std::string pty = "pty:imu1?baud=921600", serial = "serial:/dev/ttyUSB0?baud=921600";
  const ImuConfig given = load(good, {"imu.0.pace=line", "imu.0.port=" + pty}).imus[0];
  EXPECT_TRUE(given.port_settings.paced);
  EXPECT_EQ(given.port_settings.uart.baud, 0U) << "the text counts";
  EXPECT_EQ(given.port, pty);
  EXPECT_FALSE(load(good, {"imu.0.pace=line", "imu.0.port=" + serial}).imus[0].port_settings.paced)
      << "it does so by itself";

  const auto refused = [&](const std::string& port) {
    return fault(good, {"imu.0.pace=line", "imu.0.port=" + port});
  };
  EXPECT_NE(refused("pty:imu1").find("imu.0.pace: \"line\" needs the line's speed; give it in port"),
            std::string::npos);
  EXPECT_NE(refused("udp:127.0.0.1:9").find("imu.0.pace: \"line\" is for a pty"), std::string::npos);
  EXPECT_NE(refused("file:out").find("imu.0.pace: \"line\" is for a pty"), std::string::npos);
  EXPECT_NE(
      fault(good, {"imu.0.pace=line", "imu.0.protocol=native-can", "imu.0.port=can:vcan0"}).find("is for a pty"),
      std::string::npos);
  EXPECT_NE(refused("pty:imu1?baud=921600&pace=line").find("imu.0.port: pace is a key of [[imu]]"),
            std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.pace=fast"}).find("imu.0.pace: "), std::string::npos);
  EXPECT_NE(fault(good, {"imu.0.pace=line", "imu.0.port=pty:imu1?baud=921600", "clock=lockstep"})
                .find("imu.0.pace: \"line\" needs clock = \"realtime\""),
            std::string::npos);
}

TEST_F(ConfigTest, ImusThatDisturbOneAnotherAreAFault) {
  const std::string two = std::string(good) + R"([[imu]]
rate_hz = 200
protocol = "native-can"
port = "can:vcan0"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
[[imu]]
rate_hz = 200
protocol = "native-can"
port = "can:vcan0"
device.can_id = 0x106
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
)";
  EXPECT_NE(fault(two).find("imu.2.device: the same CAN identifier 0x106 on the same bus as imu.1"),
            std::string::npos);
  EXPECT_TRUE(faults(two, {"imu.2.device.can_id=0x107"}).empty());
  EXPECT_TRUE(faults(two, {"imu.2.port=can:vcan1"}).empty());
  EXPECT_TRUE(faults(two, {"imu.2.device.can_id=0x100", "imu.2.device.extended=true"}).empty())
      << "identifiers of 11 and 29 bits are never the same";
  EXPECT_NE(fault(two, {"imu.2.device.can_id=0x107", "imu.1.name=" + std::string(65'536, 'a')})
                .find("imu.1.name: has 65536 characters; give at most 64"),
            std::string::npos)
      << "a record has 16 bits for the size of a name";
  EXPECT_NE(fault(two, {"imu.2.device.can_id=0x107", "imu.1.name=imu1"}).find("imu.1.name: the same as imu.0"),
            std::string::npos);
  EXPECT_NE(fault(std::string(good) + R"([[imu]]
rate_hz = 100
protocol = "csv"
port = "pty:imu1?baud=4000000"
gyro.max_rad_per_s = 10
accelerometer.max_m_per_s2 = 200
)")
                .find("imu.1.port: the same as imu.0"),
            std::string::npos);
}

TEST_F(ConfigTest, OverridesAddTablesAndTakeBareWords) {
  const Config c = load(good, {"clock=lockstep", "imu.0.gyro.carry=true", "imu.0.increments.delta_velocity=end_frame",
                               "seed=0x10", "imu.0.port=\"pty:other\""});
  EXPECT_EQ(c.clock, ClockMode::lockstep);
  EXPECT_TRUE(c.imus[0].model.gyro.carry);
  EXPECT_EQ(c.imus[0].model.delta_velocity, DeltaVelocity::end_frame);
  EXPECT_EQ(c.seed, 16U);
  EXPECT_EQ(c.imus[0].port, "pty:other");
}

TEST_F(ConfigTest, ACaptureTakesTheTruthPortsPlace) {
  EXPECT_EQ(load(good, {}, "pcap:x.pcap").truth.port, "pcap:x.pcap?port=9810");
  EXPECT_EQ(load(good, {}, "pcap:x.pcap?port=5140").truth.port, "pcap:x.pcap?port=5140");
  EXPECT_EQ(load(good, {"truth.port=pcap:y.pcap?port=77"}, "pcap:x.pcap").truth.port, "pcap:x.pcap?port=77");
  EXPECT_EQ(load(good, {"truth.port=nonsense"}, "pcap:x.pcap").truth.port, "pcap:x.pcap") << "no UDP port in it";
  EXPECT_EQ(load(good, {"truth.format=csv"}, "file:x.csv").truth.port, "file:x.csv");
  EXPECT_THROW(load(good, {}, "nonsense:x"), ConfigError);
}

TEST_F(ConfigTest, AMissingFileIsAFault) {
  try {
    load_config("/nonexistent/x.toml");
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_NE(error.faults.at(0).find("/nonexistent/x.toml"), std::string::npos);
  }
}

TEST_F(ConfigTest, CanLoadIsOfTheWorstCase) {
  const std::vector<std::string> can = {"imu.0.protocol=native-can", "imu.0.port=can:vcan0?bitrate=1000000"};
  const LineLoad load = line_load(this->load(good, can).imus[0]);
  EXPECT_EQ(load.frames_per_sample, 7U);
  EXPECT_EQ(load.bytes_per_sample, 56U);
  EXPECT_NEAR(load.percent, 100.0 * 7 * 135 * 200 / 1e6, 1e-9);
  auto overloaded = can;
  overloaded.emplace_back("imu.0.rate_hz=1059");  // 7 * 135 * 1059 > 1e6
  EXPECT_FALSE(faults(good, overloaded).empty());
}

TEST_F(ConfigTest, EarthIsOffUntilTheFrameOfNIsConfigured) {
  EXPECT_EQ(load(good).truth.earth.frame, EarthModel::Frame::automatic);
  const std::string local = std::string(good) +
                            "magnetometer.bias_t = [1e-6, 0, 0]\nbarometer = { bias_pa = 12, noise_pa = 3 }\n"
                            "[earth]\nframe = \"local\"\nlatitude_deg = 47\nlongitude_deg = -11\nheight_m = 500\n"
                            "start = 2026-02-03T04:05:06+01:00\n";
  const ImuModel m = load(local).imus[0].model;
  EXPECT_EQ(m.earth.frame, EarthModel::Frame::local);
  EXPECT_DOUBLE_EQ(m.earth.longitude, -11 * units::degree);
  EXPECT_EQ(m.earth.height, 500);
  EXPECT_EQ(m.earth.start_gps_ns, gps_ns_from_unix(1'770'087'906)) << "2026-02-03T03:05:06Z";
  EXPECT_EQ(m.magnetometer.bias.x(), 1e-6);
  EXPECT_EQ(m.barometer.bias, 12);
  EXPECT_EQ(m.barometer.noise, 3);

  const ImuModel product =
      load("[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"vectornav\"\nport = \"pty:v\"\n")
          .imus[0]
          .model;
  EXPECT_EQ(product.barometer.noise, 4.2);
  EXPECT_DOUBLE_EQ(product.magnetometer.max, 2.5e-4);
  const NavigationErrors navigation =
      load(local, {"imu.0.navigation.latency_s=0.2", "imu.0.navigation.position_m=[1,2,3]",
                   "imu.0.navigation.heading_deg=2"})
          .imus[0]
          .model.navigation;
  EXPECT_EQ(navigation.latency, std::chrono::milliseconds(200));
  EXPECT_EQ(navigation.position, Vector3(1, 2, 3));
  EXPECT_DOUBLE_EQ(navigation.attitude.z(), 2 * units::degree);
  for (const char* wrong : {"position_m=-1", "latency_s=-1", "attitude_correlation_s=0", "heading_deg=nan"})
    EXPECT_EQ(faults(local, {std::string("imu.0.navigation.") + wrong}).size(), 1U) << wrong;
  for (const char* wrong : {"noise_pa=-1", "drift_pa=-1", "drift_correlation_s=0", "lag_s=-1"})
    EXPECT_EQ(faults(local, {std::string("imu.0.barometer.") + wrong}).size(), 1U) << wrong;

  const std::string inertial = std::string(good) + "[earth]\nframe = \"inertial\"\nstart = 2025-06-01T12:00:00Z\n";
  EXPECT_EQ(load(inertial).imus[0].model.earth.angle, earth_rotation_angle(1'748'779'200)) << "of the start";
  EXPECT_DOUBLE_EQ(load(inertial + "angle_deg = 30\n").imus[0].model.earth.angle, 30 * units::degree);

  // The place and the heading of a vehicle at rest, before the first truth.
  const EarthModel rest = load(inertial +
                               "rest_latitude_deg = -30\nrest_longitude_deg = 50\nrest_height_m = 7\n"
                               "rest_yaw_pitch_roll_deg = [90, 2, -3]\n")
                              .imus[0]
                              .model.earth;
  EXPECT_DOUBLE_EQ(rest.latitude, -30 * units::degree);
  EXPECT_DOUBLE_EQ(rest.longitude, 50 * units::degree);
  EXPECT_EQ(rest.height, 7);
  EXPECT_LT((rest.rest_yaw_pitch_roll - units::degree * Vector3(90, 2, -3)).norm(), 1e-15);
  EXPECT_NE(fault(local + "rest_height_m = 3\n").find("needs frame = \"inertial\""), std::string::npos);
  EXPECT_NE(fault(local + "rest_yaw_pitch_roll_deg = [1e7, 0, 0]\n").find("give angles from -572957 to 572957"),
            std::string::npos);

  EXPECT_NE(fault(inertial + "height_m = 3\n").find("needs frame = \"local\""), std::string::npos);
  EXPECT_NE(fault(local + "angle_deg = 3\n").find("needs frame = \"inertial\""), std::string::npos);
  EXPECT_NE(fault(std::string(good) + "[earth]\nstart = \"2025\"\n").find("2025-01-01T00:00:00Z"), std::string::npos);
  EXPECT_EQ(faults(std::string(good) + "[earth]\nframe = \"local\"\n").size(), 2U) << "latitude and longitude";
}

TEST_F(ConfigTest, NoFileIsWrittenOverAnother) {
  const std::string out = folder_ / "out.bin", truth = folder_ / "flight.pcap";
  std::ofstream(truth) << "a capture";
  std::filesystem::create_symlink(truth, folder_ / "same.pcap");
  const std::vector<std::string> capture = {"truth.port=pcap:" + truth + "?port=9810"};
  const auto with_port = [&](const std::string& port) {
    return fault(good, {capture[0], "imu.0.port=\"file:" + port + "\""});
  };
  EXPECT_EQ(with_port(out), "0 faults");
  EXPECT_EQ(with_port("/dev/null"), "0 faults");
  EXPECT_NE(with_port(truth).find("imu.0.port: is the file of the truth; give another"), std::string::npos);
  EXPECT_NE(with_port(folder_ / "same.pcap").find("is the file of the truth"), std::string::npos);
  EXPECT_NE(with_port(path_).find("is the file of the configuration"), std::string::npos);
  const std::string second =
      "[[imu]]\nname = \"b\"\nprotocol = \"vectornav\"\nport = \"file:" + (folder_ / "./out.bin") + "\"\n";
  EXPECT_NE(fault(good + second, {"imu.0.port=\"file:" + out + "\""}).find("imu.1.port: the same as imu.0"),
            std::string::npos);
  std::ofstream(out) << "old";
  const FilesInUse files = load(good, {capture[0], "imu.0.port=\"file:" + out + "\""}).files;
  for (const auto& [file, use] : {std::pair(path_, "the configuration"), {truth, "the truth"}, {out, "imu.0.port"}})
    EXPECT_EQ(files.use_of(file), std::string("the file of ") + use);
}

// A product samples a vehicle at rest before the first truth, imud's own protocols are silent.
TEST_F(ConfigTest, BeforeTheFirstTruthAProductRests) {
  EXPECT_EQ(load(good).imus[0].before_first, BeforeFirst::silence);
  EXPECT_EQ(load(good, {"imu.0.before_first=rest"}).imus[0].before_first, BeforeFirst::rest);
  const std::string product =
      "[truth]\nport = \"udp:127.0.0.1:9810\"\n[[imu]]\nprotocol = \"vectornav\"\nport = \"pty:v\"\n";
  EXPECT_EQ(load(product).imus[0].before_first, BeforeFirst::rest);
  EXPECT_EQ(load(product, {"imu.0.before_first=silence"}).imus[0].before_first, BeforeFirst::silence);
  for (const std::string paced_by_truth : {"clock=lockstep", "truth.port=\"pcap:flight.pcap\""})
    EXPECT_EQ(load(product, {paced_by_truth}).imus[0].before_first, BeforeFirst::silence) << paced_by_truth;
  EXPECT_NE(faults(good, {"imu.0.before_first=off"})[0].find("silence"), std::string::npos);
}

}  // namespace
}  // namespace imud
