// FrameSearch, with frames that begin with their own length.
#include "protocols/wire/frame_search.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace imud {
namespace {

using Search = FrameSearch<8>;
using Bytes = std::vector<std::byte>;

TEST(FrameSearch, DiscardsOneByteAndSearchesOn) {
  std::vector<std::size_t> found;
  const auto parse = [&](std::span<const std::byte> held) {
    const auto length = std::to_integer<std::size_t>(held[0]);
    if (length == 0 || length > 8) return Search::reject;
    if (held.size() < length) return Search::need_more;
    found.push_back(length);
    return length;
  };
  Search search;
  EXPECT_EQ(search.resync(parse), 0U) << "nothing is held";
  EXPECT_EQ(search.feed(Bytes{std::byte{8}, std::byte{0}, std::byte{2}, std::byte{9}, std::byte{5}}, parse), 0U);
  EXPECT_TRUE(found.empty());
  EXPECT_EQ(search.resync(parse), 2U) << "the 8 and the 0";
  EXPECT_EQ(found, std::vector<std::size_t>{2});
  EXPECT_FALSE(search.is_empty()) << "the 5";
  EXPECT_EQ(search.resync(parse), 1U);
  EXPECT_TRUE(search.is_empty());
}

}  // namespace
}  // namespace imud
