#include "protocols/quantities/mapped_columns.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "protocols/quantities/columns.hpp"

namespace imud {
namespace {

char delimiter_in(std::string_view row) noexcept {
  return row.find_first_of(",;\t") == row.npos && row.find(' ') != row.npos ? ' ' : delimiter_of(row);
}

// Takes a field as take_field() does. If the delimiter is a blank, any number of blanks separates fields.
std::string_view take(std::string_view& row, char delimiter) noexcept {
  if (delimiter != ' ') return take_field(row, delimiter);
  const std::size_t end = row.find(' ');
  const std::string_view field = row.substr(0, end);
  row = end == row.npos ? std::string_view{} : row.substr(std::min(row.find_first_not_of(' ', end), row.size()));
  return field;
}

constexpr std::size_t most_searched = 4;  // columns whose meaning is searched, which takes time

bool is_number(std::string_view field) noexcept { return parse_real(unquoted(field)).has_value(); }

// Returns the number of a column; nullopt if `text` is no number of a column.
std::optional<std::size_t> column_number(std::string_view text) noexcept {
  const auto number = parse_integer(text);
  if (!number || *number < 0 || !std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; })) return {};
  return static_cast<std::size_t>(*number);
}

}  // namespace

MappedColumns::MappedColumns(TruthMap map, const TruthAssembly::Axes& axes)
    : map_(std::move(map)), axes_(axes), assembly_(assembly_of(map_, axes)) {
  const auto numbers = static_cast<std::size_t>(std::ranges::count_if(
      map_, [](const MappedQuantity& mapped) { return column_number(mapped.theirs).has_value(); }));
  if (numbers == 0) {
    for (std::size_t i = 0; i < map_.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (map_[i].theirs == map_[j].theirs)
          throw std::invalid_argument("columns: column \"" + map_[i].theirs +
                                      "\" is given twice; the second time for " + map_[i].ours);
    return;
  }
  if (numbers < map_.size())
    throw std::invalid_argument("columns: some are given by name and some by number; give either for all");
  is_by_number_ = true;
  for (const MappedQuantity& mapped : map_) {
    const std::size_t number = column_number(mapped.theirs).value_or(max_columns);
    if (number >= max_columns)
      throw std::invalid_argument("columns: " + mapped.ours + " is column " + mapped.theirs + "; the largest is " +
                                  std::to_string(max_columns - 1));
    if (columns_[number].is_used)
      throw std::invalid_argument("columns: column " + mapped.theirs + " is given twice; the second time for " +
                                  mapped.ours);
    columns_[number] = {true, mapped.field};
    count_ = std::max(count_, number + 1);
  }
}

std::optional<TruthField> MappedColumns::find(std::string_view name) const noexcept {
  if (map_.empty()) return find_signed_field(name);
  for (const MappedQuantity& mapped : map_)
    if (mapped.theirs == name) return mapped.field;
  return std::nullopt;
}

// Returns whether the row is a header row. `is_remark`: the row follows a '#', and needs more known names.
bool MappedColumns::names_columns(std::string_view row, bool is_remark) const noexcept {
  constexpr std::size_t time_and_vector = 4;
  const std::size_t least = !is_remark ? 1 : map_.empty() ? time_and_vector : map_.size();
  const char delimiter = delimiter_in(row);
  std::string_view rest = row;
  if (is_number(take(rest, delimiter))) return false;
  std::size_t count = 0;
  if (is_by_number_) {  // a header row has nothing but names, which are not needed
    for (rest = row; rest.data() != nullptr; ++count)
      if (is_number(take(rest, delimiter))) return false;
    return count >= count_;
  }
  // Each truth has a time. Most other rows of text do not name one, and need no search.
  if (map_.empty() && row.find("time") == row.npos && row.find("utc") == row.npos) return false;
  std::size_t found = 0;
  for (rest = row; rest.data() != nullptr && count < max_columns && found < least; ++count)
    if (find(unquoted(take(rest, delimiter)))) ++found;
  return found == least;
}

// Returns false, and writes the fault, if the header row is not sufficient.
bool MappedColumns::set_columns(std::string_view header) noexcept {
  RemarkWriter fault(fault_);
  delimiter_ = delimiter_in(header);
  count_ = 0;
  QuantitySet given;
  for (std::string_view rest = header; rest.data() != nullptr; ++count_) {
    if (count_ == max_columns) {
      fault << "the header row has more than " << max_columns << " columns";
      break;
    }
    const auto field = find(unquoted(take(rest, delimiter_)));
    columns_[count_] = {field.has_value(), field.value_or(TruthField{})};
    if (field && given[field->quantity] && fault.size() == 0)
      fault << "the header row has " << quantity_name(field->quantity) << " twice";
    if (field) given.set(field->quantity);
  }
  for (const MappedQuantity& mapped : map_)
    if (!given[mapped.field.quantity]) {
      (fault << (fault.size() == 0 ? "the header row lacks " : ", ")).quote(mapped.theirs, 64);
      fault << " (" << mapped.ours << ")";
    }
  if (fault.size() == 0 && map_.empty()) assembly_.choose(given, axes_, fault);
  fault_size_ = fault.size();
  if (fault_size_ > 0) count_ = 0;
  return fault_size_ == 0;
}

TruthResult MappedColumns::read(std::string_view row) noexcept {
  const char delimiter = is_by_number_ ? delimiter_in(row) : delimiter_;
  std::string_view rest = row;
  for (std::size_t i = 0; i < count_; ++i) {
    if (rest.data() == nullptr) return TruthResult::too_short;
    const std::string_view field = take(rest, delimiter);
    if (!columns_[i].is_used) continue;
    const TruthResult result = reading_.set(columns_[i].field, field);
    if (result == TruthResult::ok) continue;
    bad_column_ = i;
    bad_field_ = unquoted(field);
    return result;
  }
  return rest.data() == nullptr || is_by_number_ ? TruthResult::ok : TruthResult::too_long;
}

bool MappedColumns::is_header(std::string_view line) const noexcept {
  const std::string_view row = without_blanks(without_order_mark(line));
  const bool is_remark = row.starts_with('#');
  return names_columns(is_remark ? without_blanks(row.substr(1)) : row, is_remark);
}

TruthResult MappedColumns::decode(std::string_view line, Truth& truth) noexcept {
  row_ = without_blanks(without_order_mark(line));
  bad_field_ = {};
  kind_ = Kind::remark;
  if (row_.empty() || (row_.front() == '\t' && trim(row_).empty())) return TruthResult::no_state;
  const bool is_remark = row_.front() == '#';
  if (is_remark) row_ = without_blanks(row_.substr(1));
  if (names_columns(row_, is_remark)) {
    if (is_by_number_) return TruthResult::no_state;
    kind_ = Kind::header;
    return set_columns(row_) ? TruthResult::no_state : TruthResult::no_columns;
  }
  if (is_remark) return TruthResult::no_state;
  kind_ = Kind::state;
  if (count_ == 0) return TruthResult::no_columns;
  const TruthResult result = read(row_);
  return result == TruthResult::ok ? assembly_.convert(reading_, truth) : result;
}

void MappedColumns::describe(TruthResult result, RemarkWriter& out) const noexcept {
  switch (result) {
    case TruthResult::no_state:
      if (kind_ == Kind::header) describe_header(out);
      break;
    case TruthResult::no_columns:
      if (fault_size_ > 0) {
        out << std::string_view(fault_.data(), fault_size_);
        if (kind_ == Kind::header && map_.empty()) describe_unknown(out);
      } else {
        (out << "there was no header row before the row ").quote(row_) << ", required are ";
        for (std::size_t i = 0; i < map_.size(); ++i) (out << (i == 0 ? "" : ", ")).quote(map_[i].theirs, 64);
      }
      break;
    case TruthResult::too_short:
    case TruthResult::too_long: {
      std::size_t fields = 0;
      const char delimiter = is_by_number_ ? delimiter_in(row_) : delimiter_;
      for (std::string_view rest = row_; rest.data() != nullptr; ++fields) take(rest, delimiter);
      out << "a row has " << fields << " fields, and there are " << count_ << " columns: ";
      out.quote(row_);
      break;
    }
    case TruthResult::bad_number:
    case TruthResult::not_finite:
    case TruthResult::out_of_range:
      if (bad_field_.data() == nullptr) {
        assembly_.describe(reading_, out);
        break;
      }
      out << "the column " << bad_column_ << " (" << quantity_name(columns_[bad_column_].field.quantity) << ") has ";
      out.quote(bad_field_, 64);
      if (columns_[bad_column_].field.kind == QuantityKind::text)
        out << date_form;
      else if (bad_field_.find(',') != bad_field_.npos)
        out << "; the decimal sign must be a point";
      break;
    default:
      break;
  }
}

// Writes which quantities the columns that are not used probably mean. Requires that the last row is a header row.
void MappedColumns::describe_unknown(RemarkWriter& out) const noexcept {
  std::size_t unused = 0, i = 0;
  for (std::string_view rest = row_; rest.data() != nullptr && i < max_columns && unused < most_searched; ++i) {
    const std::string_view field = unquoted(take(rest, delimiter_));
    if (columns_[i].is_used) continue;
    ++unused;
    describe_no_quantity(field, out);
  }
}

void MappedColumns::describe_header(RemarkWriter& out) const noexcept {
  constexpr std::size_t most = 16;  // columns that are named
  std::size_t unused = 0, i = 0;
  for (std::string_view rest = row_; rest.data() != nullptr; ++i) {
    const std::string_view field = unquoted(take(rest, delimiter_));
    if (columns_[i].is_used || ++unused > most) continue;
    (out << (unused == 1 ? "columns that are not used: " : ", ")).quote(field, 64);
    std::array<char, 64> room;
    if (!map_.empty() || unused > most_searched) continue;
    const std::string_view meant(room.data(), meant_quantity(field, room));
    if (const auto quantity = find_truth_field(meant); quantity && !assembly_.given()[quantity->quantity])
      (out << " (did you mean ").quote(meant) << "?)";
  }
  if (unused > most) out << " and " << unused - most << " more";
}

std::size_t MappedColumnDecoder::describe(TruthResult result, std::span<char> room) const noexcept {
  RemarkWriter out(room);
  columns_.describe(result, out);
  return out.size();
}

void MappedColumnDecoder::finish() noexcept {
  LineTruthDecoder::finish();
  columns_.begin();
}

TruthResult MappedColumnDecoder::decode(std::string_view line, Truth& truth) noexcept {
  return columns_.decode(line, truth);
}

}  // namespace imud
