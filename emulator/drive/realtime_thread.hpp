// RealtimeThread: memory locking, priority and processor of the thread that samples.
#pragma once

#include <string>
#include <vector>

#include "emulator/plan/config.hpp"
#include "transports/file_descriptor.hpp"

namespace imud {

// Prepares the process. Make it before any thread: it limits the size of new stacks, because locking memory
// allocates all of a stack. While it exists, it keeps the processors out of deep idle states, if that is permitted.
class RealtimeProcess {
 public:
  explicit RealtimeProcess(const RealtimeConfig& config);

 private:
  FileDescriptor cpu_dma_latency_;
};

// Locks the memory of the process, with the stack of the calling thread, and sets the thread's processor and
// SCHED_FIFO priority. Call it when all memory that the thread will need is allocated. Returns a line for each step
// that failed, with the command that would permit it.
std::vector<std::string> make_thread_realtime(const RealtimeConfig& config);

}  // namespace imud
