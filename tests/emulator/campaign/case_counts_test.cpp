// The counts of a campaign's status, of shards that are made up. tests/web/campaign_page_test.py has the program.
#include "emulator/campaign/status/case_counts.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace imud {
namespace {

constexpr std::uint64_t cases_of_shard_here = 10;

std::string row_here(std::uint64_t index) {
  using Json = nlohmann::ordered_json;
  const bool holds = index % 7 != 0, runs = index % 11 != 0;
  const std::vector<std::string> rates = {"50", "1000", "200"};
  // Texts that look like members of a row.
  Json row = {{"case", index},
              {"identity", ""},
              {"axes",
               {{"rate", rates[index / 100 % 3]},
                {"\"axes\":{", fmt::format("}},\"seed\":{}", index % 2)},
                {"draw", fmt::to_string(index)}}},
              {"seed", index},
              {"exit_code", !runs   ? 1
                            : holds ? 0
                                    : 3},
              {"ended_by", "end_of_capture"},
              {"digest", {{"imu1", ""}}},
              {"figures", Json::object()},
              {"expect", Json::object()},
              {"shortfalls", Json::array()},
              {"error", nullptr},
              {"test", {{"metrics", {{"expect", {{"none", false}}}}}}}};
  if (runs)
    row["expect"] = {{"\"expect\":{", true}, {"settles", holds}};
  else
    row["error"] = "killed";
  return row.dump();
}

// `apart`: the counts of each shard are made alone, and added.
CaseCounts counts_of(const std::vector<std::uint64_t>& shards, bool apart) {
  CaseCounts counts;
  for (const std::uint64_t number : shards) {
    const std::uint64_t first = number * cases_of_shard_here;
    Shard shard{.head = {"", "", "", {first, first + cases_of_shard_here - 1}}, .rows = {}};
    for (std::uint64_t i = 0; i < cases_of_shard_here; ++i) shard.rows.push_back(row_here(first + i));
    CaseCounts one;
    (apart ? one : counts).add(shard);
    counts.add(one);
  }
  return counts;
}

void expect_rate(const CaseRate& rate, std::uint64_t passes, std::uint64_t runs) {
  EXPECT_EQ(rate.runs, runs);
  EXPECT_EQ(rate.passes, passes);
}

TEST(CaseCounts, DoNotDependOnTheOrderOfShards) {
  std::vector<std::uint64_t> forward, backward;
  for (std::uint64_t i = 0; i < 60; ++i) forward.push_back(i);
  backward.assign(forward.rbegin(), forward.rend());
  for (const auto& [order, apart] : std::vector<std::pair<std::vector<std::uint64_t>, bool>>{
           {forward, false}, {forward, true}, {backward, false}, {backward, true}}) {
    const CaseCounts counts = counts_of(order, apart);
    // Among 0 to 599 are 55 multiples of 11, 86 of 7, and 8 of both.
    EXPECT_EQ(counts.tally.could_not_be_run, 55U);
    EXPECT_EQ(counts.done, 545U);
    EXPECT_EQ(counts.tally.expectations_failed, 78U);
    EXPECT_EQ(counts.tally.incomplete, 0U);
    ASSERT_EQ(counts.names(), (std::vector<std::string>{"cases", "\"expect\":{", "settles"}));
    expect_rate(counts.rates()[0], 467, 545);
    expect_rate(counts.rates()[1], 545, 545);
    expect_rate(counts.rates()[2], 467, 545);

    const std::vector<CaseCounts::Axis> axes = counts.axes();
    ASSERT_EQ(axes.size(), 3U);
    ASSERT_EQ(axes[0].values.size(), 3U);
    EXPECT_EQ(axes[0].values[0].text, "50");
    EXPECT_EQ(axes[0].values[1].text, "200") << "by number, not in the order of the cases";
    EXPECT_EQ(axes[0].values[2].text, "1000");
    std::uint64_t runs = 0;
    for (const CaseCounts::Value& value : axes[0].values) runs += value.rates.at(2).runs;
    EXPECT_EQ(runs, 545U);
    ASSERT_EQ(axes[1].values.size(), 2U);
    EXPECT_EQ(axes[1].name, "\"axes\":{");
    EXPECT_EQ(axes[1].values[1].text, "},\"seed\":1");
    EXPECT_FALSE(axes[2].is_divided) << "600 values";
    EXPECT_TRUE(axes[2].values.empty());

    ASSERT_EQ(counts.failed().size(), CaseCounts::most_failed);
    EXPECT_EQ(counts.failed().begin()->first, 0U);
    std::vector<std::uint64_t> failed;
    for (std::uint64_t i = 0; failed.size() < CaseCounts::most_failed; ++i)
      if (i % 7 == 0 || i % 11 == 0) failed.push_back(i);
    EXPECT_EQ(counts.failed().rbegin()->first, failed.back());
    EXPECT_EQ(counts.failed().at(11).why, "killed");
    EXPECT_EQ(counts.failed().at(7).why, "settles does not hold");
    EXPECT_EQ(counts.failed().at(7).seed, 7U);
    EXPECT_EQ(counts.failed().at(7).axes, "rate 50, \"axes\":{ },\"seed\":1, draw 7");
  }
}

}  // namespace
}  // namespace imud
