// The names of the entries of a table that the build makes from a folder.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

namespace imud {

// Returns the expected names of the entries, in the order of their stems. A stem is the name of a .cpp file in
// `folder` (relative to the project), or of a folder beside it that contains a device.cpp. If a name begins with a
// digit, the stem has a word before it: nasa_42.
inline std::vector<std::string> names_from_files(const std::string& folder) {
  namespace fs = std::filesystem;
  const fs::path path = fs::path(IMUD_SOURCE_DIR) / folder;
  std::vector<std::string> names;
  for (const auto& file : fs::directory_iterator(path))
    if (file.path().extension() == ".cpp") names.push_back(file.path().stem().string());
  for (const auto& beside : fs::directory_iterator(path.parent_path()))
    if (folder == "protocols/devices" && fs::exists(beside.path() / "device.cpp"))
      names.push_back(beside.path().filename().string());
  std::ranges::sort(names);
  for (std::string& name : names) {
    const std::size_t last = name.rfind('_') + 1;
    if (last > 0 && name[last] >= '0' && name[last] <= '9') name.erase(0, last);
    std::ranges::replace(name, '_', '-');
  }
  return names;
}

template <class Entries>
std::vector<std::string> names_of(const Entries& entries) {
  std::vector<std::string> names;
  for (const auto* entry : entries) names.emplace_back(entry->name);
  return names;
}

// The suffix of the tests of one entry.
template <class Entry>
std::string test_name(const ::testing::TestParamInfo<const Entry*>& parameter) {
  std::string name(parameter.param->name);
  std::ranges::replace(name, '-', '_');
  return name;
}

}  // namespace imud
