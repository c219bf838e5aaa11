// Axes: reads [axes] of a plan.
#pragma once

#include <string>
#include <vector>

#include "emulator/campaign/campaign.hpp"
#include "emulator/ground/table_reader.hpp"

namespace imud {

// Returns the path of a file that a plan names, in a port's text too, such as record:X.pcapng: as from `folder`, the
// plan's.
std::string path_from_plan(const std::string& folder, const std::string& text);
// Returns the fault of a path_from_plan() where no file is, with the nearest name in its folder; empty if there is
// one.
std::string missing_file(const std::string& path);

// Reads the axes in the order of the file. `axes` may be nullptr.
std::vector<CampaignAxis> read_axes(const toml::node* axes, const std::string& folder, Faults& faults);
// Returns the keys with their values of a table and of the tables in it, "a.b" for {a = {b = ..}}, in the order of
// the file. `is_value` says which tables are values.
struct PlanEntry {
  std::string key;
  const toml::node* value;
  std::uint32_t line;
};
std::vector<PlanEntry> entries_of(const toml::table& table, bool (*is_value)(const toml::table&));
// Returns why no axis and no draw can have that name; empty if one can.
std::string name_objection(const std::string& name);

// Returns KEY=VALUE for load_config(). `value` is TOML; the key "model" stands for the models of all imus.
std::string override_of(const std::string& key, const std::string& value);
// Returns a value as a table shows it: a text without its quotes.
std::string plain_text(const std::string& value);

}  // namespace imud
