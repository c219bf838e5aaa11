#include "emulator/ground/table_comparison.hpp"

#include <algorithm>
#include <sstream>
#include <vector>

namespace imud {

namespace {

std::string value_text(const toml::node* node) {
  if (node == nullptr) return "no value";
  if (node->is_table()) return "a table";
  std::ostringstream text;
  node->visit([&](const auto& value) { text << value; });
  return text.str();
}

}  // namespace

void compare(const toml::table* one, const toml::table* other, const std::string& prefix, bool is_absent_empty,
             const KeyDiffers& differs) {
  std::vector<std::string> keys;
  for (const toml::table* table : {one, other})
    if (table != nullptr)
      for (auto&& [key, value] : *table)
        if (const std::string name(key.str()); std::ranges::count(keys, name) == 0) keys.push_back(name);
  const auto node_of = [](const toml::table* table, const std::string& key) {
    return table == nullptr ? nullptr : table->get(key);
  };
  const auto is_table = [&](const toml::node* node) { return node == nullptr ? is_absent_empty : node->is_table(); };
  const auto table_of = [](const toml::node* node) { return node == nullptr ? nullptr : node->as_table(); };
  for (const std::string& key : keys) {
    const toml::node *a = node_of(one, key), *b = node_of(other, key);
    if (is_table(a) && is_table(b))
      compare(table_of(a), table_of(b), prefix + key + ".", is_absent_empty, differs);
    else if (const std::string text = value_text(a), other_text = value_text(b); text != other_text)
      differs(prefix + key, text, other_text);
  }
}

const toml::table* imu_table(const toml::table& root, const std::string& name) {
  if (const toml::array* imus = root["imu"].as_array())
    for (const toml::node& imu : *imus)
      if (const toml::table* table = imu.as_table(); table && (*table)["name"].value_or(std::string()) == name)
        return table;
  return nullptr;
}

}  // namespace imud
