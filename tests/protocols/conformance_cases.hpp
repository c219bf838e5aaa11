// Every configuration in which the entries of the protocol table are tested.
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <ostream>
#include <string>
#include <vector>

#include "tests/protocols/conformance.hpp"
#include "tests/protocols/recording.hpp"

namespace imud {

struct ConformanceCase {
  Protocol protocol;  // the entry, adapted to the settings
  Settings settings;
  std::string name;  // of protocol and settings, in characters that are allowed in the name of a test
};
inline std::ostream& operator<<(std::ostream& out, const ConformanceCase& one) { return out << one.name; }
inline std::string case_name(const testing::TestParamInfo<ConformanceCase>& parameter) {
  return parameter.param.name;
}

inline std::string name_of(std::string_view protocol, std::string_view settings) {
  std::string name;
  for (const char c : std::string(protocol) + ' ' + std::string(settings))
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      name += c;
    else if (!name.empty() && name.back() != '_')
      name += '_';
  while (name.ends_with('_')) name.pop_back();
  return name;
}

inline std::vector<ConformanceCase> conformance_cases(bool (*suits)(const Protocol&)) {
  static constexpr ConformanceSettings initial[1] = {};
  std::vector<ConformanceCase> cases;
  for (const Protocol* entry : protocols()) {
    if (!suits(*entry)) continue;
    const std::span declared = Conformance::of(*entry).settings;
    for (const ConformanceSettings& one : declared.empty() ? std::span(initial) : declared) {
      cases.push_back({*entry, settings_of(*entry, one.settings), name_of(entry->name, one.settings)});
      if (one.adapt != nullptr) one.adapt(cases.back().protocol);
    }
  }
  return cases;
}

}  // namespace imud
