// A CSV file of tests/vectors: a header row, then numbers.
#pragma once

#include <charconv>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "core/vector.hpp"

namespace imud {

class VectorTable {
 public:
  // `name` has neither path nor extension. Throws if the file is missing, or not as described.
  explicit VectorTable(const std::string& name) {
    std::ifstream file(std::string(IMUD_TEST_DATA) + "/vectors/" + name + ".csv");
    std::string line;
    if (!std::getline(file, line)) throw std::runtime_error("no " + name);
    for (const std::string_view field : fields(line)) columns_.emplace(field, columns_.size());
    while (std::getline(file, line)) {
      std::vector<std::string> row;
      for (const std::string_view field : fields(line)) row.emplace_back(field);
      if (row.size() != columns_.size()) throw std::runtime_error("row of " + name + ": " + line);
      rows_.push_back(std::move(row));
    }
  }

  std::size_t rows() const { return rows_.size(); }
  const std::string& text(std::size_t row, const std::string& column) const {
    return rows_[row][columns_.at(column)];
  }

  double number(std::size_t row, const std::string& column) const {
    const std::string& field = text(row, column);
    double value = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size()) throw std::runtime_error("number: " + field);
    return value;
  }

  // The vector in the columns prefix + "x", "y", "z" (or + `names`).
  Vector3 vector(std::size_t row, const std::string& prefix, std::string_view names = "xyz") const {
    return {number(row, prefix + names[0]), number(row, prefix + names[1]), number(row, prefix + names[2])};
  }

 private:
  static std::vector<std::string_view> fields(std::string_view line) {
    std::vector<std::string_view> result;
    while (true) {
      const std::size_t comma = line.find(',');
      result.push_back(line.substr(0, comma));
      if (comma == std::string_view::npos) return result;
      line.remove_prefix(comma + 1);
    }
  }

  std::map<std::string, std::size_t, std::less<>> columns_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace imud
