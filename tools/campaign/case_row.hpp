// CaseRow: a row of a campaign's shards, as cells in columns.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace imud {

// The groups of columns, in the order of the table.
enum class CaseGroup : std::uint8_t { index, axis, end, expectation, digest, figure, test, remark };

struct CaseColumn {
  CaseGroup group;
  std::string key;  // the path in its member of the row: "imu1.samples"
  // A figure whose first value is an integer is a counter. Rows omit a counter that is 0.
  enum class Kind : std::uint8_t { unknown, counter, other } kind = Kind::unknown;
  // Returns the name in the table: "imu1.samples", "expect.settles", "digest.imu1", "test.error_deg".
  std::string name() const;
};

struct CaseCell {
  enum class Kind : std::uint8_t { empty, truth, integer, real, text };  // empty: absent, or null
  Kind kind = Kind::empty;
  std::int64_t integer = 0;  // also of a truth: 1 or 0
  double real = 0;
  std::string text;  // of a real or a text, character by character
  // Returns the number; nullopt for a text and for an empty cell.
  std::optional<double> number() const noexcept;
};

// Holds one row at a time. A column is added when a row names it for the first time, and is then kept.
class CaseRow {
 public:
  // The columns that every row has.
  static constexpr std::size_t index_column = 0, seed_column = 1, exit_code = 2, ended_by = 3, shortfalls = 4,
                               error = 5;

  CaseRow();
  CaseRow(const CaseRow&) = delete;
  CaseRow& operator=(const CaseRow&) = delete;

  // Reads the row of a case in a shard. Objects within figures and metrics become columns with dots in their names,
  // arrays with numbers. A known counter that the row of a run lacks is 0. Throws std::runtime_error if the text is
  // not the row of this case, or has too many columns.
  void read(std::string_view text, std::uint64_t index);

  std::uint64_t index() const noexcept { return static_cast<std::uint64_t>(cells_[index_column].integer); }
  const std::vector<CaseColumn>& columns() const noexcept { return columns_; }
  const CaseCell& operator[](std::size_t column) const noexcept { return cells_[column]; }
  // Returns true if the run itself, an expectation or the software under test has failed.
  bool has_failed() const noexcept;
  // Returns true unless there is an error in place of a run.
  bool has_run() const noexcept { return cells_[error].kind == CaseCell::Kind::empty; }

 private:
  class Reader;
  CaseCell& cell(CaseGroup group, std::string_view key);
  std::size_t find(CaseGroup group, std::string_view key);
  void count_zeros() noexcept;

  std::vector<CaseColumn> columns_;
  std::vector<CaseCell> cells_;
  std::unordered_map<std::string, std::size_t> known_;  // columns by group and key
  // The first column of the previous row, the successor of each column, and the column that is expected next.
  std::size_t first_ = 0;
  std::deque<std::size_t> next_;
  std::size_t* expected_ = &first_;
};

}  // namespace imud
