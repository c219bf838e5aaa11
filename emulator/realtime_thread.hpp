// RealtimeThread: what the thread that samples asks of the kernel, so that nothing keeps it from its instants.
#pragma once

#include <string>
#include <vector>

#include "emulator/config.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// For the whole process, before the thread is made: stacks are of bounded size, as locking touches all of them;
// processors are kept from deep sleep as long as this lives.
class RealtimeProcess {
 public:
  explicit RealtimeProcess(const RealtimeConfig& config);

 private:
  FileDescriptor cpu_dma_latency_;
};

// For the calling thread, when all that it will need is there: memory is locked, its own stack too; SCHED_FIFO and
// its processor. Returns what was not permitted, a line each, with what would permit it.
std::vector<std::string> make_thread_realtime(const RealtimeConfig& config);

}  // namespace imud
