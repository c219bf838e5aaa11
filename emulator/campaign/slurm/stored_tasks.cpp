#include "emulator/campaign/slurm/stored_tasks.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>
#include <system_error>

#include "emulator/campaign/shards/shard.hpp"
#include "emulator/ground/text_file.hpp"

namespace imud {

namespace {

std::filesystem::path tasks_path(const std::filesystem::path& campaign) {
  return StoredTasks::folder_in(campaign) / "tasks.json";
}

}  // namespace

std::filesystem::path StoredTasks::folder_in(const std::filesystem::path& campaign) { return campaign / "slurm"; }

bool StoredTasks::are_in(const std::filesystem::path& campaign) {
  std::error_code error;
  return std::filesystem::exists(tasks_path(campaign), error);
}

StoredTasks StoredTasks::read(const std::filesystem::path& campaign, std::uint64_t cases) {
  std::ifstream file(tasks_path(campaign), std::ios::binary);
  try {
    const nlohmann::json json = nlohmann::json::parse(file);
    StoredTasks stored{json.at("name"), {cases, json.at("cases_per_task"), json.at("tasks_per_array")}, {}};
    json.at("options").get_to(stored.options);
    if (stored.tasks.cases_per_task > 0 && stored.tasks.tasks_per_array > 0) return stored;
  } catch (const nlohmann::json::exception&) {
  }
  throw OpenError(fmt::format("{}: is damaged; remove the folder {} when none of its tasks waits or runs",
                              tasks_path(campaign).string(), folder_in(campaign).string()));
}

StoredTasks StoredTasks::keep(const std::filesystem::path& campaign, const SlurmTasks& tasks,
                              const std::vector<std::string>& options) {
  std::random_device random;
  const nlohmann::ordered_json json = {{"name", fmt::format("imud-{:08x}{:08x}", random(), random())},
                                       {"cases_per_task", tasks.cases_per_task},
                                       {"tasks_per_array", tasks.tasks_per_array},
                                       {"options", options}};
  std::error_code error;
  if (!std::filesystem::create_directories(folder_in(campaign) / "log", error) && error)
    throw OpenError(fmt::format("{}: {}", folder_in(campaign).string(), error.message()));
  write_once(tasks_path(campaign), json.dump(1) + "\n");
  return read(campaign, tasks.cases);
}

void StoredTasks::write_script(const std::filesystem::path& campaign, const std::string& text) const {
  const std::filesystem::path path = folder_in(campaign) / "array.sh";
  std::ifstream file(path, std::ios::binary);
  if (std::string(std::istreambuf_iterator<char>(file), {}) == text) return;
  std::error_code error;
  std::filesystem::remove(path, error);
  write_once(path, text);
}

}  // namespace imud
