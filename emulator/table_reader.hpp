// TableReader: takes values out of one TOML table and writes down everything that is wrong with it.
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/vector.hpp"

namespace imud {

// The faults of one file, in the order found.
class Faults {
 public:
  explicit Faults(std::string file) : file_(std::move(file)) {}
  // `line` 0: the key came from the command line, or is missing.
  void add(std::uint32_t line, std::string_view key, std::string_view what);
  const std::vector<std::string>& all() const { return all_; }

 private:
  std::string file_;
  std::vector<std::string> all_;
};

// Each getter returns the value, or `fallback` if the key is absent; a value of wrong type, shape or range is a fault
// and gives `fallback` too. Numbers are finite always. The destructor does nothing: call finish() for unknown keys.
class TableReader {
 public:
  // `table` may be null: everything is absent. `path`: what stands before a key in messages ("imu.0.gyro.").
  TableReader(const toml::table* table, std::string path, std::uint32_t line, Faults& faults)
      : table_(table), path_(std::move(path)), line_(line), faults_(faults) {}

  bool has(std::string_view key) const { return table_ != nullptr && table_->contains(key); }
  bool is_text(std::string_view key) const { return has(key) && table_->get(key)->is_string(); }
  const toml::node* node(std::string_view key);  // raw; counts as known

  double real(std::string_view key, double fallback, double min, double max);
  std::uint64_t unsigned_integer(std::string_view key, std::uint64_t fallback, std::uint64_t max);
  bool flag(std::string_view key, bool fallback);
  std::string text(std::string_view key, std::string fallback);
  // A date and time, such as 2025-01-01T00:00:00Z (without an offset: UTC), as whole seconds since 1970.
  std::int64_t utc_s(std::string_view key, std::int64_t fallback, int first_year, int last_year);
  // One of `words`; its index.
  std::size_t choice(std::string_view key, std::initializer_list<std::string_view> words, std::size_t fallback);
  Vector3 vector3(std::string_view key, const Vector3& fallback);
  // Nine numbers as three rows; three numbers are the diagonal if `diagonal`.
  Matrix3 matrix3(std::string_view key, const Matrix3& fallback, bool diagonal);
  TableReader child(std::string_view key);

  // A fault of `key`, at its line.
  void fault(std::string_view key, std::string_view what);
  void require(std::string_view key, std::string_view what_it_is);
  // Every key that nobody asked for is a fault, with the nearest known one.
  void finish();

 private:
  std::optional<double> number(const toml::node& node);
  std::uint32_t line_of(std::string_view key) const;

  const toml::table* table_;
  std::string path_;
  std::uint32_t line_;
  Faults& faults_;
  std::set<std::string, std::less<>> known_;
};

// The word of `words` that `word` is most likely meant to be; empty if none is near.
std::string nearest(std::string_view word, const std::vector<std::string>& words);

}  // namespace imud
