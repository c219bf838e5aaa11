// Holds every entry of the truth format table to what holds for all of them (protocols/truth_format.hpp).
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "protocols/truth_format.hpp"
#include "tests/protocols/recording.hpp"
#include "tests/protocols/table_names.hpp"
#include "tests/support/allocations.hpp"

namespace imud {
namespace {

TEST(TruthFormatTable, HoldsOneEntryPerFileByItsName) {
  EXPECT_EQ(names_of(truth_formats()), names_from_files("protocols/truth_formats"));
  for (const TruthFormat* format : truth_formats()) EXPECT_EQ(find_truth_format(format->name), format);
  EXPECT_EQ(find_truth_format("no such format"), nullptr);
}

TEST(Cause, IsAWordForEachResult) {
  const std::vector<std::string_view> words = {"",    "no_state", "short",      "long",  "magic",  "version",
                                               "crc", "number",   "not_finite", "range", "columns"};
  std::vector<std::string_view> causes;
  for (int result = 0; result <= static_cast<int>(TruthResult::no_columns); ++result)
    causes.push_back(cause(static_cast<TruthResult>(result)));
  EXPECT_EQ(causes, words);
}

class TruthFormats : public testing::TestWithParam<const TruthFormat*> {};

INSTANTIATE_TEST_SUITE_P(All, TruthFormats, testing::ValuesIn(truth_formats()), test_name<TruthFormat>);

TEST_P(TruthFormats, SaysWhatItIs) {
  for (const std::string_view text : {GetParam()->summary, GetParam()->document}) {
    EXPECT_FALSE(text.empty());
    EXPECT_EQ(text.find('\n'), std::string_view::npos);
  }
}

// Bytes at random, and text made of what truth formats are made of: refused, or a truth that is in range; and without
// an allocation.
TEST_P(TruthFormats, AnyBytesAreHarmless) {
  const auto decoder = GetParam()->make(Settings(GetParam()->settings));
  std::mt19937_64 random(5);
  constexpr std::string_view pieces[] = {"time_ns", "sigma_BN_1", "<LABELS> ", "Time", "pi-rad sec", ",",      ",",
                                         ",",       ",",          "\n",        " ",    "1",          "-2.5e7", "nan",
                                         "inf",     "1e999",      "IMUT",      "\0",   "#",          "{",      "}"};
  for (int round = 0; round < 20'000; ++round) {
    std::vector<std::byte> record;
    if (round % 2 == 0) {
      record = random_bytes(random() % 600, random);
    } else {
      for (std::size_t i = random() % 1000; i > 0; --i)
        std::ranges::copy(std::as_bytes(std::span(pieces[random() % std::size(pieces)])), std::back_inserter(record));
    }
    Truth truth;
    const std::uint64_t before = allocations();
    const TruthResult result = decoder->decode(record, truth);
    ASSERT_EQ(allocations(), before);
    ASSERT_EQ(cause(result).empty(), result == TruthResult::ok);
    ASSERT_TRUE(result != TruthResult::ok || (is_finite(truth) && is_in_range(truth)));
  }
}

}  // namespace
}  // namespace imud
