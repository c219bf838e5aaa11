// run_on_slurm: runs the cases of a campaign on a cluster, as job arrays of Slurm.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace imud {

struct SlurmRunOptions {
  std::vector<std::string> options;  // of sbatch, after the options of the plan
  std::uint64_t cases_per_task = 0;  // 0: as many as take minutes
  bool quiet = false;                // no progress
};

// Measures a few cases, makes the folder, submits arrays whose tasks call `imud campaign run --case`, and follows
// the tasks. `folder`/slurm has the division into tasks (tasks.json), the script (array.sh), and the output of failed
// tasks (log). If the folder has a campaign on Slurm already, this is the same as resume_on_slurm().
//
// The state is the shards and Slurm's queue: this program may end at any time. SIGINT and SIGTERM leave the jobs as
// they are. Returns the worst exit code of a case; 3 if cases are missing, because a signal has ended this program or
// because the tasks have ended early. Throws ConfigError and PortError if a case cannot be run, OpenError if the
// folder cannot be used, or if Slurm does not take the tasks.
int run_on_slurm(const std::string& plan, const std::string& folder, const SlurmRunOptions& options);

// Submits each task that has cases which are missing, damaged or could not be run, unless this task waits or runs
// already. Follows all tasks. Without `options` the tasks have the options with which the campaign has begun.
int resume_on_slurm(const std::string& folder, const SlurmRunOptions& options);

// Returns true if the folder's campaign was begun on Slurm.
bool is_on_slurm(const std::string& folder);

}  // namespace imud
