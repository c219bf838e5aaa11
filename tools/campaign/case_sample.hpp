// Numbers of a campaign's cases: moments, percentiles, and a sample of bounded size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
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
  // Returns the sample standard deviation (divisor n - 1); NaN for fewer than two numbers.
  double deviation() const noexcept;
};

// Returns a percentile, given as a share from 0 to 1, of sorted numbers: linear between the two nearest numbers,
// where the first number is at 0 and the last at 1 (NumPy's default, and `inclusive` of Python's
// statistics.quantiles()). NaN if there are no numbers.
double percentile(const std::vector<double>& sorted, double share) noexcept;

// The numbers of the cases, for percentiles. All numbers are kept until they take more than `bytes`; then only the
// numbers of some cases are kept. These cases are chosen by a hash of their index, each with the same probability,
// in whatever order the cases come.
class CaseSample {
 public:
  explicit CaseSample(std::size_t bytes) : bytes_(bytes) {}

  bool wants(std::uint64_t index) const noexcept;
  // `at`: for each axis, the index of the case's value. Absent numbers are NaN. Later cases may have more numbers.
  void add(std::uint64_t index, const std::vector<double>& numbers, const std::vector<std::uint32_t>& at);

  std::size_t size() const noexcept { return cases_.size(); }
  // Returns the number; `absent` if the case lacks it.
  double number(std::size_t row, std::size_t figure, double absent) const noexcept;
  // Returns the index of the case's value on an axis; UINT32_MAX if the case lacks the axis.
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
