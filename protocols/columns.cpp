#include "protocols/columns.hpp"

#include <charconv>
#include <cstring>
#include <stdexcept>

namespace imud {

namespace {

template <class Number>
bool is_number(std::string_view field, Number& number) noexcept {
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), number);
  return error == std::errc{} && end == field.data() + field.size();
}

template <class Number>
std::optional<Number> parse(std::string_view field) noexcept {
  Number number;
  if (is_number(field, number)) return number;  // most fields have neither blanks nor a plus sign
  field = trim(field);
  if (field.size() > 1 && field[0] == '+' && field[1] != '-') field.remove_prefix(1);
  if (is_number(field, number)) return number;
  return {};
}

}  // namespace

std::string_view trim(std::string_view text) noexcept {
  constexpr auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view unquoted(std::string_view field) noexcept {
  field = trim(field);
  if (field.size() < 2 || field.front() != '"' || field.back() != '"') return field;
  return trim(field.substr(1, field.size() - 2));
}

std::string_view take_field(std::string_view& row) noexcept {
  const std::size_t comma = row.find(',');
  const std::string_view field = row.substr(0, comma);
  row = comma == std::string_view::npos ? std::string_view{} : row.substr(comma + 1);
  return field;
}

std::optional<double> parse_real(std::string_view field) noexcept { return parse<double>(field); }
std::optional<std::int64_t> parse_integer(std::string_view field) noexcept { return parse<std::int64_t>(field); }

Columns::Columns(std::span<const std::string_view> wanted, Same same) : wanted_(wanted), same_(same) {
  if (wanted.size() > max_wanted) throw std::logic_error("more columns are wanted than Columns has room for");
}

void Columns::clear() noexcept {
  count_ = 0;
  present_ = 0;
}

bool Columns::add(std::string_view name) noexcept {
  if (count_ == max_columns) {
    clear();
    return false;
  }
  std::uint8_t number = 0;
  while (number < wanted_.size() && !same_(unquoted(name), wanted_[number])) ++number;
  const bool first_of_its_name = number < wanted_.size() && !has(number);
  if (first_of_its_name) present_ |= 1U << number;
  wanted_at_[count_++] = first_of_its_name ? number : unwanted;
  return true;
}

bool Columns::set(std::string_view header) noexcept {
  clear();
  while (header.data() != nullptr)
    if (!add(take_field(header))) return false;
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
    const auto* comma = static_cast<const char*>(std::memchr(begin, ',', static_cast<std::size_t>(end - begin)));
    fields_[wanted_at_[column]] = {begin, comma == nullptr ? end : comma};
    begin = comma == nullptr ? nullptr : comma + 1;
  }
  return begin == nullptr ? TruthResult::ok : TruthResult::too_long;
}

TruthResult Columns::read(std::size_t first, double& number) const noexcept {
  std::optional<double> parsed = parse_real(fields_[first]);
  if (!parsed) parsed = parse_real(field(first));  // spreadsheets may quote numbers
  if (!parsed) return TruthResult::bad_number;
  number = *parsed;
  return TruthResult::ok;
}

TruthResult Columns::read(std::size_t first, Vector3& vector) const noexcept {
  for (std::size_t i = 0; i < 3; ++i) {
    const auto result = read(first + i, vector[static_cast<Eigen::Index>(i)]);
    if (result != TruthResult::ok) return result;
  }
  return TruthResult::ok;
}

TruthResult ColumnTruthDecoder::decode(std::string_view line, Truth& truth) noexcept {
  if (line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
  std::string_view row = trim(line);
  if (row.empty()) return TruthResult::no_state;
  switch (kind(row)) {
    case Kind::state:
      break;
    case Kind::remark:
      return TruthResult::no_state;
    case Kind::header:
      enough_ = columns_.set(row) && enough();
      return enough_ ? TruthResult::no_state : TruthResult::no_columns;
  }
  if (!enough_) return TruthResult::no_columns;
  auto result = columns_.split(row);
  if (result != TruthResult::ok) return result;
  truth = {};
  result = convert(truth);
  if (result != TruthResult::ok) return result;
  if (!is_finite(truth)) return TruthResult::not_finite;
  return is_in_range(truth) ? TruthResult::ok : TruthResult::out_of_range;
}

void ColumnTruthDecoder::configure(const Settings& settings, std::size_t required, std::string_view wanted) {
  const std::vector<std::string>& names = settings.list(columns_setting.key);
  if (names.empty()) return;
  enough_ = columns_.set(names) && enough();
  if (enough_) return;
  std::string missing;
  for (std::size_t i = 0; i < required && names.size() <= Columns::max_columns; ++i)
    if (!columns_.has(i)) missing.append(missing.empty() ? "missing " : ", ").append(columns_.name(i));
  if (!missing.empty()) missing += "; ";
  throw std::invalid_argument("columns: " + missing + "give at most " + std::to_string(Columns::max_columns) +
                              " names, among them " + std::string(wanted));
}

}  // namespace imud
