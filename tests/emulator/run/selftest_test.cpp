#include <algorithm>

#include "emulator/commands/machine.hpp"
#include "emulator/commands/rack.hpp"
#include "tests/emulator/run/run_test.hpp"

namespace imud {
namespace {

class MachineTest : public RunTest {
 protected:
  void put(const std::string& file, const std::string& text) const {
    std::filesystem::create_directories(std::filesystem::path(path(file)).parent_path());
    std::ofstream(path(file)) << text << "\n";
  }
  // Returns true if one of the lines contains `what`.
  static bool has(const std::vector<std::string>& lines, std::string_view what) {
    return std::any_of(lines.begin(), lines.end(),
                       [&](const std::string& line) { return line.find(what) != std::string::npos; });
  }
};

TEST_F(MachineTest, EachShortcomingHasItsAdvice) {
  put("proc/version", "Linux version 6.1.0-13-amd64 (debian-kernel@lists.debian.org) #1 SMP PREEMPT_DYNAMIC");
  put("proc/cpuinfo", "flags : fpu hypervisor lahf_lm");
  put("proc/sys/kernel/sched_rt_runtime_us", "950000");
  put("proc/sys/kernel/sched_rt_period_us", "1000000");
  put("sys/devices/system/cpu/isolated", "");
  for (const int cpu : {0, 1, 2, 3})
    put(fmt::format("sys/devices/system/cpu/cpu{}/cpufreq/scaling_governor", cpu),
        cpu == 2 ? "powersave" : "performance");
  put("sys/devices/system/cpu/cpufreq/x", "");
  put("sys/class/tty/ttyUSB3/device/latency_timer", "16");

  const Machine machine = inspect_machine(folder_, true, {"/dev/ttyUSB3", "/dev/ttyS0"});
  EXPECT_TRUE(has(machine.facts, "Linux version 6.1.0-13-amd64"));
  EXPECT_TRUE(has(machine.facts, "4 processors, none isolated"));
  EXPECT_TRUE(has(machine.facts, "a virtual machine"));
  EXPECT_TRUE(has(machine.facts, "performance, powersave"));
  EXPECT_EQ(machine.advice.size(), 6U);
  EXPECT_TRUE(has(machine.advice, "cpupower frequency-set -g performance"));
  EXPECT_TRUE(has(machine.advice, "isolcpus=3 nohz_full=3 and set realtime.cpu = 3"));
  EXPECT_TRUE(has(machine.advice, "PREEMPT_RT"));
  EXPECT_TRUE(has(machine.advice, "sched_rt_runtime_us=-1"));
  EXPECT_TRUE(has(machine.advice, "hypervisor"));
  EXPECT_TRUE(has(machine.facts, "latency timer of /dev/ttyUSB3: 16 ms"));
  EXPECT_TRUE(has(machine.advice, "/dev/ttyUSB3 is an adapter that withholds what it has received for up to 16 ms"));
  EXPECT_TRUE(has(machine.advice, "DRIVER==\"ftdi_sio\", ATTR{latency_timer}=\"1\""));
  // A name of an adapter is a link to its device.
  put("dev/ttyUSB3", "");
  put("dev/serial/by-id/x", "");
  std::filesystem::remove(path("dev/serial/by-id/x"));
  std::filesystem::create_symlink("../../ttyUSB3", path("dev/serial/by-id/usb-FTDI"));
  EXPECT_TRUE(has(inspect_machine(folder_, true, {"/dev/serial/by-id/usb-FTDI"}).facts,
                  "latency timer of /dev/serial/by-id/usb-FTDI: 16 ms"));
  EXPECT_EQ(inspect_machine(folder_, false, {}).advice.size(), 4U);
}

TEST_F(MachineTest, AWellPreparedOneNeedsNone) {
  put("proc/version", "Linux version 6.1.0-13-rt-amd64 (x) #1 SMP PREEMPT_RT");
  put("proc/cpuinfo", "flags : fpu");
  put("proc/sys/kernel/sched_rt_runtime_us", "-1");
  put("sys/devices/system/cpu/isolated", "3");
  for (const int cpu : {0, 1, 2, 3})
    put(fmt::format("sys/devices/system/cpu/cpu{}/cpufreq/scaling_governor", cpu), "performance");
  put("sys/class/tty/ttyUSB0/device/latency_timer", "1");
  const Machine machine = inspect_machine(folder_, true, {"/dev/ttyUSB0"});
  EXPECT_TRUE(machine.advice.empty()) << machine.advice[0];
  EXPECT_TRUE(has(machine.facts, "isolated: 3"));
  EXPECT_TRUE(inspect_machine(folder_ + "/nothing", true, {}).facts.size() > 0);
}

using SelftestTest = RunTest;

TEST_F(SelftestTest, MeasuresWhatTheConfigurationNames) {
  const std::string c = config("realtime", "udp:127.0.0.1:9810", "native", 500, "csv", "file:" + path("untouched"));
  const ProgramResult result =
      run_program("imud", {"selftest", "--timing", c, "--for", "0.2", "--set", "realtime.spin_us=50"});
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  for (const char* text : {"the machine", "500 Hz, 0.2 s each", "ordinary thread", "spin_us = 50", "imu1 to file:",
                           "16 native", "to expect", "500 Hz is ", "sensors at 500 Hz", "to improve"})
    EXPECT_NE(result.output.find(text), std::string::npos) << text << "\n" << result.output;
  EXPECT_FALSE(std::filesystem::exists(path("untouched")));
}

TEST_F(SelftestTest, NeedsNoConfigurationAndNamesTheFaultWithOne) {
  const ProgramResult alone = run_program("imud", {"selftest", "--timing", "--for", "0.1"});
  EXPECT_EQ(alone.exit_code, 0) << alone.errors;
  EXPECT_NE(alone.output.find("imu to pty:imu"), std::string::npos) << alone.output;
  EXPECT_EQ(run_program("imud", {"selftest", "--for", "0.1"}).exit_code, 0);
  const std::string c =
      config("realtime", "udp:127.0.0.1:9810", "native", 500, "native", "serial:/dev/no_such_tty?baud=921600");
  const ProgramResult wrong = run_program("imud", {"selftest", "--timing", c, "--for", "0.1"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_NE(wrong.errors.find("no_such_tty"), std::string::npos) << wrong.errors;
}

TEST_F(SelftestTest, ARackSendsEverySampleOfEverySensor) {
  RealtimeConfig ordinary;
  ordinary.priority = 0;
  ordinary.lock_memory = false;
  const RackFigures rack = measure_rack(ordinary, 5, 400, 0.5, folder_);
  EXPECT_GT(rack.samples, 5 * 400 * 0.5 / 2);
  EXPECT_LT(rack.samples, 5 * 400 * 10);
  EXPECT_GT(rack.lateness.count(), 0U);
  EXPECT_GT(rack.processor_s, 1e-6);
  EXPECT_LT(rack.processor_s, 1e-2);
}

}  // namespace
}  // namespace imud
