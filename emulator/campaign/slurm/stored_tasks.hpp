// StoredTasks: the division of a campaign into tasks of Slurm, in the folder `slurm` of the campaign's folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "emulator/campaign/slurm/slurm_tasks.hpp"

namespace imud {

// The content of tasks.json. It is written once, so that a task has the same cases whenever it is submitted.
struct StoredTasks {
  std::string name;  // of the jobs, before the number of the array; unique to the folder
  SlurmTasks tasks;
  std::vector<std::string> options;  // of sbatch

  static std::filesystem::path folder_in(const std::filesystem::path& campaign);
  static bool are_in(const std::filesystem::path& campaign);
  // Throws OpenError if the file is damaged.
  static StoredTasks read(const std::filesystem::path& campaign, std::uint64_t cases);
  // Makes the folder and the file, unless another process has made them. Returns the content of the file. Throws
  // OpenError.
  static StoredTasks keep(const std::filesystem::path& campaign, const SlurmTasks& tasks,
                          const std::vector<std::string>& options);
  // Writes array.sh unless it has this text. Throws std::runtime_error.
  void write_script(const std::filesystem::path& campaign, const std::string& text) const;
};

}  // namespace imud
