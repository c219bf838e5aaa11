#include "emulator/line_splitter.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

namespace imud {
namespace {

std::vector<std::string> split(LineSplitter& splitter, const std::string& text,
                               const std::vector<std::size_t>& cuts) {
  std::vector<std::string> lines;
  std::size_t begin = 0;
  const auto feed = [&](std::size_t end) {
    splitter.feed(std::as_bytes(std::span(text.data() + begin, end - begin)));
    while (const auto line = splitter.next())
      lines.emplace_back(reinterpret_cast<const char*>(line->data()), line->size());
    begin = end;
  };
  for (const std::size_t cut : cuts) feed(cut);
  feed(text.size());
  return lines;
}

TEST(LineSplitterTest, AnyChunkingGivesTheSameLines) {
  const std::string text = "one\n\nthree is longer\nfour\nrest";
  const std::vector<std::string> expected = {"one", "", "three is longer", "four"};
  for (std::size_t a = 0; a <= text.size(); ++a)
    for (std::size_t b = a; b <= text.size(); ++b) {
      LineSplitter splitter;
      EXPECT_EQ(split(splitter, text, {a, b}), expected) << a << " " << b;
      EXPECT_EQ(splitter.rest(), 4U);
    }
}

TEST(LineSplitterTest, ALineBeyondTheLimitIsLeftOutAndCounted) {
  const std::string text = "a\n" + std::string(LineSplitter::max_line + 1, 'x') + "\nb\n" +
                           std::string(LineSplitter::max_line, 'y') + "\nc\n";
  for (const std::size_t chunk : {std::size_t{1000}, std::size_t{65536}, text.size()}) {
    LineSplitter splitter;
    std::vector<std::size_t> cuts;
    for (std::size_t at = chunk; at < text.size(); at += chunk) cuts.push_back(at);
    const auto lines = split(splitter, text, cuts);
    ASSERT_EQ(lines.size(), 4U);
    EXPECT_EQ(lines[1], "b");
    EXPECT_EQ(lines[2].size(), LineSplitter::max_line);
    EXPECT_EQ(lines[3], "c");
    EXPECT_EQ(splitter.too_long(), 1U);
  }
}

}  // namespace
}  // namespace imud
