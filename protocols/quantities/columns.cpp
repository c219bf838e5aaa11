#include "protocols/quantities/columns.hpp"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "core/numbers/number_text.hpp"

namespace imud {
namespace {

template <class Number>
std::optional<Number> parse(std::string_view field) noexcept {
  if (const auto number = number_in<Number>(field)) return number;  // most have neither blanks nor a plus sign
  field = trim(field);
  if (field.size() > 1 && field[0] == '+' && field[1] != '-') field.remove_prefix(1);
  return number_in<Number>(field);
}

// Returns whether the text of a quantity is a plain number.
bool is_plain(QuantityKind kind) noexcept { return kind != QuantityKind::time && kind != QuantityKind::text; }

}  // namespace

std::string_view without_order_mark(std::string_view text) noexcept {
  constexpr std::string_view mark = "\xEF\xBB\xBF";
  return text.substr(text.starts_with(mark) ? mark.size() : 0);
}

std::string_view trim(std::string_view text) noexcept {
  constexpr auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view without_blanks(std::string_view line) noexcept {
  constexpr auto blank = [](char c) { return c == ' ' || c == '\r' || c == '\n'; };
  while (!line.empty() && blank(line.front())) line.remove_prefix(1);
  while (!line.empty() && blank(line.back())) line.remove_suffix(1);
  return line;
}

std::string_view unquoted(std::string_view field) noexcept {
  field = trim(field);
  if (field.size() < 2 || field.front() != '"' || field.back() != '"') return field;
  return trim(field.substr(1, field.size() - 2));
}

std::string_view take_field(std::string_view& row, char delimiter) noexcept {
  std::size_t end = row.find(delimiter);
  const std::size_t first = row.find_first_not_of(" \t");
  if (end != row.npos && first < end && row[first] == '"') {
    // A doubled quote is a part of the text. The closing quote is followed by a delimiter or the end of the row.
    constexpr std::size_t most = 1000;  // characters in quotes, so that many quotes in a long row cost little
    const std::string_view near = row.substr(0, first + most);
    for (std::size_t quote = near.find('"', first + 1); quote != row.npos; quote = near.find('"', quote + 1)) {
      if (row.substr(quote, 2) == "\"\"") {
        ++quote;
        continue;
      }
      const std::size_t next = row.find_first_not_of(' ', quote + 1);
      if (next != row.npos && row[next] != delimiter) continue;
      end = next;
      break;
    }
  }
  const std::string_view field = row.substr(0, end);
  row = end == row.npos ? std::string_view{} : row.substr(end + 1);
  return field;
}

char delimiter_of(std::string_view header) noexcept {
  char most = ',';
  for (const char delimiter : {';', '\t'})
    if (std::ranges::count(header, delimiter) > std::ranges::count(header, most)) most = delimiter;
  return most;
}

std::optional<double> parse_real(std::string_view field) noexcept { return parse<double>(field); }
std::optional<std::int64_t> parse_integer(std::string_view field) noexcept { return parse<std::int64_t>(field); }

Columns::Columns(std::span<const std::string_view> wanted, Same same) : wanted_(wanted), same_(same) {
  if (wanted.size() > max_wanted) throw std::logic_error("more columns are wanted than Columns has room for");
}

void Columns::clear() noexcept {
  delimiter_ = ',';
  count_ = 0;
  present_ = 0;
}

bool Columns::add(std::string_view name) noexcept {
  if (count_ == max_columns) {
    clear();
    return false;
  }
  const auto number = static_cast<std::uint8_t>(find(name));
  const bool first_of_its_name = number < wanted_.size() && !has(number);
  if (first_of_its_name) present_ |= 1U << number;
  wanted_at_[count_++] = first_of_its_name ? number : unwanted;
  return true;
}

std::size_t Columns::find(std::string_view name) const noexcept {
  const std::string_view given = unquoted(name);
  std::size_t wanted = 0;
  while (wanted < wanted_.size() && !same_(given, wanted_[wanted])) ++wanted;
  return wanted;
}

bool Columns::set(std::string_view header) noexcept {
  clear();
  const char delimiter = delimiter_of(header);
  while (header.data() != nullptr)
    if (!add(take_field(header, delimiter))) return false;
  delimiter_ = delimiter;
  return true;
}

bool Columns::set(std::span<const std::string> names) noexcept {
  clear();
  for (const std::string& name : names)
    if (!add(name)) return false;
  return true;
}

bool Columns::has(std::size_t first, std::size_t count) const noexcept {
  const std::uint32_t mask = ((1U << count) - 1U) << first;
  return (present_ & mask) == mask;
}

TruthResult Columns::split(std::string_view row) noexcept {
  const char* begin = row.data();
  const char* const end = begin + row.size();
  for (std::size_t column = 0; column < count_; ++column) {
    if (begin == nullptr) return TruthResult::too_short;
    const auto* next =
        static_cast<const char*>(std::memchr(begin, delimiter_, static_cast<std::size_t>(end - begin)));
    fields_[wanted_at_[column]] = {begin, next == nullptr ? end : next};
    begin = next == nullptr ? nullptr : next + 1;
  }
  if (begin == nullptr) return TruthResult::ok;
  return row.find('"') == row.npos ? TruthResult::too_long : split_quoted(row);
}

TruthResult Columns::split_quoted(std::string_view row) noexcept {
  for (std::size_t column = 0; column < count_; ++column) {
    if (row.data() == nullptr) return TruthResult::too_short;
    fields_[wanted_at_[column]] = take_field(row, delimiter_);
  }
  return row.data() == nullptr ? TruthResult::ok : TruthResult::too_long;
}

ColumnTruthDecoder::ColumnTruthDecoder(const ColumnNames& wanted, Columns::Same same, const TruthAssembly::Axes& axes)
    : wanted_(wanted), axes_(axes), columns_(wanted.names, same) {
  for (std::size_t i = 0; i < wanted.quantities.size(); ++i)
    fields_[i] = find_truth_field(wanted.quantities[i]).value();
}

// Chooses the columns to read: all complete groups, but of alternative groups only the first. Returns false if too
// few groups are complete.
bool ColumnTruthDecoder::choose() noexcept {
  used_ = 0;
  QuantitySet given;
  bool needs_one = false, has_one = false;
  std::size_t first = 0;
  for (const ColumnGroup& group : wanted_.groups) {
    const std::size_t begin = std::exchange(first, first + group.names.size());
    bool is_used = columns_.has(begin, group.names.size());
    if (group.need == ColumnGroup::required && !is_used) return false;
    if (group.need == ColumnGroup::one_of) {
      needs_one = true;
      is_used = is_used && !has_one;
      has_one = has_one || is_used;
    }
    const bool is_accumulated = fields_[begin].quantity == quantity_group(TruthGroup::accumulated_dv).first;
    if (is_accumulated && axes_.accumulated_dv == AccumulatedDv::none) is_used = false;
    for (std::size_t i = begin; i < first && is_used; ++i) {
      used_ |= 1U << i;
      given.set(fields_[i].quantity);
    }
  }
  RemarkWriter fault({});
  return has_one == needs_one && assembly_.choose(given, axes_, fault);
}

// Reads a row whose numbers have neither blanks nor quotes, as in most rows: each field must end where its number
// ends. Returns false for any other row, which has to be split, and may be wrong.
bool ColumnTruthDecoder::read_plain(std::string_view row) noexcept {
  for (std::size_t column = 0; column < columns_.count(); ++column) {
    const std::size_t wanted = columns_.wanted_at(column);
    std::size_t size = 0;
    // Many fields are one character, "0". These need neither a search for the delimiter nor from_chars().
    const bool is_one_character = row.size() > 1 && row[1] == columns_.delimiter() && row[0] != columns_.delimiter();
    if (reads(wanted) && is_plain(fields_[wanted].kind)) {
      double number = 0;
      if (is_one_character && row[0] >= '0' && row[0] <= '9') {
        number = row[0] - '0';
        size = 1;
      } else {
        const auto [end, error] = std::from_chars(row.data(), row.data() + row.size(), number);
        if (error != std::errc()) return false;
        size = static_cast<std::size_t>(end - row.data());
      }
      if (reading_.set(fields_[wanted], number) != TruthResult::ok) return false;
    } else {
      size = is_one_character ? 1 : std::min(row.find(columns_.delimiter()), row.size());
      if (reads(wanted) && reading_.set(fields_[wanted], row.substr(0, size)) != TruthResult::ok) return false;
    }
    if (size == row.size()) return column + 1 == columns_.count();
    if (row[size] != columns_.delimiter()) return false;
    row.remove_prefix(size + 1);
  }
  return false;
}

TruthResult ColumnTruthDecoder::decode(std::string_view line, Truth& truth) noexcept {
  row_ = without_blanks(without_order_mark(line));  // a tab may be the delimiter of an empty field
  kind_ = Kind::remark;
  if (row_.empty() || (row_.front() == '\t' && trim(row_).empty())) return TruthResult::no_state;
  header_ = row_;
  kind_ = kind(header_);
  switch (kind_) {
    case Kind::state:
      break;
    case Kind::remark:
      return TruthResult::no_state;
    case Kind::header:
      enough_ = columns_.set(header_) && choose();
      return enough_ ? TruthResult::no_state : TruthResult::no_columns;
  }
  if (!enough_) return TruthResult::no_columns;
  if (read_plain(row_)) {
    const TruthResult result = assembly_.convert(reading_, truth);
    if (result != TruthResult::ok) columns_.split(row_);  // describe() needs its fields
    return result;
  }
  auto result = columns_.split(row_);
  if (result != TruthResult::ok) return result;
  for (std::size_t i = 0; i < wanted_.names.size() && result == TruthResult::ok; ++i)
    if (reads(i)) result = reading_.set(fields_[i], columns_.field(i));
  return result == TruthResult::ok ? assembly_.convert(reading_, truth) : result;
}

void ColumnTruthDecoder::configure(const Settings& settings) {
  const std::vector<std::string>& names = settings.list(columns_setting.key);
  if (names.empty()) return;
  enough_ = columns_.set(names) && choose();
  for (const std::string& name : names) configured_.append(configured_.empty() ? "" : ",").append(name);
  header_ = configured_;
  if (enough_) return;
  std::string missing;
  for (std::size_t i = 0; i < wanted_.required() && names.size() <= Columns::max_columns; ++i)
    if (!columns_.has(i)) missing.append(missing.empty() ? "missing " : ", ").append(columns_.name(i));
  if (!missing.empty()) missing += "; ";
  throw std::invalid_argument("columns: " + missing + "give at most " + std::to_string(Columns::max_columns) +
                              " names, among them " + std::string(wanted_.summary));
}

}  // namespace imud
