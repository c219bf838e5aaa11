// CaseCounts: how many cases of a campaign have passed, in all and by the values of each axis.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/campaign/shards/shard.hpp"

namespace imud {

// How many runs were judged by one criterion, and how many of them have passed.
struct CaseRate {
  std::uint64_t runs = 0, passes = 0;
};

// Shards are added in any order, each once; the counts do not depend on it. One thread.
class CaseCounts {
 public:
  // For an axis with more values, such as random draws, cases are not counted by value.
  static constexpr std::size_t most_values = 100;
  // The first cases that have not passed are kept, at most this many.
  static constexpr std::size_t most_failed = 100;

  // A case that has not passed.
  struct Failed {
    std::uint64_t seed = 0;
    std::string axes;  // "NAME VALUE, NAME VALUE"
    std::string why;   // the error, or the failed expectations and what is missing
  };
  struct Value {
    std::string text;
    std::uint64_t first_case = 0;  // the first case with this value
    std::vector<CaseRate> rates;   // in the order of rates(); the last ones may be absent
  };
  struct Axis {
    std::string name;
    std::vector<Value> values;  // empty if there are too many
    bool is_divided = true;
  };

  // Throws std::runtime_error, "has no result in the row of case 7", if a row cannot be read. Then this object must
  // not be used further.
  void add(const Shard& shard);
  // Adds the counts of other shards.
  void add(const CaseCounts& other);

  std::uint64_t done = 0;  // cases that were run
  CaseTally tally;

  // The first name is "cases": its rate counts a case as passed if it is complete and all expectations hold. The
  // other names are expectations, each with its own rate.
  const std::vector<std::string>& names() const noexcept { return names_; }
  const std::vector<CaseRate>& rates() const noexcept { return rates_; }
  // Returns the axes in the order of the plan. The values of an axis are sorted if all are numbers; otherwise they
  // have the order of the cases.
  std::vector<Axis> axes() const;
  // The cases that are kept, by their numbers.
  const std::map<std::uint64_t, Failed>& failed() const noexcept { return failed_; }

 private:
  struct Row;
  struct Passed {
    std::size_t rate;
    bool passed;
  };
  void add(const Row& row);
  void divide(const Row& row, const std::vector<Passed>& all);
  std::size_t rate_of(const std::string& expectation);
  void keep(std::uint64_t index, Failed one);
  // Returns the entry for a value of an axis; nullptr if cases are not counted by the values of this axis.
  static Value* value_of(Axis& axis, const std::string& text, std::uint64_t first_case);

  std::vector<std::string> names_ = {"cases"};
  std::vector<CaseRate> rates_ = std::vector<CaseRate>(1);
  std::vector<Axis> axes_;
  std::map<std::uint64_t, Failed> failed_;
};

}  // namespace imud
