// SlurmQueue: Slurm's commands sbatch, squeue, sinfo and scontrol.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/campaign/slurm/slurm_tasks.hpp"

namespace imud {

// A task that waits or runs.
struct QueuedTask {
  std::string name;         // of the job
  std::string job;          // identifier of the array
  std::uint64_t index = 0;  // in the array
  std::string state;        // as squeue abbreviates it: PD, R, CG ...
  std::string reason;       // why it waits

  bool waits() const noexcept { return state == "PD"; }
  // Returns true if the task waits until a user releases it.
  bool is_held() const noexcept {
    return waits() && (reason.find("Held") != reason.npos || reason.find("held") != reason.npos);
  }
};

// An array to submit.
struct SlurmArray {
  std::string name = {};
  std::string indices = {};               // array_indices()
  unsigned max_running = 0;               // tasks at the same time; 0: no limit
  std::string after = {};                 // identifier of the job for whose end the array waits; empty: none
  std::vector<std::string> options = {};  // of sbatch, after the options of this program
  std::string script = {};                // path
  std::uint64_t first_task = 0;           // the argument of the script
};

// Returns the words of the sbatch command.
std::vector<std::string> sbatch_words(const SlurmArray& array);
// Returns the reason why a plan or a user may not give this option of sbatch; empty if the option is permitted.
std::string sbatch_option_fault(std::string_view option);
// Reads the output of squeue.
std::vector<QueuedTask> queued_tasks(std::string_view output);

// Calls Slurm's commands in PATH. They use the cluster that they find (SLURM_CONF).
class SlurmQueue {
 public:
  // `stop`, which must outlive this, ends a command that waits.
  explicit SlurmQueue(const std::atomic<bool>& stop) : stop_(stop) {}

  // Throws OpenError if this machine has no Slurm, or if Slurm's controller does not answer.
  SlurmLimits limits() const;
  // Returns the number of processors of a partition, or of all partitions for "". Returns 1 if it is unknown.
  std::uint64_t processors(const std::string& partition) const;
  // Returns the identifier of the job. Throws OpenError with the words of sbatch.
  std::string submit(const SlurmArray& array) const;
  // Cancels the tasks of jobs that wait or run, as far as Slurm lets this user.
  void cancel(const std::vector<std::string>& jobs) const;
  // Returns the tasks of the jobs of these names, of all users. Returns nullopt if squeue fails; then `fault` has the
  // message of squeue.
  std::optional<std::vector<QueuedTask>> tasks(const std::vector<std::string>& names, std::string& fault) const;

 private:
  const std::atomic<bool>& stop_;
};

}  // namespace imud
