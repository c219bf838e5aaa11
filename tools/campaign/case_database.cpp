#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include "tools/campaign/case_table.hpp"
#include "tools/campaign/whole_file.hpp"

namespace imud {
namespace {

// Returns a name in SQL's double quotes. SQLite's names end at a NUL.
std::string sql_name(std::string name) {
  std::ranges::replace(name, '\0', ' ');
  std::string text = "\"";
  for (const char c : name) text.append(c == '"' ? 2 : 1, c);
  return text + '"';
}

struct Close {
  void operator()(sqlite3* database) const noexcept { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const noexcept { sqlite3_finalize(statement); }
};

class SqliteTable final : public CaseTable {
 public:
  explicit SqliteTable(const std::string& path) : path_(path), file_(path) {
    if (!file_.is_regular()) throw std::runtime_error(path + ": a database is no stream; give a file");
  }

  void begin(std::span<const TableColumn> columns) override {
    insert_.reset();
    database_.reset();
    sqlite3* database = nullptr;
    if (std::FILE* const empty = std::fopen(file_.path().c_str(), "we"); empty != nullptr) std::fclose(empty);
    const int result = sqlite3_open(file_.path().c_str(), &database);
    database_.reset(database);
    check(result);
    cells_.clear();
    std::string create, values;
    for (const TableColumn& column : columns) {
      cells_.push_back(column.cell);
      create += fmt::format("{}{}{}", create.empty() ? "" : ", ", sql_name(column.name), type_of(column));
      values += values.empty() ? "?" : ", ?";
    }
    // An incomplete file is never used; therefore the database needs no journal.
    execute("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA locking_mode = EXCLUSIVE; BEGIN");
    execute("CREATE TABLE cases (" + create + ")");
    sqlite3_stmt* insert = nullptr;
    check(sqlite3_prepare_v2(database_.get(), ("INSERT INTO cases VALUES (" + values + ")").c_str(), -1, &insert,
                             nullptr));
    insert_.reset(insert);
  }

  void write(const CaseRow& row) override {
    for (std::size_t i = 0; i < cells_.size(); ++i) bind(static_cast<int>(i) + 1, row[cells_[i]]);
    if (sqlite3_step(insert_.get()) != SQLITE_DONE) check(sqlite3_errcode(database_.get()));
    sqlite3_reset(insert_.get());
  }

  void commit() override {
    insert_.reset();
    execute("COMMIT");
    database_.reset();
    file_.commit();
  }

 private:
  static const char* type_of(const TableColumn& column) {
    if (column.cell == CaseRow::index_column) return " INTEGER PRIMARY KEY";
    return column.group == CaseGroup::axis ? " NUMERIC" : "";  // an axis' value is a text, which may be a number
  }
  void check(int result) const {
    if (result != SQLITE_OK) throw std::runtime_error(fmt::format("{}: {}", path_, sqlite3_errmsg(database_.get())));
  }
  void execute(const std::string& sql) const {
    check(sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr));
  }
  // The row does not change until the step is done.
  void bind(int place, const CaseCell& cell) const {
    sqlite3_stmt* const insert = insert_.get();
    switch (cell.kind) {
      case CaseCell::Kind::empty:
        check(sqlite3_bind_null(insert, place));
        break;
      case CaseCell::Kind::truth:
      case CaseCell::Kind::integer:
        check(sqlite3_bind_int64(insert, place, cell.integer));
        break;
      case CaseCell::Kind::real:
        check(sqlite3_bind_double(insert, place, cell.real));
        break;
      case CaseCell::Kind::text:
        check(sqlite3_bind_text(insert, place, cell.text.data(), static_cast<int>(cell.text.size()), SQLITE_STATIC));
        break;
    }
  }

  std::string path_;
  WholeFile file_;
  std::unique_ptr<sqlite3, Close> database_;
  std::unique_ptr<sqlite3_stmt, Close> insert_;
  std::vector<std::size_t> cells_;
};

}  // namespace

std::unique_ptr<CaseTable> sqlite_table(const std::string& path) { return std::make_unique<SqliteTable>(path); }

}  // namespace imud
