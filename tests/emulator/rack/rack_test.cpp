// Racks: the reader of their file, and what their configurations must have, and must not have, in common.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "emulator/plan/config.hpp"
#include "emulator/rack/rack_check.hpp"

namespace imud {
namespace {

namespace fs = std::filesystem;

using Texts = std::vector<std::string>;

class RackTest : public ::testing::Test {
 protected:
  RackTest() {
    std::string name = (fs::temp_directory_path() / "imud_rack.XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder");
    folder_ = name;
  }
  ~RackTest() override { fs::remove_all(folder_); }

  void write(const std::string& file, const std::string& text) const { std::ofstream(folder_ / file) << text; }
  std::string rack_file() const { return (folder_ / "rack.toml").string(); }

  // Without the folder, whose name differs from run to run.
  Texts without_folder(Texts texts) const {
    const std::string prefix = folder_.string() + "/";
    for (std::string& text : texts)
      for (std::size_t at = 0; (at = text.find(prefix)) != text.npos;) text.erase(at, prefix.size());
    return texts;
  }

  // Returns the faults of a rack's file alone.
  Texts faults_of(const std::string& text) const {
    write("rack.toml", text);
    try {
      read_rack(rack_file());
    } catch (const ConfigError& error) {
      return without_folder(error.faults);
    }
    return {};
  }

  // Returns the faults of a rack with its configurations; the warnings are in warnings_.
  Texts faults_together(const std::string& hosts) {
    write("rack.toml", hosts);
    const Rack rack = read_rack(rack_file());
    Texts faults;
    warnings_.clear();
    try {
      load_rack(rack, warnings_);
    } catch (const ConfigError& error) {
      faults = without_folder(error.faults);
    }
    warnings_ = without_folder(warnings_);
    return faults;
  }

  fs::path folder_;
  Texts warnings_;
};

constexpr const char* rack_of_two_hosts = R"([[host]]
name = "bench1"
runs = ["nose.toml"]
[[host]]
name = "bench2"
runs = ["tail.toml"]
)";
constexpr const char* rack_of_one_host = R"([[host]]
name = "bench1"
runs = ["nose.toml", "tail.toml"]
)";

// The parts of a configuration that two runs may have differently.
struct RunParts {
  std::string name = "nose";
  std::string clock = "realtime", epoch = "tai", truth = "udp:239.1.2.3:9810", format = "native", delay = "20";
  std::string port = "pty:/tmp/imud_rack_nose", protocol = "stim300";
  std::string more;  // below [[imu]]
  std::string tables;

  std::string text() const {
    return "clock = \"" + clock + "\"\n[realtime]\nepoch = \"" + epoch + "\"\n[truth]\nport = \"" + truth +
           "\"\nformat = \"" + format + "\"\ndelay_ms = " + delay + "\n" + tables + "[[imu]]\nname = \"" + name +
           "\"\nprotocol = \"" + protocol + "\"\nport = \"" + port + "\"\n" + more;
  }
};
RunParts tail_parts() {
  RunParts parts;
  parts.name = "tail";
  parts.port = "pty:/tmp/imud_rack_tail";
  return parts;
}

TEST_F(RackTest, IsReadWithItsDefaults) {
  write("rack.toml", R"(time_limit_s = 3
[[host]]
name = "bench1"
runs = ["nose.toml", "sub/tail.toml"]
[[host]]
name = "here"
local = true
service = "user"
runs = ["/etc/imud/nose.toml"]
)");
  const Rack rack = read_rack(rack_file());
  EXPECT_EQ(rack.time_limit, std::chrono::seconds(3));
  ASSERT_EQ(rack.hosts.size(), 2U);
  EXPECT_EQ(rack.hosts[0].ssh, "bench1");
  EXPECT_EQ(rack.hosts[0].service, RackHost::Service::system);
  ASSERT_EQ(rack.hosts[0].runs.size(), 2U);
  EXPECT_EQ(rack.hosts[0].runs[1].name, "tail");
  EXPECT_EQ(rack.hosts[0].runs[1].file, (folder_ / "sub/tail.toml").string());
  EXPECT_EQ(rack.hosts[1].ssh, "");
  EXPECT_EQ(rack.hosts[1].service, RackHost::Service::user);
  EXPECT_EQ(rack.hosts[1].runs[0].file, "/etc/imud/nose.toml");
}

TEST_F(RackTest, EachFaultOfTheFileHasItsLineAndItsRemedy) {
  EXPECT_EQ(faults_of(""), Texts{"rack.toml: host: missing; give at least one [[host]]"});
  EXPECT_EQ(faults_of("host = []\n"), Texts{"rack.toml:1: host: give at least one [[host]]"});
  EXPECT_EQ(faults_of("[[host]]\nnmae = \"a\"\nruns = [\"a.toml\"]\n"),
            (Texts{"rack.toml:1: host.0.name: missing; give what people call the host, such as \"bench1\"",
                   "rack.toml:2: host.0.nmae: unknown key; did you mean \"name\"?"}));
  EXPECT_EQ(faults_of("[[host]]\nname = \"a\"\n"),
            Texts{"rack.toml:1: host.0.runs: missing; give the configurations that imud runs there, such as "
                  "[\"nose.toml\"]"});
  EXPECT_EQ(faults_of("[[host]]\nname = \"a b\"\nruns = [\"a.toml\"]\n"),
            Texts{"rack.toml:2: host.0.name: give letters, digits, -, _ and dots, such as \"bench1\""});
  // Neither ssh nor a shell may take it for an option.
  const std::string no_destination =
      ": give what ssh takes as its destination, such as \"root@bench1\", or local = true";
  EXPECT_EQ(faults_of("[[host]]\nname = \"a\"\nssh = \"-oProxyCommand=x\"\nruns = [\"a.toml\"]\n"),
            Texts{"rack.toml:3: host.0.ssh" + no_destination});
  EXPECT_EQ(faults_of("[[host]]\nname = \"a\"\nssh = \"\"\nruns = [\"a.toml\"]\n"),
            Texts{"rack.toml:3: host.0.ssh" + no_destination});
  EXPECT_EQ(faults_of("[[host]]\nname = \"a\"\nssh = \"b\"\nlocal = true\nruns = [\"a.toml\"]\n"),
            Texts{"rack.toml:3: host.0.ssh: without effect with local = true, which runs imud on this machine; omit "
                  "one of the two"});
  EXPECT_EQ(faults_of("[[host]]\nname = \"a\"\nservice = \"root\"\nruns = [\"a.toml\"]\n"),
            Texts{"rack.toml:3: host.0.service: give one of \"system\", \"user\""});
  const std::string list = ": give a list of configurations, such as [\"nose.toml\", \"tail.toml\"]";
  for (const char* wrong : {"[]", "\"a.toml\"", "[1]"})
    EXPECT_EQ(faults_of(std::string("[[host]]\nname = \"a\"\nruns = ") + wrong + "\n"),
              Texts{"rack.toml:3: host.0.runs" + list});
  EXPECT_EQ(
      faults_of("[[host]]\nname = \"a\"\nruns = [\"a.toml\", \"b/a.toml\", \"c.pcapng\", \"-d.toml\"]\n"),
      (Texts{"rack.toml:3: host.0.runs: b/a.toml: another run of this host has the name a, too; rename the file",
             "rack.toml:3: host.0.runs: c.pcapng: give a file NAME.toml, which imud@NAME runs",
             "rack.toml:3: host.0.runs: -d.toml: its name becomes that of the run, imud@NAME: give up to 40 "
             "letters, digits, - and _"}));
  EXPECT_EQ(faults_of("[[host]]\nname = \"a\"\nruns = [\"a.toml\"]\n[[host]]\nname = \"a\"\nssh = \"b\"\nruns = "
                      "[\"a.toml\"]\n[[host]]\nname = \"b\"\nruns = [\"a.toml\"]\n"),
            (Texts{"rack.toml:5: host.1.name: another host has this name; give another",
                   "rack.toml:8: host.2.ssh: the same machine as host a; give all its runs there"}));
  EXPECT_EQ(faults_of("time_limit_s = 0\n[[host]]\nname = \"a\"\nruns = [\"a.toml\"]\n"),
            Texts{"rack.toml:1: time_limit_s: 0 is out of range; give a number from 1 to 3600"});
}

TEST_F(RackTest, AGoodRackHasNoFaultAndNoWarning) {
  write("nose.toml", RunParts().text());
  write("tail.toml", tail_parts().text());
  EXPECT_EQ(faults_together(rack_of_two_hosts), Texts{});
  EXPECT_EQ(warnings_, Texts{});
  EXPECT_EQ(faults_together(rack_of_one_host), Texts{});
  EXPECT_EQ(warnings_, Texts{});
  // One configuration for two hosts: the ports are on two machines, but the noise is the same.
  EXPECT_EQ(faults_together("[[host]]\nname = \"a\"\nruns = [\"nose.toml\"]\n[[host]]\nname = \"b\"\nruns = "
                            "[\"nose.toml\"]\n"),
            Texts{});
  EXPECT_EQ(warnings_,
            Texts{"nose.toml:9: imu.0.name: host b: \"nose\" has the same random numbers as host a "
                  "(nose.toml:9, imu.0.name): their errors are equal; give another name, or another seed"});
}

TEST_F(RackTest, FaultsOfAConfigurationAreItsOwn) {
  write("nose.toml", RunParts().text());
  write("tail.toml", tail_parts().text() + "rate_h = 5\n");
  EXPECT_EQ(faults_together(rack_of_two_hosts),
            Texts{"tail.toml:12: imu.0.rate_h: unknown key; did you mean \"rate_hz\"?"});
  const char* none = "[[host]]\nname = \"a\"\nruns = [\"none.toml\"]\n";
  EXPECT_EQ(faults_together(none).size(), 1U);
}

// A host may have each of these in one run alone.
TEST_F(RackTest, WhatTwoRunsOfAHostCannotShare) {
  const auto expect = [this](const RunParts& nose, const RunParts& tail, const std::string& fault) {
    write("nose.toml", nose.text());
    write("tail.toml", tail.text());
    EXPECT_EQ(faults_together(rack_of_one_host), Texts{fault});
    EXPECT_EQ(faults_together(rack_of_two_hosts), Texts{}) << "on two hosts it is none";
  };
  RunParts a, b = tail_parts();
  a.port = b.port = "pty:/tmp/imud_rack_same";
  expect(
      a, b,
      "tail.toml:11: imu.0.port: host bench1: pty:/tmp/imud_rack_same, which host bench1 (nose.toml:11, imu.0.port) "
      "has, too; give another");
  a.port = b.port = "serial:/dev/imud_rack_none";
  expect(a, b,
         "tail.toml:11: imu.0.port: host bench1: serial:/dev/imud_rack_none, which host bench1 (nose.toml:11, "
         "imu.0.port) has, too; give another");
  a = RunParts(), b = tail_parts();
  a.protocol = b.protocol = "native-can";
  a.port = b.port = "can:imudnone";
  a.more = b.more = "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
  expect(a, b,
         "tail.toml:8: imu.0.device: host bench1: sends the CAN identifier 0x100 on can:imudnone, which host bench1 "
         "(nose.toml:8, imu.0.device) has, too; give another");
  a = RunParts(), b = tail_parts();
  a.truth = "udp:127.0.0.1:9810", b.truth = "udp:0.0.0.0:9810";
  for (int order = 0; order < 2; ++order) {
    write("nose.toml", a.text());
    write("tail.toml", b.text());
    EXPECT_EQ(faults_together(rack_of_one_host),
              Texts{"tail.toml:5: truth.port: host bench1: listens at port 9810 of UDP, as host bench1 (nose.toml:5, "
                    "truth.port) does; give another port"});
    std::swap(a.truth, b.truth);
  }
  a = RunParts(), b = tail_parts();
  a.tables = b.tables = "[web]\nlisten = \"127.0.0.1:8080\"\n";
  expect(
      a, b,
      "tail.toml:9: web.listen: host bench1: listens at port 8080 of TCP, as host bench1 (nose.toml:9, web.listen) "
      "does; give another port");
  a = RunParts(), b = tail_parts();
  a.tables = b.tables = "[control]\nsocket = \"/tmp/imud_rack.sock\"\n";
  expect(a, b,
         "tail.toml:9: control.socket: host bench1: /tmp/imud_rack.sock, which host bench1 (nose.toml:9, "
         "control.socket) has, too; give another");
}

TEST_F(RackTest, ABusOfTheNetworkIsOneForAllHosts) {
  RunParts a, b = tail_parts();
  a.protocol = b.protocol = "native-can";
  a.port = b.port = "canmcast:0";
  a.more = b.more = "rate_hz = 100\ngyro.max_rad_per_s = 10\naccelerometer.max_m_per_s2 = 100\n";
  write("nose.toml", a.text());
  write("tail.toml", b.text());
  EXPECT_EQ(faults_together(rack_of_two_hosts),
            Texts{"tail.toml:8: imu.0.device: host bench2: sends the CAN identifier 0x100 on canmcast:0, which host "
                  "bench1 (nose.toml:8, imu.0.device) has, too; give another"});
}

TEST_F(RackTest, ClocksAreThoseOfOneVehicle) {
  const auto faults = [this](const RunParts& nose, const RunParts& tail, const char* hosts) {
    write("nose.toml", nose.text());
    write("tail.toml", tail.text());
    return faults_together(hosts);
  };
  RunParts a, b = tail_parts();
  a.epoch = b.epoch = "monotonic";
  EXPECT_EQ(faults(a, b, rack_of_one_host), Texts{});
  EXPECT_EQ(warnings_, Texts{});
  const std::string monotonic = "\"monotonic\" counts from the start of each host; give \"tai\", or \"utc\", to all";
  EXPECT_EQ(faults(a, b, rack_of_two_hosts), (Texts{"nose.toml:3: realtime.epoch: host bench1: " + monotonic,
                                                    "tail.toml:3: realtime.epoch: host bench2: " + monotonic}));
  b.epoch = "utc";
  EXPECT_EQ(faults(RunParts(), b, rack_of_two_hosts),
            Texts{"tail.toml:3: realtime.epoch: host bench2: \"utc\", and \"tai\" has host bench1 (nose.toml, "
                  "realtime.epoch); give one epoch to all"});
  a.epoch = b.epoch = "none";
  EXPECT_EQ(faults(a, b, rack_of_two_hosts), Texts{});
  EXPECT_EQ(warnings_, Texts{"nose.toml:3: realtime.epoch: host bench1: the runs of the rack are not in phase, since "
                             "each begins with its first truth; give \"tai\" to all"});
  EXPECT_EQ(faults(a, b, rack_of_one_host), Texts{});
  EXPECT_EQ(warnings_.size(), 1U);
  EXPECT_EQ(faults(a, b, "[[host]]\nname = \"a\"\nruns = [\"nose.toml\"]\n"), Texts{});
  EXPECT_EQ(warnings_, Texts{}) << "one run is in phase with itself";
  a = RunParts(), b = tail_parts();
  b.clock = "lockstep", b.delay = "0";
  EXPECT_EQ(faults(a, b, rack_of_two_hosts),
            Texts{"tail.toml:1: clock: host bench2: \"lockstep\", and \"realtime\" has host "
                  "bench1 (nose.toml, clock); give one clock to all"});
  a.epoch = "tai\"\nallow_unsynchronised = true\n#\"";
  EXPECT_EQ(faults(a, tail_parts(), rack_of_two_hosts), Texts{});
  EXPECT_EQ(warnings_, Texts{"nose.toml:4: realtime.allow_unsynchronised: host bench1: the grids of the hosts differ "
                             "by as much as their clocks; omit it when PTP or NTP sets them"});
}

TEST_F(RackTest, WarnsOfTruthThatIsNotTheSame) {
  const auto expect = [this](const RunParts& nose, const RunParts& tail, const Texts& expected) {
    write("nose.toml", nose.text());
    write("tail.toml", tail.text());
    EXPECT_EQ(faults_together(rack_of_two_hosts), Texts{});
    EXPECT_EQ(warnings_, expected);
  };
  RunParts a, b = tail_parts();
  b.format = "csv";
  expect(a, b,
         {"tail.toml:6: truth.format: host bench2: \"csv\", and \"native\" has host bench1 (nose.toml, "
          "truth.format): one simulator sends one format"});
  b = tail_parts();
  b.truth = "udp:239.1.2.4:9810";
  expect(a, b,
         {"tail.toml:5: truth.port: host bench2: udp:239.1.2.4:9810, and udp:239.1.2.3:9810 has host bench1 "
          "(nose.toml, truth.port): they may have other truth; give one group to all"});
  b = tail_parts();
  b.delay = "30";
  expect(a, b,
         {"tail.toml:7: truth.delay_ms: host bench2: differs from that which host bench1 (nose.toml, "
          "truth.delay_ms) has, so that samples of one instant have truth of two; give one number to all"});
  b = tail_parts();
  a.delay = b.delay = "\"auto\"";
  expect(a, b,
         {"nose.toml:7: truth.delay_ms: host bench1: each host finds its own delay, so that samples of one "
          "instant have truth of several; give one number to all, such as 20"});
  a = RunParts();
  a.truth = b.truth = "udp:127.0.0.1:9810";
  b.delay = "20";
  const std::string loopback =
      "only programs of the same host can send truth there; several hosts receive one truth by a multicast group, "
      "such as \"udp:239.1.2.3:9810?interface=eth0\"";
  expect(a, b,
         {"nose.toml:5: truth.port: host bench1: " + loopback, "tail.toml:5: truth.port: host bench2: " + loopback});
  a = RunParts();
  a.port = "pty:nose";
  expect(a, tail_parts(),
         {"nose.toml:11: imu.0.port: host bench1: pty:nose is a path from the folder in which systemd "
          "starts imud, /; give a whole path, such as /run/imud/imu1"});
}

}  // namespace
}  // namespace imud
