#include "tools/campaign/case_row.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

namespace imud {

namespace {

// SQLite's own limit (SQLITE_MAX_COLUMN). A plan has a hundred columns; if there are far more, a metric has a new
// name in each run.
constexpr std::size_t most_columns = 2000;

}  // namespace

std::string CaseColumn::name() const {
  constexpr std::string_view metrics = "metrics.";
  switch (group) {
    case CaseGroup::expectation:
      return "expect." + key;
    case CaseGroup::digest:
      return "digest." + key;
    case CaseGroup::test:
      return "test." + (key.starts_with(metrics) ? key.substr(metrics.size()) : key);
    default:
      return key;
  }
}

std::optional<double> CaseCell::number() const noexcept {
  switch (kind) {
    case Kind::truth:
    case Kind::integer:
      return static_cast<double>(integer);
    case Kind::real:
      return real;
    default:
      return std::nullopt;
  }
}

CaseRow::CaseRow() {
  using enum CaseGroup;
  cell(CaseGroup::index, "case");
  cell(CaseGroup::index, "seed");
  cell(end, "exit_code");
  cell(end, "ended_by");
  cell(remark, "shortfalls");
  cell(remark, "error");
}

CaseCell& CaseRow::cell(CaseGroup group, std::string_view key) {
  // The members of most rows have the same order as in the previous row.
  std::size_t column = *expected_;
  if (column >= columns_.size() || columns_[column].group != group || columns_[column].key != key)
    column = *expected_ = find(group, key);
  expected_ = &next_[column];
  return cells_[column];
}

std::size_t CaseRow::find(CaseGroup group, std::string_view key) {
  const auto [at, is_new] =
      known_.try_emplace(static_cast<char>('0' + static_cast<int>(group)) + std::string(key), columns_.size());
  if (is_new) {
    if (columns_.size() == most_columns)
      throw std::runtime_error(fmt::format("the table would have more than {} columns, with {}", most_columns, key));
    columns_.push_back({group, std::string(key), CaseColumn::Kind::unknown});
    cells_.emplace_back();
    next_.push_back(0);
  }
  return at->second;
}

bool CaseRow::has_failed() const noexcept {
  if (cells_[exit_code].number() != 0 || !has_run()) return true;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const std::optional<double> number = cells_[i].number();
    if (columns_[i].group == CaseGroup::expectation && number == 0.0) return true;
    if (columns_[i].group == CaseGroup::test && columns_[i].key == "exit_code" && number && *number != 0) return true;
  }
  return false;
}

// Converts the events of nlohmann's parser to cells, without making a tree of the row.
class CaseRow::Reader {
 public:
  explicit Reader(CaseRow& row) : row_(row) {}

  bool null() { return set({}); }
  bool boolean(bool value) { return set({CaseCell::Kind::truth, value ? 1 : 0, 0, {}}); }
  bool number_integer(std::int64_t value) { return set({CaseCell::Kind::integer, value, 0, {}}); }
  bool number_unsigned(std::uint64_t value) {
    if (value <= static_cast<std::uint64_t>(INT64_MAX)) return number_integer(static_cast<std::int64_t>(value));
    return set({CaseCell::Kind::real, 0, static_cast<double>(value), fmt::to_string(value)});
  }
  bool number_float(double value, const std::string& text) { return set({CaseCell::Kind::real, 0, value, text}); }
  bool string(const std::string& text) {
    if (member_ == Member::shortfalls) {
      CaseCell& cell = row_.cells_[shortfalls];
      if (cell.kind == CaseCell::Kind::empty) cell.text.clear();
      cell.kind = CaseCell::Kind::text;
      cell.text += (cell.text.empty() ? "" : "; ") + text;
      return true;
    }
    return set({CaseCell::Kind::text, 0, 0, text});
  }
  bool binary(std::vector<std::uint8_t>&) { return false; }  // JSON has none
  bool start_object(std::size_t) { return enter(-1); }
  bool start_array(std::size_t) { return enter(0); }
  bool end_object() {
    levels_.pop_back();
    leave();
    return true;
  }
  bool end_array() { return end_object(); }
  bool key(const std::string& key) {
    if (levels_.size() == 1) {
      choose(key);
    } else {
      append(key);
    }
    return true;
  }
  bool parse_error(std::size_t, const std::string&, const std::exception& error) {
    throw std::runtime_error(error.what());
  }

 private:
  enum class Member : std::uint8_t { plain, group, shortfalls, ignored };
  struct Level {
    std::size_t prefix;  // of path_
    std::int64_t item;   // the number of the next item of an array; -1: an object
  };

  // A member of the row itself.
  void choose(const std::string& key) {
    path_.clear();
    struct Known {
      std::string_view key;
      Member member;
      CaseGroup group;
    };
    using enum CaseGroup;
    static constexpr Known all[] = {
        {"case", Member::plain, index},          {"seed", Member::plain, index},
        {"exit_code", Member::plain, end},       {"ended_by", Member::plain, end},
        {"error", Member::plain, remark},        {"shortfalls", Member::shortfalls, remark},
        {"axes", Member::group, axis},           {"digest", Member::group, digest},
        {"figures", Member::group, figure},      {"expect", Member::group, expectation},
        {"test", Member::group, CaseGroup::test}};
    member_ = Member::ignored;
    for (const Known& known : all)
      if (known.key == key) {
        member_ = known.member;
        group_ = known.group;
        if (member_ == Member::plain) path_ = key;
      }
  }
  void append(std::string_view key) {
    path_.resize(levels_.back().prefix);
    if (!path_.empty()) path_ += '.';
    path_ += key;
  }
  // Before an item of an array.
  void name_item() {
    if (levels_.empty() || levels_.back().item < 0) return;
    if (member_ == Member::group) append(fmt::to_string(levels_.back().item));
    ++levels_.back().item;
  }
  bool enter(std::int64_t item) {
    name_item();
    levels_.push_back({path_.size(), item});
    return true;
  }
  void leave() {
    if (!levels_.empty() && member_ == Member::group) path_.resize(levels_.back().prefix);
  }
  bool set(CaseCell&& value) {
    name_item();
    const bool is_own = member_ == Member::plain && levels_.size() == 1;
    if (is_own || (member_ == Member::group && levels_.size() > 1)) row_.cell(group_, path_) = std::move(value);
    return true;
  }

  CaseRow& row_;
  Member member_ = Member::ignored;
  CaseGroup group_ = CaseGroup::index;
  std::string path_;
  std::vector<Level> levels_;
};

void CaseRow::read(std::string_view text, std::uint64_t index) {
  for (CaseCell& cell : cells_) cell.kind = CaseCell::Kind::empty;
  expected_ = &first_;
  Reader reader(*this);
  try {
    nlohmann::json::sax_parse(text.begin(), text.end(), &reader);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("case {}: its row cannot be read: {}", index, error.what()));
  }
  const CaseCell& number = cells_[index_column];
  if (number.kind != CaseCell::Kind::integer || number.integer != static_cast<std::int64_t>(index))
    throw std::runtime_error(fmt::format("case {}: its row is of another case, or of none", index));
  count_zeros();
}

void CaseRow::count_zeros() noexcept {
  using enum CaseColumn::Kind;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    CaseColumn& column = columns_[i];
    CaseCell& cell = cells_[i];
    if (column.group != CaseGroup::figure || column.kind == other) continue;
    if (cell.kind == CaseCell::Kind::empty) {
      if (column.kind == counter && has_run()) {
        cell.kind = CaseCell::Kind::integer;
        cell.integer = 0;
      }
    } else if (column.kind == unknown) {
      column.kind = cell.kind == CaseCell::Kind::integer ? counter : other;
    }
  }
}

}  // namespace imud
