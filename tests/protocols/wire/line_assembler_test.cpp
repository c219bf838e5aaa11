#include "protocols/wire/line_assembler.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace imud {
namespace {

// Returns the lines of `text`, fed in pieces that end at `cuts`; "(n)" stands for a line of n characters that is too
// long.
template <std::size_t Max>
std::vector<std::string> assemble(LineAssembler<Max>& lines, std::string_view text,
                                  const std::vector<std::size_t>& cuts) {
  std::vector<std::string> all;
  std::size_t begin = 0;
  const auto feed = [&](std::size_t end) {
    const std::string piece(text.substr(begin, end - begin));  // a copy: the next piece does not overwrite it
    lines.feed(piece);
    while (const auto line = lines.next()) {
      EXPECT_EQ(line->text.size(), std::min(line->size, Max));
      all.push_back(line->is_too_long() ? "(" + std::to_string(line->size) + ")" : std::string(line->text));
    }
    begin = end;
  };
  for (const std::size_t cut : cuts) feed(cut);
  feed(text.size());
  return all;
}

TEST(LineAssembler, AnyPiecesGiveTheSameLines) {
  const std::string text = "one\n\nthree is longer\nfour\nrest";
  const std::vector<std::string> expected = {"one", "", "three is longer", "four"};
  for (std::size_t a = 0; a <= text.size(); ++a)
    for (std::size_t b = a; b <= text.size(); ++b) {
      LineAssembler<15> lines;
      EXPECT_EQ(assemble(lines, text, {a, b}), expected) << a << " " << b;
      EXPECT_EQ(lines.size(), 4U);
      EXPECT_EQ(lines.finish_line().text, "rest");
      EXPECT_EQ(lines.size(), 0U);
    }
}

TEST(LineAssembler, EachOfSeveralEndsEndsALine) {
  const std::string text = "a\rb\nc\r\nd";
  const std::vector<std::string> expected = {"a", "b", "c", ""};
  for (std::size_t cut = 0; cut <= text.size(); ++cut) {
    LineAssembler<4> lines("\r\n");
    EXPECT_EQ(assemble(lines, text, {cut}), expected) << cut;
  }
  LineAssembler<4> lines;
  EXPECT_EQ(assemble(lines, text, {}), (std::vector<std::string>{"a\rb", "c\r"}));
}

TEST(LineAssembler, ALineThatIsTooLongKeepsItsPlaceAndSize) {
  constexpr std::size_t max = 100;
  const std::string text = "a\n" + std::string(max + 1, 'x') + "\nb\n" + std::string(max, 'y') + "\nc\n" +
                           std::string(5 * max, 'z') + "\n";
  const std::vector<std::string> expected = {"a", "(101)", "b", std::string(max, 'y'), "c", "(500)"};
  for (const std::size_t size : {1U, 7U, 100U, 101U, 102U, 1000U}) {
    std::vector<std::size_t> cuts;
    for (std::size_t at = size; at < text.size(); at += size) cuts.push_back(at);
    LineAssembler<max> lines;
    EXPECT_EQ(assemble(lines, text, cuts), expected) << size;
  }
}

TEST(LineAssembler, AnUnfinishedLineCanBeDropped) {
  LineAssembler<4> lines;
  EXPECT_EQ(assemble(lines, "abc\ndefghi", {}), std::vector<std::string>{"abc"});
  EXPECT_EQ(lines.drop_line(), 6U);
  EXPECT_EQ(assemble(lines, "jk\n", {}), std::vector<std::string>{"jk"});
  EXPECT_EQ(lines.drop_line(), 0U);
}

TEST(LineAssembler, CharactersCanBeTakenBackUnlessTheLineIsTooLong) {
  LineAssembler<3> lines("\r");
  EXPECT_FALSE(lines.erase_last());
  for (const char c : {'a', 'b', 'c'}) EXPECT_TRUE(lines.append(c));
  EXPECT_TRUE(lines.erase_last());
  EXPECT_TRUE(lines.append('d'));
  EXPECT_EQ(lines.finish_line().text, "abd");
  for (const char c : {'a', 'b', 'c'}) EXPECT_TRUE(lines.append(c));
  EXPECT_FALSE(lines.append('d'));
  EXPECT_FALSE(lines.erase_last());
  EXPECT_TRUE(lines.finish_line().is_too_long());
  EXPECT_TRUE(lines.append('e'));
  EXPECT_EQ(lines.finish_line().text, "e");
}

}  // namespace
}  // namespace imud
