// Distribution: the distribution of a random quantity, as a quantile function with the same bits on every machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "emulator/ground/table_reader.hpp"

namespace imud {

class Distribution {
 public:
  // Reads the keys `distribution` and `components`, and the parameters of the distribution. Adds a fault for each key
  // that is wrong, missing or unknown; then this object must not be used.
  explicit Distribution(TableReader& table);

  // Returns the value that a share p of all values does not exceed, 0 < p < 1; for the kind `choice`, the number of
  // the value.
  double quantile(double p) const noexcept;
  // Returns the value of this quantile as TOML: a number in its shortest exact form.
  std::string text(double p) const;
  // Returns how many independent numbers make a list, such as a vector; 0: the value is no list.
  std::size_t components() const noexcept { return components_; }

 private:
  enum class Kind : std::uint8_t {
    normal,
    truncated_normal,
    log_normal,
    uniform,
    log_uniform,
    uniform_integer,
    exponential,
    triangular,
    choice,
  };
  void read_bounds(TableReader& table, double smallest);
  void truncate(TableReader& table);

  Kind kind_ = Kind::uniform;
  double from_ = 0, to_ = 1;        // of the kinds that have bounds
  double middle_ = 0, spread_ = 1;  // mean, median or mode; standard deviation of the kinds that have one
  // The normal distribution function at both bounds of a truncated normal, or, if both are above the mean, at their
  // mirror images below it, where it is exact.
  double lower_ = 0, upper_ = 1;
  bool is_mirrored_ = false;
  std::vector<std::string> choices_;  // as TOML
  std::size_t components_ = 0;
};

// Returns the value as TOML in one line, numbers in their shortest exact form. Throws std::invalid_argument if the
// value is a table or contains one.
std::string toml_value(const toml::node& node);

}  // namespace imud
