// Names of the entries of a table that the build makes from a folder.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

namespace imud {

// The names that the sources in `folder` (below the project's own) must have given to their entries, sorted.
inline std::vector<std::string> names_from_files(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(IMUD_SOURCE_DIR "/" + folder)) {
    if (file.path().extension() != ".cpp") continue;
    names.push_back(file.path().stem().string());
    std::ranges::replace(names.back(), '_', '-');
  }
  std::ranges::sort(names);
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
std::string test_name(const testing::TestParamInfo<const Entry*>& parameter) {
  std::string name(parameter.param->name);
  std::ranges::replace(name, '-', '_');
  return name;
}

}  // namespace imud
