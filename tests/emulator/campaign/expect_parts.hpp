// expect_parts: compares texts, such as faults, with what each must contain.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace imud {

// Expects as many texts as parts, and each part in its text.
inline void expect_parts(const std::vector<std::string>& texts, const std::vector<std::string>& parts) {
  EXPECT_EQ(texts.size(), parts.size());
  for (std::size_t i = 0; i < std::max(texts.size(), parts.size()); ++i) {
    const std::string text = i < texts.size() ? texts[i] : "nothing", part = i < parts.size() ? parts[i] : "nothing";
    EXPECT_NE(text.find(part), text.npos) << text << "\nis not\n" << part;
  }
}

}  // namespace imud
