// TableReader: reads the values of one TOML table and collects every fault in it.
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <initializer_list>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/vector.hpp"
#include "emulator/ground/words.hpp"

namespace imud {

// The faults of one file, the warnings, and the files that it names, in the order in which they were found.
class Faults {
 public:
  // `file` is empty if there is none; the texts have no line then.
  explicit Faults(std::string file) : file_(std::move(file)) {}
  // `line` is 0 if the key came from the command line, or is missing.
  void add(std::uint32_t line, std::string_view key, std::string_view what) {
    all_.push_back(text(line, key, what));
    lines_.push_back(line);
  }
  const std::vector<std::string>& all() const { return all_; }
  // Returns all faults in the order of their lines; faults without a line are first.
  std::vector<std::string> by_line() const;
  // Adds a warning: the file is valid, but probably not as intended.
  void warn(std::uint32_t line, std::string_view key, std::string_view what) {
    warnings_.push_back(text(line, key, what));
  }
  const std::vector<std::string>& warnings() const { return warnings_; }
  // Adds a file that the value of `key` names.
  struct NamedFile {
    std::string key, path;
  };
  void add_named_file(std::string key, std::string path) {
    named_files_.push_back({std::move(key), std::move(path)});
  }
  const std::vector<NamedFile>& named_files() const { return named_files_; }
  // Adds the text by which the command line gives a value, for keys that take a text: `1` is the number 1 and the
  // text "1". The value's table must outlive the use of this.
  void add_given_text(const toml::node* value, std::string text) { given_texts_[value] = std::move(text); }
  // Returns nullptr if the command line has not given the value.
  const std::string* given_text(const toml::node* value) const {
    const auto found = given_texts_.find(value);
    return found == given_texts_.end() ? nullptr : &found->second;
  }
  // The file; empty if there is none, and - if it is standard input.
  const std::string& file() const noexcept { return file_; }

 private:
  std::string text(std::uint32_t line, std::string_view key, std::string_view what) const;

  std::string file_;
  std::vector<std::string> all_;
  std::vector<std::uint32_t> lines_;  // of all_
  std::vector<std::string> warnings_;
  std::vector<NamedFile> named_files_;
  std::map<const toml::node*, std::string> given_texts_;
};

// Each getter returns the value of the key, or `fallback` if the key is absent. A value of the wrong type, shape or
// range is a fault, and the getter returns `fallback`. Numbers are always finite. A key of the table may spell its
// unit otherwise (is_same_key()). Call finish() at the end: it finds the unknown keys, which the destructor does not.
class TableReader {
 public:
  // If `table` is null, every key is absent. `path` precedes the keys in messages: "imu.0.gyro.". Every value that a
  // getter returns is written to `resolved`, which must outlive the reader and its children's readers.
  TableReader(const toml::table* table, std::string path, std::uint32_t line, Faults& faults, toml::table& resolved)
      : table_(table), path_(std::move(path)), line_(line), faults_(faults), resolved_(resolved) {}

  bool has(std::string_view key) { return node(key) != nullptr; }
  // Returns true if the key is a table. The key does not count as known.
  bool has_table(std::string_view key) const {
    return table_ != nullptr && table_->contains(key) && table_->get(key)->is_table();
  }
  // Returns the value as it is; nullptr if it is absent. The key counts as known.
  const toml::node* node(std::string_view key);

  double real(std::string_view key, double fallback, double min, double max);
  std::uint64_t unsigned_integer(std::string_view key, std::uint64_t fallback, std::uint64_t max);
  bool flag(std::string_view key, bool fallback);
  std::string text(std::string_view key, std::string fallback);
  // Returns the index of the value in `words`.
  std::size_t choice(std::string_view key, std::span<const std::string_view> words, std::size_t fallback);
  // Returns the value of the word.
  template <class Enum>
  Enum choice(std::string_view key, std::span<const Word<Enum>> words, Enum fallback) {
    std::vector<std::string_view> texts;
    std::size_t absent = 0;
    for (const auto& [value, word] : words) {
      if (value == fallback) absent = texts.size();
      texts.push_back(word);
    }
    return words[choice(key, texts, absent)].value;
  }
  template <class Enum>
  Enum choice(std::string_view key, std::initializer_list<Word<Enum>> words, Enum fallback) {
    return choice(key, std::span(words.begin(), words.size()), fallback);
  }
  Vector3 vector3(std::string_view key, const Vector3& fallback);
  // Reads three numbers, or one that counts for all axes, each from `min` to `max`.
  Vector3 per_axis(std::string_view key, const Vector3& fallback, double min, double max);
  // Reads a list of numbers, each from `min` to `max`. Empty if absent.
  std::vector<double> numbers(std::string_view key, double min, double max);
  // Reads three rows of three numbers; if `diagonal`, three numbers as well, which are the diagonal.
  Matrix3 matrix3(std::string_view key, const Matrix3& fallback, bool diagonal);
  // Returns the reader of the table of that key, which may be absent.
  TableReader child(std::string_view key);

  // Writes to `resolved` a value that no getter has returned, or replaces the value there.
  template <class Value>
  void resolve(std::string_view key, Value&& value) {
    resolved_.insert_or_assign(key, std::forward<Value>(value));
  }

  // Adds a fault, or a warning, of `key`, at its line.
  void fault(std::string_view key, std::string_view what);
  void warn(std::string_view key, std::string_view what);
  // Adds a fault for every key that no function above was called with. The fault suggests the nearest known key.
  void finish();

 private:
  friend std::string file_named(TableReader& table, std::string_view key, const std::string& path);
  friend std::vector<TableReader> children(TableReader& table, std::string_view key, std::string_view heading);
  const toml::node* find(std::string_view key) const;
  std::uint32_t line_of(std::string_view key) const;

  const toml::table* table_;
  std::string path_;
  std::uint32_t line_;
  Faults& faults_;
  toml::table& resolved_;
  std::set<std::string, std::less<>> known_;
};

// Further getters, made of these. Returns true if the value is a text.
inline bool is_text(TableReader& table, std::string_view key) {
  return table.has(key) && table.node(key)->is_string();
}
// Returns the readers of the tables of a list, such as [[imu.cause]]; none if the key is absent. `heading` is the
// tables' in the fault of another value.
std::vector<TableReader> children(TableReader& table, std::string_view key, std::string_view heading);
// Returns the path of the file that `key` names by `path`, resolves the key as this path, and adds the file to the
// named files. `path` is relative to the folder of the file that has the table. If nothing is there, but something is
// there relative to the current folder, `path` is relative to the current folder. An absolute path, and an empty one,
// are returned unchanged.
std::string file_named(TableReader& table, std::string_view key, const std::string& path);
// Returns the key `name`, the name of what the table describes. Adds a fault unless it is 1 to longest_name
// characters of one line: names stand in lines of the log, in JUnit, and in a record, whose fields have a size of 16
// bits.
std::string name_in(TableReader& table, std::string fallback);
inline constexpr std::size_t longest_name = 64;
// Adds a fault if the key is absent.
void require(TableReader& table, std::string_view key, std::string_view what_it_is);
// Returns a date and time, such as 2025-01-01T00:00:00Z, as whole seconds since 1970. Without an offset it is UTC.
std::int64_t utc_s(TableReader& table, std::string_view key, const toml::date_time& fallback, int first_year,
                   int last_year);
// Reads a list of rows of three numbers. Empty if absent.
std::vector<Vector3> rows(TableReader& table, std::string_view key);

// Returns what an unknown word probably means: "did you mean \"WORD\"?", or `otherwise` if none of the words is near;
// if that is empty, "known: " and all words.
std::string suggestion(std::string_view word, const std::vector<std::string>& words,
                       const std::string& otherwise = {});

}  // namespace imud
