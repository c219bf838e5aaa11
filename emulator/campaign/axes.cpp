#include "emulator/campaign/axes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>


namespace imud {
namespace {

constexpr std::string_view all_models = "imu.*.model";

void append_entries(std::vector<PlanEntry>& all, const std::string& prefix, const toml::table& table,
                    bool (*is_value)(const toml::table&)) {
  for (const auto& [key, value] : table) {
    const std::string path = prefix + std::string(key.str());
    const toml::table* child = value.as_table();
    if (child != nullptr && !child->empty() && (is_value == nullptr || !is_value(*child)))
      append_entries(all, path + ".", *child, is_value);
    else
      all.push_back({path, &value, key.source().begin.line});
  }
}

}  // namespace

std::string path_from_plan(const std::string& folder, const std::string& text) {
  const Transport* named = text.find(':') == text.npos ? nullptr : transport_of(text);
  if (named != nullptr && !named->has_path) return text;
  const std::size_t begin = named == nullptr ? 0 : named->name.size() + 1;
  const std::size_t end = std::min(text.find('?', begin), text.size());
  const std::filesystem::path path = text.substr(begin, end - begin);
  return text.substr(0, begin) + (folder / path).lexically_normal().string() + text.substr(end);
}

std::string missing_file(const std::string& text) {
  const Transport* named = text.find(':') == text.npos ? nullptr : transport_of(text);
  if (named != nullptr && !named->has_path) return fmt::format("{}: is no file, which each case could read", text);
  const std::size_t begin = named == nullptr ? 0 : named->name.size() + 1;
  const std::filesystem::path path = text.substr(begin, std::min(text.find('?', begin), text.size()) - begin);
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return {};
  if (std::filesystem::exists(path, error))
    return fmt::format("{}: is no regular file, which each case could read", path.string());
  std::vector<std::string> beside;
  for (auto file = std::filesystem::directory_iterator(path.parent_path(), error);
       !error && file != std::filesystem::directory_iterator(); file.increment(error))
    beside.push_back(file->path().filename().string());
  std::ranges::sort(beside);
  return fmt::format("there is no file {}; {}", path.string(),
                     suggestion(path.filename().string(), beside, "paths are relative to the plan's folder"));
}

std::vector<PlanEntry> entries_of(const toml::table& table, bool (*is_value)(const toml::table&)) {
  std::vector<PlanEntry> all;
  append_entries(all, "", table, is_value);
  std::ranges::stable_sort(
      all, {}, [](const PlanEntry& entry) { return std::pair(entry.line, entry.value->source().begin.column); });
  return all;
}

std::string name_objection(const std::string& name) {
  if (name == "seed") return "give the seeds as seeds = \"FIRST..LAST\", which vary fastest";
  if (name == "clock") return "cases are replayed by the clock \"fast\"; omit it";
  if (name == "case" || name == "draw" || name == "base")
    return fmt::format("no axis can be called \"{}\"; give another name", name);
  return {};
}

std::string override_of(const std::string& key, const std::string& value) {
  return fmt::format("{}={}", key == "model" ? all_models : key, value);
}

std::string plain_text(const std::string& value) {
  return value.starts_with('"') ? nlohmann::json::parse(value).get<std::string>() : value;
}

}  // namespace imud
