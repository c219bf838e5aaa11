// The table of a campaign: a row for each case, as CSV, JSON lines or SQLite.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tools/campaign/campaign_rows.hpp"
#include "tools/campaign/case_row.hpp"

namespace imud {

struct TableColumn {
  std::string name;
  std::size_t cell;  // of CaseRow
  CaseGroup group;
};

// Returns the columns in the order of the table: case, seed, the axes, exit_code, ended_by, expectations, digests,
// figures, metrics of the test, shortfalls, error; within a group, in the order in which the cases first name
// them. A name that is used already, upper or lower case aside, gets a number: "seed_2".
std::vector<TableColumn> table_columns(const CaseRow& row);

// A table that is being written. commit() replaces an older table.
class CaseTable {
 public:
  virtual ~CaseTable() = default;
  // Begins the table; a further call begins again, from the first row, with more columns.
  virtual void begin(std::span<const TableColumn> columns) = 0;
  virtual void write(const CaseRow& row) = 0;
  virtual void commit() = 0;
  // Returns false for a stream, which cannot be written again from its beginning.
  virtual bool can_begin_again() const noexcept { return true; }
};

// These functions throw std::runtime_error, which names the file, if the file cannot be written. CSV (RFC 4180)
// with a header. An absent value is an empty field, true and false are 1 and 0.
std::unique_ptr<CaseTable> csv_table(const std::string& path);
// A JSON object for each case, in a line of its own; an absent value is null.
std::unique_ptr<CaseTable> json_table(const std::string& path);
// A database with the table `cases`. Axes are numbers where their values are.
std::unique_ptr<CaseTable> sqlite_table(const std::string& path);

struct CollectedCases {
  std::uint64_t not_run = 0;  // cases that have an error in place of a run
  std::size_t columns = 0;
};
// Writes the tables, in one pass over the shards if the first row has all columns, otherwise in two. The memory does
// not grow with the number of cases.
CollectedCases collect_cases(CampaignRows& rows, std::span<const std::unique_ptr<CaseTable>> tables);

}  // namespace imud
