// Distribution: a random quantity by its quantile function, with the same bits on every machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "emulator/ground/table_reader.hpp"

namespace imud {

class Distribution {
 public:
  // Reads `distribution`, its parameters and `components`. Adds a fault for each key that is wrong, missing or
  // unknown; then the distribution is without use.
  explicit Distribution(TableReader& table);

  // Returns the value that a share p of all values does not exceed; of a choice, its number. 0 < p < 1.
  double quantile(double p) const noexcept;
  // Returns that value as TOML: a number in the shortest form that is exactly it.
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
  double middle_ = 0, spread_ = 1;  // mean, median or mode; standard deviation, if there is one
  // The normal distribution function at both bounds of a truncated normal, or, if both are above the mean, at their
  // mirror images below it, where it is exact.
  double lower_ = 0, upper_ = 1;
  bool is_mirrored_ = false;
  std::vector<std::string> choices_;  // as TOML
  std::size_t components_ = 0;
};

// Returns the value as TOML in one line: a number in the shortest form that is exactly it. Throws
// std::invalid_argument if it is a table, or has one in it.
std::string toml_value(const toml::node& node);

}  // namespace imud
