// CaseStatistics: the figures of a campaign's cases, over all cases and by the values of each axis.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "tools/campaign/case_row.hpp"
#include "tools/campaign/case_sample.hpp"

namespace imud {

class CaseStatistics {
 public:
  // An axis with more values than these is not divided by value.
  static constexpr std::size_t most_values = 1000;

  struct Options {
    std::vector<std::string> figures;  // names as in the table; empty: every figure and metric
    bool over_time = false;            // with each of `figures` goes "NAME@TIME", too
    std::vector<std::string> worst;    // figures whose greatest magnitudes are kept
    std::size_t count = 10;            // of the worst and of the failed cases
    std::size_t bytes = 256 << 20;     // for percentiles
  };
  struct Axis {
    std::string name;
    std::vector<std::string> values;  // as the cases name them first
    std::unordered_map<std::string, std::uint32_t> numbers;
    std::vector<std::uint64_t> runs;  // by value
    bool is_divided() const noexcept { return values.size() <= most_values; }
  };
  struct Figure {
    std::string name;
    bool is_expectation = false, is_counter = false;
    Moments all;
    std::vector<std::vector<Moments>> by_axis;  // by axis and value
  };
  // A case to look at.
  struct Noted {
    std::uint64_t index = 0;
    double number = 0;        // of the worst
    std::string description;  // axes and seed; for a failed case what has failed
  };
  struct Worst {
    std::string figure;
    std::vector<Noted> cases;  // the worst first
    bool is_known = false;
  };

  explicit CaseStatistics(Options options);
  void add(const CaseRow& row);

  std::uint64_t cases() const noexcept { return cases_; }
  std::uint64_t failures() const noexcept { return failures_; }
  // Return how many cases have run, and how many have an error in place of a run.
  std::uint64_t runs() const noexcept { return runs_; }
  std::uint64_t not_run() const noexcept { return cases_ - runs_; }
  const std::map<std::string, std::uint64_t>& exit_codes() const noexcept { return exit_codes_; }
  const std::map<std::string, std::uint64_t>& ends() const noexcept { return ends_; }
  const std::vector<Axis>& axes() const noexcept { return axes_; }
  const std::vector<Figure>& figures() const noexcept { return figures_; }
  const std::vector<Worst>& worst() const noexcept { return worst_; }
  const std::vector<Noted>& failed() const noexcept { return failed_; }
  const CaseSample& sample() const noexcept { return sample_; }

  // Returns the number of the figure or axis of that name; nullopt if no case has it.
  std::optional<std::size_t> find_figure(const std::string& name) const;
  std::optional<std::size_t> find_axis(const std::string& name) const;
  // Returns the figures "NAME@TIME" of a name, with their times in ascending order.
  std::vector<std::pair<double, std::size_t>> find_over_time(const std::string& name) const;

  // Returns the number of a figure in a row of the sample; NaN if the case lacks it.
  double number(std::size_t row, std::size_t figure) const noexcept;
  // Return the sorted numbers of a figure in the sample: all, or those with that value of the axis.
  std::vector<double> sorted(std::size_t figure) const;
  std::vector<std::vector<double>> sorted_by(std::size_t figure, std::size_t axis) const;

 private:
  // The use of a column of the rows; the numbers of its axis, figure or list.
  struct Use {
    std::optional<std::size_t> axis, figure, worst;
  };
  bool is_asked(const std::string& name) const;
  void use_new_columns(const CaseRow& row);
  std::string description(const CaseRow& row) const;
  void note_failure(const CaseRow& row);
  void note_worst(Worst& worst, const CaseRow& row, double number) const;

  Options options_;
  std::uint64_t cases_ = 0, runs_ = 0, failures_ = 0;
  std::map<std::string, std::uint64_t> exit_codes_, ends_;
  std::vector<Axis> axes_;
  std::vector<Figure> figures_;
  std::vector<Worst> worst_;
  std::vector<Noted> failed_;
  std::vector<Use> uses_;  // by column
  CaseSample sample_;      // of the cases that have run
  std::vector<double> numbers_;
  std::vector<std::uint32_t> at_;
};

}  // namespace imud
