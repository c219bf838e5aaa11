// RealtimeThread: what the thread that samples asks of the kernel, so that nothing keeps it from its instants.
#pragma once

#include <string>
#include <vector>

#include "emulator/config.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// For the whole process, before the thread is made: memory is locked and stacks are of bounded size, so that locking
// touches them; processors are kept from deep sleep as long as this lives.
class RealtimeProcess {
 public:
  explicit RealtimeProcess(const RealtimeConfig& config);
  // What was not permitted, a line each, with what would permit it.
  const std::vector<std::string>& shortfalls() const noexcept { return shortfalls_; }

 private:
  std::vector<std::string> shortfalls_;
  FileDescriptor cpu_dma_latency_;
};

// For the calling thread: SCHED_FIFO and its processor. What was not permitted, likewise.
std::vector<std::string> make_thread_realtime(const RealtimeConfig& config);

}  // namespace imud
