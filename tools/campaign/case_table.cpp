#include "tools/campaign/case_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>

#include "emulator/ground/progress_line.hpp"
#include "protocols/wire/csv_field.hpp"
#include "tools/campaign/whole_file.hpp"
#include "tools/text_output.hpp"

namespace imud {
namespace {

std::string lower_case(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// A table in the form of text, whose lines a class makes.
class TextTable : public CaseTable {
 public:
  // The form in which cells without a number are written.
  struct Words {
    std::string_view empty, no, yes;
    void (*add_text)(std::string& line, std::string_view text);
  };
  TextTable(const std::string& path, const Words& words) : words_(words), path_(path), file_(path) {}

  void begin(std::span<const TableColumn> columns) final {
    columns_.assign(columns.begin(), columns.end());
    output_.emplace(file_.path());
    line_.clear();
    begin_lines();
    output_->write(line_);
    line_.clear();
  }
  void write(const CaseRow& row) final {
    write_line(row);
    output_->write(line_);
    line_.clear();
    check();
  }
  void commit() final {
    output_->flush();
    check();
    file_.commit();
  }
  bool can_begin_again() const noexcept final { return file_.is_regular(); }

 protected:
  virtual void begin_lines() = 0;
  virtual void write_line(const CaseRow& row) = 0;
  void add(const CaseCell& cell) {
    switch (cell.kind) {
      case CaseCell::Kind::empty:
        line_ += words_.empty;
        break;
      case CaseCell::Kind::truth:
        line_ += cell.integer != 0 ? words_.yes : words_.no;
        break;
      case CaseCell::Kind::integer:
        line_ += fmt::format_int(cell.integer).c_str();
        break;
      case CaseCell::Kind::real:
        line_ += cell.text;
        break;
      case CaseCell::Kind::text:
        words_.add_text(line_, cell.text);
        break;
    }
  }

  std::vector<TableColumn> columns_;
  std::string line_;

 private:
  // A closed pipe is no error.
  void check() const {
    if (const int error = output_->error(); error != 0 && error != EPIPE)
      throw std::runtime_error(path_ + ": " + std::strerror(error));
  }

  const Words words_;
  std::string path_;
  WholeFile file_;
  std::optional<TextOutput> output_;
};

class CsvTable final : public TextTable {
 public:
  explicit CsvTable(const std::string& path) : TextTable(path, {"", "0", "1", append_csv_field}) {}

 private:
  void begin_lines() override {
    for (const TableColumn& column : columns_) {
      if (!line_.empty()) line_ += ',';
      line_ += csv_field(column.name);
    }
    line_ += '\n';
  }
  void write_line(const CaseRow& row) override {
    const char* separator = "";
    for (const TableColumn& column : columns_) {
      line_ += separator;
      separator = ",";
      add(row[column.cell]);
    }
    line_ += '\n';
  }
};

class JsonTable final : public TextTable {
 public:
  explicit JsonTable(const std::string& path)
      : TextTable(path, {"null", "false", "true",
                         [](std::string& line, std::string_view text) { line += nlohmann::json(text).dump(); }}) {}

 private:
  void begin_lines() override {
    names_.clear();
    for (const TableColumn& column : columns_) names_.push_back(nlohmann::json(column.name).dump() + ':');
  }
  void write_line(const CaseRow& row) override {
    char separator = '{';
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      line_ += separator;
      separator = ',';
      line_ += names_[i];
      add(row[columns_[i].cell]);
    }
    line_ += "}\n";
  }

  std::vector<std::string> names_;  // as JSON, with the colon
};

}  // namespace

std::vector<TableColumn> table_columns(const CaseRow& row) {
  std::vector<TableColumn> columns;
  for (std::size_t i = 0; i < row.columns().size(); ++i) columns.push_back({{}, i, row.columns()[i].group});
  std::ranges::stable_sort(columns, {}, &TableColumn::group);
  std::set<std::string> used;
  for (const CaseColumn& column : row.columns())
    if (column.group != CaseGroup::axis) used.insert(lower_case(column.name()));
  std::set<std::string> given;
  for (TableColumn& column : columns) {
    const std::string name = row.columns()[column.cell].name();
    column.name = name;
    const bool is_axis = column.group == CaseGroup::axis;
    for (int number = 2;
         given.contains(lower_case(column.name)) || (is_axis && used.contains(lower_case(column.name))); ++number)
      column.name = fmt::format("{}_{}", name, number);
    given.insert(lower_case(column.name));
  }
  return columns;
}

std::unique_ptr<CaseTable> csv_table(const std::string& path) { return std::make_unique<CsvTable>(path); }
std::unique_ptr<CaseTable> json_table(const std::string& path) { return std::make_unique<JsonTable>(path); }

CollectedCases collect_cases(CampaignRows& rows, std::span<const std::unique_ptr<CaseTable>> tables) {
  CaseRow row;
  CollectedCases collected;
  // A stream is written after all columns are known.
  bool is_known = std::ranges::all_of(tables, [](const auto& table) { return table->can_begin_again(); });
  for (bool is_whole = false; !is_whole; is_known = true) {
    ProgressLine line;
    std::size_t columns = 0;  // of the tables
    is_whole = is_known;
    collected = {};
    rows.read(
        [&](std::string_view text, std::uint64_t index) {
          row.read(text, index);
          if (row[CaseRow::error].kind != CaseCell::Kind::empty) ++collected.not_run;
          if (columns == 0) {  // the first row
            const std::vector<TableColumn> all = table_columns(row);
            columns = all.size();
            if (is_whole)
              for (const auto& table : tables) table->begin(all);
          }
          if (row.columns().size() > columns) is_whole = false;
          if (!is_whole) return;
          for (const auto& table : tables) table->write(row);
        },
        [&](double done) {
          if (line.is_due()) line.show(done, "the cases");
        });
    collected.columns = row.columns().size();
    if (columns == 0 && is_whole)  // no case at all
      for (const auto& table : tables) table->begin(table_columns(row));
  }
  for (const auto& table : tables) table->commit();
  return collected;
}

}  // namespace imud
