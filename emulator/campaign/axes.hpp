// Axes: reads [axes] of a plan.
#pragma once

#include <string>
#include <vector>

#include "emulator/campaign/campaign.hpp"
#include "emulator/ground/table_reader.hpp"

namespace imud {

// Returns the path of a file that a plan names, resolved against `folder`, the plan's folder. `text`: a path, or the
// text of a port with a path, such as record:X.pcapng.
std::string path_from_plan(const std::string& folder, const std::string& text);
// Returns a fault if there is no file at a path_from_plan(), with the nearest name in the file's folder. Returns an
// empty text if there is a file.
std::string missing_file(const std::string& path);

// Reads the axes in the order of the file. `axes` may be nullptr.
std::vector<CampaignAxis> read_axes(const toml::node* axes, const std::string& folder, Faults& faults);
// A key of a plan with its value.
struct PlanEntry {
  std::string key;  // "a.b" for {a = {b = ..}}
  const toml::node* value;
  std::uint32_t line;
};
// Returns the entries of a table and of the tables in it, in the order of the file. A table for which `is_value`
// returns true is one value; nullptr: no table is.
std::vector<PlanEntry> entries_of(const toml::table& table, bool (*is_value)(const toml::table&));
// Returns the reason why no axis and no draw may have this name; empty if the name is permitted.
std::string name_objection(const std::string& name);

// Returns KEY=VALUE for load_config(). `value` is TOML; the key "model" stands for the models of all imus.
std::string override_of(const std::string& key, const std::string& value);
// Returns a value, TOML, in the form for tables: a text loses its quotes.
std::string plain_text(const std::string& value);

}  // namespace imud
