// Checks for every entry of the truth format table what holds for all of them (protocols/truth_format.hpp).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <stdexcept>
#include <string>

#include "protocols/quantities/line_truth_decoder.hpp"
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

TEST_P(TruthFormats, DescribesItself) {
  for (const std::string_view text : {GetParam()->summary, GetParam()->document}) {
    EXPECT_FALSE(text.empty());
    EXPECT_EQ(text.find('\n'), std::string_view::npos);
  }
}

// The setting `columns` throws if a required one is missing.
TEST_P(TruthFormats, RequiresTheColumnsOfItsEntry) {
  const TruthFormat& format = *GetParam();
  const bool has_setting = std::ranges::count(format.settings, "columns", &Setting::key) == 1;
  ASSERT_TRUE(has_setting || format.columns.empty());
  if (format.columns.empty()) return;
  const auto accepts = [&](const std::vector<std::string>& names) {
    Settings settings(format.settings);
    settings.set("columns", names);
    try {
      return format.make(settings) != nullptr;
    } catch (const std::invalid_argument&) {
      return false;
    }
  };
  std::vector<std::string> required;
  std::vector<std::span<const std::string_view>> alternatives;
  for (const ColumnGroup& group : format.columns) {
    EXPECT_FALSE(group.names.empty());
    EXPECT_FALSE(group.help.empty());
    if (group.need == ColumnGroup::required) required.insert(required.end(), group.names.begin(), group.names.end());
    if (group.need == ColumnGroup::one_of) alternatives.push_back(group.names);
  }
  EXPECT_GE(required.size(), 7U);
  if (alternatives.empty())
    alternatives.emplace_back();
  else
    EXPECT_FALSE(accepts(required));
  for (const auto& alternative : alternatives) {
    std::vector<std::string> names = required;
    names.insert(names.end(), alternative.begin(), alternative.end());
    EXPECT_TRUE(accepts(names));
    for (std::size_t i = 0; i < names.size(); ++i) {
      std::vector<std::string> without = names;
      without.erase(without.begin() + static_cast<std::ptrdiff_t>(i));
      EXPECT_FALSE(accepts(without)) << names[i];
    }
  }
}

TEST_P(TruthFormats, AnswersIfItsEntryStatesIt) {
  const auto decoder = GetParam()->make(Settings(GetParam()->settings));
  const auto answers = std::make_unique<FrameBuffer>();
  decoder->acknowledge(Truth(), {}, 0, *answers);
  EXPECT_EQ(!answers->frames().empty(), GetParam()->acknowledges);
}

// Random text made of parts of the truth formats.
std::vector<std::byte> random_text(std::mt19937_64& random) {
  constexpr std::string_view pieces[] = {
      "time_ns", "sigma_BN_1", "<LABELS> ", "Time", "pi-rad sec", ",",   ",",     ",",    ",",       "\n",
      " ",       "1",          "-2.5e7",    "nan",  "\"",         "inf", "1e999", "IMUT", {"\0", 1}, "\xEF\xBB\xBF",
      "#",       "{",          "}"};
  std::vector<std::byte> text;
  for (std::size_t i = random() % 1000; i > 0; --i) {
    const std::string_view piece = pieces[random() % std::size(pieces)];
    EXPECT_FALSE(piece.empty());
    std::ranges::copy(std::as_bytes(std::span(piece)), std::back_inserter(text));
  }
  return text;
}

// Decodes the last input. Every record must be refused, or yield a truth in range, without an allocation.
std::vector<TruthResult> results(TruthDecoder& decoder) {
  std::vector<TruthResult> all;
  all.reserve(2000);
  Truth truth;
  std::array<char, 200> remark;
  const std::uint64_t before = allocations();
  while (const auto result = decoder.next(truth)) {
    if (all.size() % 16 == 1) {
      const std::span<char> room = std::span(remark).first(all.size() % remark.size());
      EXPECT_LE(decoder.describe(*result, room), room.size());
    }
    all.push_back(*result);
    EXPECT_EQ(cause(*result).empty(), *result == TruthResult::ok);
    EXPECT_TRUE(*result != TruthResult::ok || (is_finite(truth) && is_in_range(truth)));
    if (all.size() == all.capacity()) throw std::logic_error("next() returns something without end");
  }
  EXPECT_EQ(allocations(), before);
  return all;
}

TEST_P(TruthFormats, AnyBytesAreHarmless) {
  const auto decoder = GetParam()->make(Settings(GetParam()->settings));
  std::mt19937_64 random(5);
  std::size_t records = 0;
  for (int round = 0; round < 6'000; ++round) {
    const auto bytes = round % 2 == 0 ? random_bytes(random() % 600, random) : random_text(random);
    const std::uint64_t before = allocations();
    decoder->feed(bytes, round % 3 == 0 ? TruthInput::stream : TruthInput::datagram, {});
    ASSERT_EQ(allocations(), before);
    records += results(*decoder).size();
    if (HasFailure()) return;
  }
  EXPECT_GT(records, 3'000U);
}

bool has_lines(const TruthDecoder& decoder) { return dynamic_cast<const LineTruthDecoder*>(&decoder) != nullptr; }

// A stream of any bytes gives the same records in any pieces.
TEST_P(TruthFormats, AnyPiecesOfAnyStreamGiveTheSameRecords) {
  if (!GetParam()->delimits_itself) return;  // the configuration refuses such a format on a stream
  std::mt19937_64 random(7);
  const auto whole = GetParam()->make(Settings(GetParam()->settings));
  const auto cut = GetParam()->make(Settings(GetParam()->settings));
  std::size_t records = 0;
  for (int round = 0; round < 300; ++round) {
    const auto bytes = round % 2 == 0 ? random_bytes(random() % 2000, random) : random_text(random);
    whole->feed(bytes, TruthInput::stream, {});
    const std::vector<TruthResult> wanted = results(*whole);
    std::vector<TruthResult> found;
    for (std::span<const std::byte> rest = bytes; !rest.empty();) {
      const std::size_t size = std::min<std::size_t>(rest.size(), 1 + random() % (round % 3 == 0 ? 3 : 500));
      cut->feed(rest.first(size), TruthInput::stream, {});
      std::ranges::copy(results(*cut), std::back_inserter(found));
      rest = rest.subspan(size);
    }
    ASSERT_EQ(found, wanted);
    records += wanted.size();
  }
  EXPECT_GE(records, 1U);
}

// A stream cut into any pieces gives the same records as each line in a datagram of its own.
TEST_P(TruthFormats, AnyPiecesOfAStreamGiveTheSameRecords) {
  if (!has_lines(*GetParam()->make(Settings(GetParam()->settings)))) return;
  std::mt19937_64 random(6);
  const auto whole = GetParam()->make(Settings(GetParam()->settings));
  const auto cut = GetParam()->make(Settings(GetParam()->settings));
  std::size_t records = 0;
  for (int round = 0; round < 300; ++round) {
    std::vector<std::byte> text = random_text(random);
    text.push_back(std::byte{'\n'});
    std::vector<TruthResult> wanted, found;
    for (std::span<const std::byte> rest = text; !rest.empty();) {
      const auto end = std::ranges::find(rest, std::byte{'\n'}) + 1;
      whole->feed({rest.begin(), end}, TruthInput::datagram, {});
      std::ranges::copy(results(*whole), std::back_inserter(wanted));
      rest = {end, rest.end()};
    }
    for (std::span<const std::byte> rest = text; !rest.empty();) {
      const std::size_t size = std::min<std::size_t>(rest.size(), 1 + random() % (round % 2 == 0 ? 3 : 500));
      cut->feed(rest.first(size), TruthInput::stream, {});
      std::ranges::copy(results(*cut), std::back_inserter(found));
      rest = rest.subspan(size);
    }
    ASSERT_EQ(found, wanted);
    records += wanted.size();
  }
  EXPECT_GT(records, 1'000U);
}

// A record cut short by the end of the input is counted, is not decoded, and does not affect later input.
TEST_P(TruthFormats, AnUnfinishedRecordIsCountedWhenTheStreamEnds) {
  const auto decoder = GetParam()->make(Settings(GetParam()->settings));
  if (!has_lines(*decoder)) return;
  const auto feed = [&](std::string_view text) {
    decoder->feed(std::as_bytes(std::span(text)), TruthInput::stream, {});
    return results(*decoder).size();
  };
  EXPECT_EQ(feed("# a remark\n#"), 1U);
  EXPECT_EQ(decoder->losses().cut_short, 0U);
  decoder->finish();
  EXPECT_EQ(decoder->losses().cut_short, 1U);
  EXPECT_EQ(decoder->losses().cut_short_by, 1U);
  EXPECT_EQ(feed("\n\n"), 2U);
  decoder->finish();
  EXPECT_EQ(decoder->losses().cut_short, 1U);
  EXPECT_EQ(feed(std::string(70'000, 'x')), 0U);
  EXPECT_EQ(feed("\n#\n"), 1U);
  EXPECT_EQ(decoder->losses().too_long, 1U);
}

}  // namespace
}  // namespace imud
