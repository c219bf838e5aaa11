#include "emulator/drive/realtime_thread.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace imud {

namespace {

constexpr std::size_t stack_size = 512 * 1024;

std::string permit(std::string_view capability) {
  std::error_code error;
  const std::string program = std::filesystem::read_symlink("/proc/self/exe", error).string();
  return fmt::format("sudo setcap {} {}", capability, error ? "imud" : program);
}

bool may_lock_without_limit() {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> data{};
  if (::syscall(SYS_capget, &header, data.data()) == 0 && (data[0].effective & 1U << CAP_IPC_LOCK) != 0) return true;
  rlimit limit{};
  return ::getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY;
}

// Under a limit, MCL_FUTURE would make later allocations fail when the limit is reached.
bool lock_memory() {
  if (may_lock_without_limit() && ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return true;
  return ::mlockall(MCL_CURRENT) == 0;
}

}  // namespace

RealtimeProcess::RealtimeProcess(const RealtimeConfig& config) {
  pthread_attr_t attributes;
  ::pthread_attr_init(&attributes);
  ::pthread_attr_setstacksize(&attributes, stack_size);
  ::pthread_setattr_default_np(&attributes);
  ::pthread_attr_destroy(&attributes);

  if (config.priority > 0) {  // Only root may do this: it is not reported where it is not permitted.
    cpu_dma_latency_.reset(::open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC));
    const std::int32_t microseconds = 0;
    if (cpu_dma_latency_ && ::write(cpu_dma_latency_.get(), &microseconds, sizeof microseconds) < 0)
      cpu_dma_latency_.reset();
  }
}

std::vector<std::string> make_thread_realtime(const RealtimeConfig& config) {
  std::vector<std::string> shortfalls;
  if (config.lock_memory && !lock_memory()) {
    const int error = errno;
    shortfalls.push_back(fmt::format(
        "memory is not locked ({}): a page that was swapped out delays a sample; permit it by `{}` or `ulimit -l "
        "unlimited`, or set realtime.lock_memory = false",
        std::strerror(error), permit("cap_sys_nice,cap_ipc_lock=ep")));
  }
  if (config.cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(*config.cpu, &set);
    if (const int error = ::pthread_setaffinity_np(::pthread_self(), sizeof set, &set); error != 0)
      shortfalls.push_back(fmt::format("not pinned to processor {} ({}): is it online, and in this process's cpuset?",
                                       *config.cpu, std::strerror(error)));
  }
  if (config.priority > 0) {
    sched_param parameters{};
    parameters.sched_priority = config.priority;
    if (const int error = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters); error != 0)
      shortfalls.push_back(fmt::format(
          "no real-time priority ({}): other processes delay samples; permit it by `{}`, or `ulimit -r {}`, or set "
          "realtime.priority = 0",
          std::strerror(error), permit("cap_sys_nice,cap_ipc_lock=ep"), config.priority));
  }
  return shortfalls;
}

}  // namespace imud
