// Runs items of work in processes of their own, which share the cores.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace imud {

struct WorkerProcesses {
  unsigned jobs = 1;  // processes, at least 1
  // Does an item in a worker; returns a text without line feed. An exception ends all workers.
  std::function<std::string(std::size_t item)> work;
  // Receives the text of an item, in the order in which they end, in the calling process.
  std::function<void(std::size_t item, std::string text)> take;
  // Called about five times a second in the calling process.
  std::function<void()> tick = [] {};
  // If it returns true, the remaining items are not needed, and no further item begins. Asked after each tick.
  std::function<bool()> is_enough = [] { return false; };
  // If set, the death of a worker costs its open item alone, which another worker does again. An item at which two
  // workers have died is lost: this is called with the cause. Then `take` may receive an item twice, or an item that
  // is lost. Empty: a death ends all workers.
  std::function<void(std::size_t item, const std::string& cause)> lose = nullptr;
  // Receives the items that workers have open, in the calling process: after each tick, and of a worker when it ends.
  // The process may have sent the text of the item already.
  std::function<void(const std::vector<std::size_t>& items)> at_work = [](const auto&) {};
  // The items are the rest of earlier work: a signal that has come since that began ends them, too.
  bool goes_on = false;
};

// Does the items 0 to `items` - 1, each once, as long as they are needed. Call it while the process has one thread.
// SIGINT and SIGTERM end the items at work, and no further one begins: returns false then. Throws std::runtime_error
// with the cause if an item or a worker has failed.
bool run_workers(const WorkerProcesses& workers, std::size_t items);

// From now on SIGINT and SIGTERM set workers_stop(), which is false at first. run_workers() calls this function
// unless WorkerProcesses::goes_on is set.
void catch_workers_stop() noexcept;
// Set by SIGINT and SIGTERM after catch_workers_stop(), in the workers, too.
const std::atomic<bool>& workers_stop() noexcept;

}  // namespace imud
