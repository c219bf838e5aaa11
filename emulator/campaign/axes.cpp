#include "emulator/campaign/axes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <system_error>
#include <tuple>
#include <utility>

#include "core/numbers/elementary.hpp"
#include "emulator/campaign/cases/distribution.hpp"

namespace imud {
namespace {

constexpr std::size_t most_values = 100'000;  // of an axis
constexpr std::string_view all_models = "imu.*.model";

// Returns whether the table is a range of values. A table of configuration keys may have the same names, such as
// truth.from; on an axis, the value of such a key is a list.
bool is_range(const toml::table& table) {
  static constexpr std::string_view keys[] = {"from", "to", "count", "scale"};
  return std::ranges::any_of(keys,
                             [&](std::string_view key) { return table.contains(key) && table.get(key)->is_value(); });
}

// Rounds a computed number to 15 digits, so that 0.1 + 0.2 is 0.3.
std::string rounded(double value) {
  return fmt::to_string(std::strtod(fmt::format("{:.15g}", value).c_str(), nullptr));
}

// Returns a text that is the same for equal values, such as 1 and 1.0, and for lists of equal values.
std::string comparable_text(const toml::node& node) {
  constexpr std::int64_t exact = std::int64_t{1} << 53;  // as doubles
  if (const auto* real = node.as_floating_point()) return fmt::to_string(real->get());
  if (const auto* integer = node.as_integer(); integer != nullptr && std::abs(integer->get()) <= exact)
    return fmt::to_string(static_cast<double>(integer->get()));
  const toml::array* array = node.as_array();
  if (array == nullptr) return toml_value(node);
  std::string text = "[";
  for (const toml::node& item : *array) text += (item.is_table() ? "{}" : comparable_text(item)) + ",";
  return text + "]";
}

// Returns the texts of a range's numbers, from its first to its last.
std::vector<std::string> range(TableReader table) {
  constexpr double largest = 1e300;
  require(table, "from", "the first value");
  require(table, "to", "the last value");
  require(table, "count", "the number of values");
  const double from = table.real("from", 1, -largest, largest), to = table.real("to", 2, -largest, largest);
  const std::uint64_t count = table.unsigned_integer("count", 2, most_values);
  const bool is_log = table.choice<bool>("scale", {{false, "linear"}, {true, "log"}}, false);
  if (table.has("count") && count < 2)
    table.fault("count", fmt::format("give 2 to {} values, or a list", most_values));
  if (from == to) table.fault("to", "is the same as from; give a list for a single value");
  const bool is_positive = from > 0 && to > 0;
  if (is_log && !is_positive) table.fault("from", "a range with scale = \"log\" needs from and to above 0");
  table.finish();
  if (count < 2 || from == to || (is_log && !is_positive)) return {};
  std::vector<std::string> texts;
  for (std::uint64_t i = 0; i < count; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(count - 1);
    if (i == 0 || i == count - 1)
      texts.push_back(fmt::to_string(i == 0 ? from : to));
    else if (is_log)
      texts.push_back(rounded(elementary::exp((1 - share) * elementary::log(from) + share * elementary::log(to))));
    else
      texts.push_back(rounded((1 - share) * from + share * to));
  }
  return texts;
}

class Values {
 public:
  Values(const std::string& folder, Faults& faults) : folder_(folder), faults_(faults) {}

  // Adds what `key` sets to `value`.
  void set(CampaignAxis::Value& value, const std::string& key, const toml::node& node) {
    if (key == "capture") {
      if (const auto* text = node.as_string(); text != nullptr && !text->get().empty())
        value.capture = file(key, node, text->get());
      else
        fault(key, node, "give the path of a capture in quotes");
    } else if (key == "scenario") {
      std::vector<std::string> paths;
      if (const auto* text = node.as_string()) {
        if (!text->get().empty()) paths.push_back(text->get());
      } else if (const auto* list = node.as_array(); list != nullptr && list->is_homogeneous<std::string>()) {
        for (const toml::node& path : *list) paths.push_back(path.as_string()->get());
      } else {
        fault(key, node, "give the path of a scenario, \"\" for none, or a list of paths");
      }
      for (const std::string& path : paths) value.scenarios.push_back(file(key, node, path));
    } else if (node.is_table()) {
      fault(key, node, "give a number, a text, true or false, or a list of them");
    } else {
      try {
        value.overrides.push_back(override_of(key, toml_value(node)));
      } catch (const std::invalid_argument& error) {
        fault(key, node, error.what());
      }
    }
  }

  CampaignAxis read(const PlanEntry& entry) {
    CampaignAxis axis{entry.key, {}, entry.line};
    const toml::node& node = *entry.value;
    if (const std::string objection = name_objection(entry.key); !objection.empty())
      fault(entry.key, node, objection);
    if (const auto* table = node.as_table()) {
      toml::table unused;
      std::set<std::string> texts;
      for (const std::string& text :
           range(TableReader(table, fmt::format("axes.{}.", entry.key), entry.line, faults_, unused))) {
        if (!texts.insert(text).second) {
          fault(entry.key, node,
                fmt::format("has the value {} twice; give fewer values, or ends further apart", text));
          break;
        }
        axis.values.push_back({text, {override_of(entry.key, text)}, {}, {}});
      }
      return axis;
    }
    const toml::array* list = node.as_array();
    if (list == nullptr || list->empty()) {
      fault(entry.key, node, "give a list of values, or a range {from = .., to = .., count = ..}");
      return axis;
    }
    if (list->size() > most_values) fault(entry.key, node, fmt::format("give at most {} values", most_values));
    std::set<std::string> texts, numbers;
    for (const toml::node& item : *list) {
      const CampaignAxis::Value& value = axis.values.emplace_back(read_value(entry.key, item));
      const bool is_new_number = item.is_table() || numbers.insert(comparable_text(item)).second;
      if (!texts.insert(value.text).second || !is_new_number)
        fault(entry.key, item, fmt::format("has the value {} twice; give each value once", value.text));
    }
    return axis;
  }

 private:
  CampaignAxis::Value read_value(const std::string& axis, const toml::node& item) {
    CampaignAxis::Value value;
    const toml::table* table = item.as_table();
    if (table == nullptr) {
      set(value, axis, item);
      value.text = text_of(item);
      return value;
    }
    // Keys that are set together.
    std::vector<std::string> all;
    for (const PlanEntry& entry : entries_of(*table, nullptr)) {
      if (entry.key == "name") {
        value.text = text_of(*entry.value);
        continue;
      }
      if (const std::string objection = name_objection(entry.key); !objection.empty())
        fault(entry.key, *entry.value, objection);
      set(value, entry.key, *entry.value);
      all.push_back(fmt::format("{}={}", entry.key, text_of(*entry.value)));
    }
    if (all.empty()) fault(axis, item, "give at least one key that the value sets");
    if (value.text.empty()) value.text = fmt::format("{}", fmt::join(all, " "));
    return value;
  }
  static std::string text_of(const toml::node& node) {
    try {
      return plain_text(toml_value(node));
    } catch (const std::invalid_argument&) {  // a fault already
      return {};
    }
  }
  std::string file(const std::string& key, const toml::node& node, const std::string& text) {
    std::string path = path_from_plan(folder_, text);
    if (const std::string missing = missing_file(path); !missing.empty()) fault(key, node, missing);
    return path;
  }
  void fault(const std::string& key, const toml::node& node, std::string_view what) {
    faults_.add(node.source().begin.line, "axes." + key, what);
  }

  const std::string& folder_;
  Faults& faults_;
};

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

std::vector<CampaignAxis> read_axes(const toml::node* axes, const std::string& folder, Faults& faults) {
  std::vector<CampaignAxis> all;
  if (axes == nullptr) return all;
  if (!axes->is_table()) {
    faults.add(axes->source().begin.line, "axes", "give a table, [axes]");
    return all;
  }
  Values values(folder, faults);
  for (const PlanEntry& entry : entries_of(*axes->as_table(), is_range)) all.push_back(values.read(entry));
  return all;
}

std::string override_of(const std::string& key, const std::string& value) {
  return fmt::format("{}={}", key == "model" ? all_models : key, value);
}

std::string plain_text(const std::string& value) {
  return value.starts_with('"') ? nlohmann::json::parse(value).get<std::string>() : value;
}

}  // namespace imud
