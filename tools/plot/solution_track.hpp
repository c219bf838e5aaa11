// SolutionTrack: the solution of a unit beside the truth, with its errors and their reported standard deviations.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/plot/solution_rows.hpp"

namespace imud {

struct SolutionTrack {
  // Values, truth, errors and standard deviations are NaN where the unit or the truth has none. Errors of the
  // attitude are also NaN while the attitude is arbitrary.
  struct Channel {
    std::string_view name;        // "roll"
    std::string_view error_name;  // of the error: "about_north", as a rotation has an axis
    std::string_view unit;        // of all columns: "deg"
    std::vector<double> value = {}, truth = {}, error = {}, sigma = {};

    // Returns whether any error is known.
    bool is_known() const noexcept;
  };
  std::array<Channel, 9> channels;
  std::vector<double> time_s = {};
  std::vector<double> fix_age_s = {};  // NaN without a place
  // The mean of the squared errors that are known, each divided by its reported variance: about 1 where the reported
  // standard deviations are right.
  std::vector<double> normalized_square = {};
  // The aids that the unit has, by their bits: 1 where it was used when it was due last, -1 where it was rejected, 0
  // where it was missing. An aid that was never used or rejected has none.
  struct Aid {
    std::string_view name;
    std::vector<double> use = {};
  };
  std::vector<Aid> aids = {};

  std::size_t samples() const noexcept { return time_s.size(); }
};

// Positions are relative to the first true place, along north, east and down at this place; times are relative to
// the first sample. Throws std::runtime_error if solution and truth have different samples, or if the unit has not
// aligned.
SolutionTrack compare_solutions(std::span<const SolutionRow> rows, std::span<const SolutionRow> truth);

// Returns the data as CSV with a header: of at most `most_rows` samples at equal distances.
std::string track_csv(const SolutionTrack& track);
// Returns gnuplot's commands that draw these data, in the file at `path`, to the file `picture`: a row for each
// channel with known errors, with the truth over the value and the error over the band of its standard deviation;
// below, the squares of the errors in units of the variance, and the use of each aid.
std::string track_plot_commands(const SolutionTrack& track, const std::string& path, const std::string& picture);

}  // namespace imud
