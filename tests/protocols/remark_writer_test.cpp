#include "protocols/quantities/remark_writer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <string>

namespace imud {
namespace {

template <class Write>
std::string written(std::size_t room, Write write) {
  std::string text(room, '#');
  RemarkWriter out(text);
  write(out);
  EXPECT_LE(out.size(), room);
  return text.substr(0, out.size());
}

TEST(RemarkWriter, NumbersAndQuotes) {
  EXPECT_EQ(written(100, [](RemarkWriter& out) { out << "a " << 7U << " " << -1.5; }), "a 7 -1.5");
  EXPECT_EQ(written(100, [](RemarkWriter& out) { out << std::numeric_limits<std::int64_t>::min(); }),
            "-9223372036854775808");
  EXPECT_EQ(written(100, [](RemarkWriter& out) { out.quote("a\tb\xC3\xA4\n") << "."; }), "\"a?b???\".");
  EXPECT_EQ(written(100, [](RemarkWriter& out) { out.quote("abcdef", 5); }), "\"abcde...\"");
}

TEST(RemarkWriter, ATextThatIsTooLongEndsInDots) {
  EXPECT_EQ(written(8, [](RemarkWriter& out) { out << "12345678"; }), "12345678");
  EXPECT_EQ(written(8,
                    [](RemarkWriter& out) {
                      out << "1234"
                          << "56789";
                    }),
            "12345...");
  EXPECT_EQ(written(8,
                    [](RemarkWriter& out) {
                      out << "12345678"
                          << "9"
                          << "0";
                    }),
            "12345...");
  EXPECT_EQ(written(2, [](RemarkWriter& out) { out << "123"; }), "..");
  EXPECT_EQ(written(0, [](RemarkWriter& out) { out << "123"; }), "");
}

}  // namespace
}  // namespace imud
