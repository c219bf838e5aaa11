#include "emulator/commands/machine.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

namespace imud {
namespace {

// Returns the file's text without the white space at its end; empty if there is no file.
std::string value_in(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  text.erase(text.find_last_not_of(" \n") + 1);
  return text;
}

}  // namespace

// Sources: Linux, Documentation/admin-guide/pm/cpufreq.rst, admin-guide/kernel-parameters.txt (isolcpus, nohz_full),
// scheduler/sched-rt-group.rst, core-api/real-time/; FTDI AN232B-04 (latency timer).
Machine inspect_machine(const std::string& root, bool spins, const std::vector<std::string>& serial) {
  namespace fs = std::filesystem;
  Machine machine;
  const std::string version = value_in(root + "/proc/version");
  const std::string release = version.substr(0, version.find(" ("));
  const bool preempt_rt =
      value_in(root + "/sys/kernel/realtime") == "1" || version.find("PREEMPT_RT") != std::string::npos;
  machine.facts.push_back(fmt::format("{}{}", release, preempt_rt ? ", PREEMPT_RT" : ""));

  std::error_code error;
  std::set<std::string> governors;
  int processors = 0;
  for (const auto& entry : fs::directory_iterator(root + "/sys/devices/system/cpu", error)) {
    const std::string name = entry.path().filename();
    if (name.size() < 4 || !name.starts_with("cpu") || name.find_first_not_of("0123456789", 3) != std::string::npos)
      continue;
    ++processors;
    const std::string governor = value_in(entry.path() / "cpufreq/scaling_governor");
    if (!governor.empty()) governors.insert(governor);
  }
  const std::string isolated = value_in(root + "/sys/devices/system/cpu/isolated");
  machine.facts.push_back(
      fmt::format("{} processors, {}", processors, isolated.empty() ? "none isolated" : "isolated: " + isolated));
  if (!governors.empty()) machine.facts.push_back(fmt::format("frequency governor: {}", fmt::join(governors, ", ")));
  const bool guest = value_in(root + "/proc/cpuinfo").find(" hypervisor") != std::string::npos;
  if (guest) machine.facts.emplace_back("a virtual machine");

  if (!governors.empty() && governors != std::set<std::string>{"performance"})
    machine.advice.emplace_back(
        "the processors change their frequency, which delays wake-ups: sudo cpupower frequency-set -g performance");
  if (isolated.empty() && processors > 1)
    machine.advice.push_back(fmt::format(
        "other work runs on every processor: boot with isolcpus={0} nohz_full={0} and set realtime.cpu = {0}",
        processors - 1));
  if (!preempt_rt)
    machine.advice.emplace_back(
        "the kernel may delay a wake-up for long: use one with PREEMPT_RT (Debian: linux-image-rt)");
  const std::string share_us = value_in(root + "/proc/sys/kernel/sched_rt_runtime_us");
  if (spins && !share_us.empty() && share_us != "-1")
    machine.advice.push_back(
        fmt::format("the kernel stops a spinning thread with priority (it may run for {} us of each {}): "
                    "sudo sysctl kernel.sched_rt_runtime_us=-1",
                    share_us, value_in(root + "/proc/sys/kernel/sched_rt_period_us")));
  if (guest)
    machine.advice.emplace_back(
        "the hypervisor stops the whole machine at times, which nothing in it can prevent: measure on the "
        "bench's own computer");
  for (const std::string& device : serial) {
    // A name in /dev/serial is a link to the device.
    const fs::path named = fs::canonical(root + device, error);
    const std::string name = (error ? fs::path(device) : named).filename();
    const fs::path timer = fmt::format("{}/sys/class/tty/{}/device/latency_timer", root, name);
    const std::string ms = value_in(timer);
    if (ms.empty()) continue;
    machine.facts.push_back(fmt::format("latency timer of {}: {} ms", device, ms));
    if (ms != "1")
      machine.advice.push_back(fmt::format(
          "{} is an adapter that withholds what it has received for up to {} ms, so that data arrive in batches: "
          "echo 1 | sudo tee {}, or for good, in /etc/udev/rules.d/60-imud.rules: ACTION==\"add|change\", "
          "SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{{latency_timer}}=\"1\"",
          device, ms, timer.string()));
  }
  return machine;
}

}  // namespace imud
