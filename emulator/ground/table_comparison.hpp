// The keys of two configurations whose values differ.
#pragma once

#include <toml++/toml.h>

#include <functional>
#include <string>

namespace imud {

// A key with its path, and its values as in TOML, or words for an absent key or a table.
using KeyDiffers = std::function<void(const std::string& key, const std::string& one, const std::string& other)>;

// Calls `differs` for each key of the tables whose values differ, with `prefix` before it, and for the keys of tables
// in both. `is_absent_empty`: an absent table counts as an empty one; otherwise the two differ.
void compare(const toml::table* one, const toml::table* other, const std::string& prefix, bool is_absent_empty,
             const KeyDiffers& differs);

// Returns the [[imu]] of that name; nullptr if there is none.
const toml::table* imu_table(const toml::table& root, const std::string& name);

}  // namespace imud
