// Numbers of a campaign's cases: moments, percentiles, and a sample of bounded size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace imud {

// Moments of the numbers added, by Welford's recurrence, which loses no digits far from 0.
struct Moments {
  std::uint64_t runs = 0, passes = 0;  // passes: numbers other than 0
  double mean = 0, squares = 0;        // squares: the sum of the squared differences from the mean
  double min = std::numeric_limits<double>::infinity(), max = -min;
  void add(double number) noexcept;
  // Returns the moments of so many zeros.
  static Moments zeros(std::uint64_t count) noexcept;
  // Returns the standard deviation, of which the mean is an estimate too (n - 1); NaN of fewer than two.
  double deviation() const noexcept;
};

// Returns the percentile, from 0 to 1, of sorted numbers: linear between the two nearest, of which the first is at 0
// and the last at 1 (NumPy's default, and `inclusive` of Python's statistics.quantiles()). NaN if there are none.
double percentile(const std::vector<double>& sorted, double share) noexcept;

// Returns the number that the whole text is; nullopt if it is none, or not finite.
std::optional<double> number_of(const std::string& text) noexcept;

// The numbers of the cases for percentiles: all, until they take more than `bytes`; then the numbers of
// cases that are chosen by a hash of their index, each with the same probability, whatever order they come in.
class CaseSample {
 public:
  explicit CaseSample(std::size_t bytes) : bytes_(bytes) {}

  bool wants(std::uint64_t index) const noexcept;
  // `at`: the number of the value of each axis. Absent numbers are NaN. Later cases may have more.
  void add(std::uint64_t index, const std::vector<double>& numbers, const std::vector<std::uint32_t>& at);

  std::size_t size() const noexcept { return cases_.size(); }
  // Returns the number; `absent` if the case lacks it.
  double number(std::size_t row, std::size_t figure, double absent) const noexcept;
  // Returns the number of the value of an axis; the greatest one if the case lacks it.
  std::uint32_t at(std::size_t row, std::size_t axis) const noexcept;

 private:
  struct Case {
    std::uint64_t index;
    std::vector<double> numbers;
    std::vector<std::uint32_t> at;
  };
  std::size_t bytes_, used_ = 0;
  unsigned halvings_ = 0;
  std::vector<Case> cases_;
};

}  // namespace imud
