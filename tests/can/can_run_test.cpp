// The whole chain on a real SocketCAN interface: imud sends to vcan0, imu-decode and candump receive. Runs in
// tools/with-vcan.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>

#include "tests/emulator/run/live_test.hpp"

namespace imud {
namespace {

class CanRunTest : public LiveTest {
 protected:
  static void ip(const std::string& arguments) {
    ASSERT_EQ(std::system(("ip link set vcan0 " + arguments).c_str()), 0) << arguments;
  }
  // The sockets that receive every frame of vcan0.
  static std::size_t receivers() {
    const auto lines = lines_of(read_file("/proc/net/can/rcvlist_all"));
    return static_cast<std::size_t>(std::count_if(
        lines.begin(), lines.end(), [](const std::string& line) { return line.starts_with("   vcan0 "); }));
  }
  // Starts candump with `options` on vcan0. When this returns, its socket is open, with a buffer for all frames.
  static void start_candump(Program& candump, std::vector<std::string> options) {
    options.insert(options.end(), {"-L", "-r", "8388608", "vcan0"});
    candump.start(options);
    EXPECT_TRUE(eventually([] { return receivers() == 1; }));
  }
  // A run that lasts until the test stops it, however slow the guest is: an hour of truth.
  void start_long_run(Program& imud, int rate_hz, const std::string& port) {
    ASSERT_EQ(
        run_program("imu-truth", {"spiral", "--csv", path("hour.csv"), "--rate", "10", "--for", "3600"}).exit_code,
        0);
    const std::string c = config("realtime", "udp:127.0.0.1:5140", "csv", rate_hz, "native-can", port);
    imud.start({"replay", c, path("hour.csv"), "--summary", path("summary.json")});
  }
  // Returns the low 8 bits of the sample counter of each frame that candump has printed, and expects the frames of a
  // sample to be in order.
  static void expect_every_frame(const std::vector<std::string>& lines, std::size_t samples) {
    ASSERT_EQ(lines.size(), 7 * samples);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const std::string id = fmt::format(" {:03X}#", 0x100 + i % 7);
      const std::size_t at = lines[i].find(id);
      ASSERT_NE(at, std::string::npos) << i << " " << lines[i];
      const std::string data = lines[i].substr(at + id.size(), 16);
      EXPECT_EQ(data.substr(i % 7 == 0 ? 0 : 14, 2), fmt::format("{:02X}", i / 7 % 256)) << i << " " << lines[i];
    }
  }
};

const std::string flight = IMUD_TEST_DATA "/captures/jsbsim_c172_10s.pcap";

TEST_F(CanRunTest, AFlightOnTheBusDecodesToTheSameNumbers) {
  const std::string ideal = config("fast", "udp:127.0.0.1:5140", "jsbsim", 50, "csv", "file:" + path("ideal.csv"));
  ASSERT_EQ(run_program("imud", {"replay", ideal, flight, "--for", "2"}).exit_code, 3);
  const auto expected = rows(read_file(path("ideal.csv")));
  ASSERT_EQ(expected.size(), 101U);
  for (const bool fd : {false, true}) {
    const std::string kind = fd ? "true" : "false";
    const std::string c = config("realtime", "udp:127.0.0.1:5140", "jsbsim", 50, "native-can", "can:vcan0");
    Program decode("imu-decode");
    decode.start({"native-can", "can:vcan0", "--count", "101", "--set", "fd=" + kind});
    Program candump("/usr/bin/candump");
    candump.start({"-L", "-r", "8388608", "-n", fd ? "101" : "707", "vcan0"});
    ASSERT_TRUE(eventually([] { return receivers() == 2; }));
    // The guest may be held up for more than a second, as by a test beside it that fills the host's memory.
    const ProgramResult run =
        run_program("imud", {"replay", c, flight, "--for", "2", "--set", "imu.0.device.fd=" + kind, "--set",
                             "realtime.skip_after_ms=3600000", "--summary", path("summary.json")});
    ASSERT_EQ(run.exit_code, 3) << run.errors;
    EXPECT_EQ(summary()["imus"][0]["samples"], 101);
    ASSERT_EQ(summary()["imus"][0]["frames"], fd ? 101 : 707) << run.errors;
    EXPECT_EQ(summary()["imus"][0]["dropped"], 0);
    ASSERT_EQ(decode.wait(), 0) << decode.errors();
    ASSERT_EQ(candump.wait(), 0);

    const auto all = rows(decode.output());
    ASSERT_EQ(all.size(), expected.size());
    // Half an LSB of protocols/devices/native_can.cpp, or the rounding of a float.
    const auto tolerance = [&](std::size_t field, double value) {
      const int power = field < 5 ? -23 : field < 8 ? -18 : field < 11 ? -28 : -21;
      return fd ? std::abs(value) * std::ldexp(1.0, -24) : std::ldexp(1.0, power);
    };
    for (std::size_t k = 0; k < all.size(); ++k) {
      EXPECT_EQ(all[k][0], expected[k][0]);
      for (std::size_t field = 2; field < 14; ++field) {
        const double value = std::stod(expected[k][field]);
        EXPECT_NEAR(std::stod(all[k][field]), value, tolerance(field, value)) << k << " " << field;
      }
    }
    const auto frames = lines_of(candump.output());
    ASSERT_EQ(frames.size(), fd ? 101U : 707U);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const std::string id = fd ? " 100##" : fmt::format(" {:03X}#", 0x100 + i % 7);
      EXPECT_NE(frames[i].find(id), std::string::npos) << frames[i];
    }
  }
}

TEST_F(CanRunTest, NothingIsLostInFast) {
  const std::string c = config("fast", "udp:127.0.0.1:5140", "jsbsim", 150, "native-can", "can:vcan0");
  Program candump("/usr/bin/candump");
  start_candump(candump, {"-n", "10507", "-T", "20000"});
  const ProgramResult run = run_program("imud", {"replay", c, flight, "--summary", path("summary.json")});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const auto imu = summary()["imus"][0];
  EXPECT_EQ(imu["samples"], 1501);
  EXPECT_EQ(imu["frames"], 10507);
  EXPECT_EQ(imu["dropped"], 0);
  ASSERT_EQ(candump.wait(), 0);
  expect_every_frame(lines_of(candump.output()), 1501);
}

// A reload: from one socket of the bus to another, which has the filters of the first.
TEST_F(CanRunTest, AReloadToAnotherPortLosesAndDoublesNothing) {
  const auto with_port = [&](const std::string& port) {
    return write("config.toml",
                 fmt::format("clock = \"lockstep\"\n[control]\nsocket = \"{}\"\n[truth]\nport = \"{}\"\n"
                             "[[imu]]\nname = \"imu1\"\nrate_hz = 1000\nprotocol = \"native-can\"\n"
                             "gyro.max_rad_per_s = 100\naccelerometer.max_m_per_s2 = 1000\nport = \"{}\"\n",
                             path("socket"), simulator_.port(), port));
  };
  const auto filters = [] {
    std::size_t all = 0;
    for (const char* list : {"rcvlist_fil", "rcvlist_sff", "rcvlist_eff", "rcvlist_inv"})
      for (const std::string& line : lines_of(read_file(std::string("/proc/net/can/") + list)))
        if (line.starts_with("   vcan0 ")) ++all;
    return all;
  };
  Program candump("/usr/bin/candump");
  start_candump(candump, {"-n", fmt::to_string(7 * 61), "-T", "20000"});
  Program imud("imud");
  start(imud, with_port("can:vcan0"));
  ASSERT_TRUE(imud.wait_for_errors("ready"));
  const std::size_t before = filters();
  EXPECT_GT(before, 0U);
  for (int i = 0; i <= 6; ++i) {
    EXPECT_TRUE(simulator_.exchange(Simulator::truth(10 * i, static_cast<std::uint32_t>(i), true)));
    if (i != 3) continue;
    with_port("can:vcan0?confirm=yes");
    const ProgramResult answer = run_program("imud", {"ctl", "--socket", path("socket"), "--json", "reload"});
    ASSERT_EQ(answer.exit_code, 0) << answer.errors;
    EXPECT_NE(answer.output.find("\"sample\": 31"), answer.output.npos) << answer.output;
    EXPECT_EQ(filters(), before);
  }
  EXPECT_EQ(imud.stop(), 0) << imud.errors();
  EXPECT_EQ(summary()["imus"][0]["frames"], 7 * 61);
  EXPECT_EQ(summary()["imus"][0]["dropped"], 0);
  ASSERT_EQ(candump.wait(), 0);
  expect_every_frame(lines_of(candump.output()), 61);
}

// Returns the code blocks of that language in README.md.
std::vector<std::string> blocks_of_readme(const std::string& language) {
  std::vector<std::string> blocks;
  bool inside = false;
  for (const std::string& line : lines_of(read_file(IMUD_SOURCE_DIR "/README.md"))) {
    if (line == "```" + language) blocks.emplace_back();
    if (inside && line != "```") blocks.back() += line + "\n";
    inside = line == "```" + language || (inside && line != "```");
  }
  return blocks;
}

// README.md, "In CI".
TEST_F(CanRunTest, TheJobOfTheReadmeFailsIfOneTruthSampleOrFrameIsMissing) {
  std::string job;
  for (const std::string& block : blocks_of_readme("bash"))
    if (block.find("imu-decode native-can") != block.npos) job = block;
  std::string configuration;
  for (const std::string& block : blocks_of_readme("toml"))
    if (block.find("# can.toml") != block.npos) configuration = block;
  ASSERT_FALSE(job.empty() || configuration.empty());
  write("can.toml", configuration);
  write("job", job);
  const auto result = [&](const std::string& capture) {
    std::filesystem::copy_file(capture, path("flight.pcap"), std::filesystem::copy_options::overwrite_existing);
    return run_program("/usr/bin/env",
                       {"-C", folder_, "PATH=" IMUD_BIN_DIR ":/usr/sbin:/usr/bin:/sbin:/bin", "bash", "job"});
  };
  const ProgramResult whole = result(flight);
  EXPECT_EQ(whole.exit_code, 0) << whole.errors;
  EXPECT_EQ(rows(read_file(path("imu1.csv"))).size(), 1001U);

  // Without the datagram of record 1000: a pcap record is a header of 16 bytes, which has the size at 8, and the
  // data.
  const std::string bytes = read_file(flight);
  std::size_t begin = 24, next = 24;
  for (int record = 0; record <= 1000; ++record) {
    begin = next;
    std::uint32_t size = 0;
    std::memcpy(&size, bytes.data() + begin + 8, sizeof size);
    next = begin + 16 + size;
  }
  const ProgramResult truth = result(write("short.pcap", bytes.substr(0, begin) + bytes.substr(next)));
  EXPECT_EQ(truth.exit_code, 3) << "a truth is missing";

  // Frames that are lost on the way, although all were sent: of 7007 at least one, but for one run in 10^15.
  const auto with = [](std::string text, const std::string& port) {
    return text.replace(text.find("can:vcan0"), 9, port);
  };
  ASSERT_EQ(std::system("ip link add vxcan0 type vxcan peer name vxcan1 && ip link set vxcan0 up && "
                        "ip link set vxcan1 up && tc qdisc add dev vxcan0 root netem loss 0.5% limit 10000"),
            0);
  write("can.toml", with(configuration, "can:vxcan0"));
  write("job", with(job, "can:vxcan1"));
  const ProgramResult frames = result(flight);
  EXPECT_EQ(std::system("ip link del vxcan0"), 0);
  EXPECT_EQ(frames.exit_code, 3) << "frames are missing";
  EXPECT_NE(frames.errors.find("gaps=0: VIOLATED"), std::string::npos) << frames.errors;

  write("job", job);
  write("can.toml", configuration + "phase_us = 20000000\n");  // the last samples are after the flight
  EXPECT_EQ(result(flight).exit_code, 3) << "samples are missing";
}

TEST_F(CanRunTest, NothingIsLostInFastOnASlowBus) {
  ASSERT_EQ(std::system("tc qdisc add dev vcan0 root netem rate 200kbit limit 10"), 0);
  const std::string c =
      config("fast", "udp:127.0.0.1:5140", "jsbsim", 150, "native-can", "can:vcan0?frames_per_s=unlimited");
  const ProgramResult run =
      run_program("imud", {"replay", c, flight, "--for", "1", "--summary", path("summary.json")});
  EXPECT_EQ(std::system("tc qdisc del dev vcan0 root"), 0);
  ASSERT_EQ(run.exit_code, 3) << run.errors;
  EXPECT_EQ(summary()["imus"][0]["frames"], 7 * 151);
  EXPECT_EQ(summary()["imus"][0]["dropped"], 0);
}

TEST_F(CanRunTest, NothingIsLostInLockstep) {
  const std::string c = config("lockstep", simulator_.port(), "native", 500, "native-can", "can:vcan0");
  constexpr std::size_t samples = 1001;  // ten per step
  Program candump("/usr/bin/candump");
  start_candump(candump, {"-n", std::to_string(7 * samples), "-T", "20000"});
  Program imud("imud");
  start(imud, c);
  for (std::uint32_t step = 0; step <= 100; ++step) {
    auto answer = simulator_.exchange(Simulator::truth(20 * step, step, true));
    // A truth that was sent twice is answered twice.
    while (answer && answer->time.ns < 20'000'000 * std::int64_t{step}) answer = simulator_.answer(20'000);
    ASSERT_TRUE(answer.has_value()) << step;
    EXPECT_EQ(answer->samples, 10 * step + 1);
  }
  ASSERT_EQ(candump.wait(), 0);
  EXPECT_EQ(imud.stop(), 0);
  EXPECT_EQ(summary()["imus"][0]["frames"], 7 * samples);
  EXPECT_EQ(summary()["imus"][0]["dropped"], 0);
  expect_every_frame(lines_of(candump.output()), samples);
}

TEST_F(CanRunTest, AFullQueueDropsFramesAndTheRunGoesOn) {
  // 7 frames of 16 bytes at 200 Hz are 179 kbit/s; the queue passes 40 and holds 10 frames.
  ASSERT_EQ(std::system("tc qdisc add dev vcan0 root netem rate 40kbit limit 10"), 0);
  Program imud("imud");
  start_long_run(imud, 200, "can:vcan0?max_age_ms=20");
  // Attempts are half a millisecond apart: the queue has been full for 0.2 s.
  EXPECT_TRUE(eventually([] {
    const std::string statistics = run_program("/usr/sbin/tc", {"-s", "qdisc", "show", "dev", "vcan0"}).output;
    const std::size_t at = statistics.find("(dropped ");
    return at != std::string::npos && std::stoi(statistics.substr(at + 9)) >= 400;
  }));
  EXPECT_EQ(std::system("tc qdisc del dev vcan0 root"), 0);
  const ProgramResult decoded = run_program("imu-decode", {"native-can", "can:vcan0", "--count", "50"});
  EXPECT_EQ(decoded.exit_code, 0);
  EXPECT_NE(decoded.errors.find("gaps       0 "), std::string::npos) << decoded.errors;
  EXPECT_EQ(imud.stop(), 3);
  const auto imu = summary()["imus"][0];
  EXPECT_GT(imu["dropped"], 0);
  EXPECT_EQ(imu["frames"].get<std::uint64_t>() + imu["dropped"].get<std::uint64_t>(),
            7 * (imu["samples"].get<std::uint64_t>() - imu["skipped"].get<std::uint64_t>()));
}

TEST_F(CanRunTest, AnInterfaceThatGoesDownAndComesBack) {
  Program imud("imud");
  start_long_run(imud, 100, "can:vcan0");
  ASSERT_TRUE(eventually([] {
    return run_program("/usr/bin/candump", {"-n", "7", "-T", "200", "vcan0"}).output.size() > 100;
  }));
  ip("down");
  EXPECT_TRUE(imud.wait_for_errors("is lost"));
  ip("up");
  EXPECT_TRUE(imud.wait_for_errors("takes frames"));
  const ProgramResult decoded = run_program("imu-decode", {"native-can", "can:vcan0", "--count", "20"});
  EXPECT_EQ(decoded.exit_code, 0);
  EXPECT_EQ(rows(decoded.output).size(), 20U);
  EXPECT_EQ(imud.stop(), 3);
  const auto imu = summary()["imus"][0];
  EXPECT_GT(imu["dropped"], 0);
  EXPECT_EQ(imu["frames"].get<std::uint64_t>() + imu["dropped"].get<std::uint64_t>(),
            7 * (imu["samples"].get<std::uint64_t>() - imu["skipped"].get<std::uint64_t>()));
}

}  // namespace
}  // namespace imud
