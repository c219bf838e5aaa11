// The remarks of ColumnTruthDecoder: which columns are missing, not used or wrong.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "protocols/quantities/columns.hpp"

namespace imud {
namespace {

// Returns a character for comparisons: letters in lower case, and an underscore for a blank.
char folded(char c) noexcept {
  return c == ' ' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
}

// Returns the Levenshtein distance, or SIZE_MAX if `b` is longer than any column name.
std::size_t distance(std::string_view a, std::string_view b) noexcept {
  std::array<std::size_t, 64> row;
  if (b.size() >= row.size()) return SIZE_MAX;
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (folded(a[i - 1]) == folded(b[j - 1]) ? 0U : 1U);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row[b.size()];
}

}  // namespace

bool is_near(std::string_view given, std::string_view wanted) noexcept {
  if (given.empty() || given.size() > 2 * wanted.size()) return false;
  const std::size_t tolerated = 1 + wanted.size() / 12;
  return distance(given.substr(0, wanted.size()), wanted) == 0 || distance(given, wanted) <= tolerated;
}

std::size_t meant_quantity(std::string_view name, std::span<char> room) noexcept {
  for (const QuantityGroup& group : quantity_groups())
    for (const std::string_view quantity : group.names) {
      std::span<const std::string_view> units = unit_suffixes(group.kind);
      constexpr std::string_view none[] = {""};
      if (units.empty()) units = none;
      for (const std::string_view unit : units) {
        RemarkWriter writer(room);
        writer << quantity << unit;
        const std::string_view wanted(room.data(), writer.size());
        const std::size_t sizes[] = {name.size(), wanted.size()};
        constexpr std::size_t most = 2;  // further letters; it bounds the time of the search
        const bool lacks_unit = name == quantity;
        if (lacks_unit ||
            (std::max(sizes[0], sizes[1]) - std::min(sizes[0], sizes[1]) <= most && is_near(name, wanted)))
          return wanted.size();
      }
    }
  return 0;
}

void describe_no_quantity(std::string_view name, RemarkWriter& out) noexcept {
  std::array<char, 64> room;
  const std::string_view meant(room.data(), meant_quantity(name, room));
  if (meant.empty()) return;
  (out << "; ").quote(name, 64);
  (out << " is no quantity (did you mean ").quote(meant) << "?)";
}

namespace {

// Writes a blank and the unit in a quantity's name, "ft/s^2" for "specific_force_x_ft_per_s2". Writes nothing if the
// name has no unit.
void write_unit(RemarkWriter& out, std::string_view name, std::size_t quantity) noexcept {
  constexpr std::string_view per = "_per_";
  name.remove_prefix(quantity_name(quantity).size());
  if (name.empty()) return;
  const std::size_t end = std::min(name.find(per), name.size());
  out << " " << name.substr(1, end - 1);
  if (end == name.size()) return;
  name.remove_prefix(end + per.size());
  const bool is_power = name.back() >= '0' && name.back() <= '9';
  out << "/" << name.substr(0, name.size() - (is_power ? 1 : 0));
  if (is_power) out << "^" << name.substr(name.size() - 1);
}

}  // namespace

std::size_t ColumnTruthDecoder::describe(TruthResult result, std::span<char> room) const noexcept {
  RemarkWriter out(room);
  switch (result) {
    case TruthResult::no_state:
      if (kind_ == Kind::header) describe_header(out);
      break;
    case TruthResult::no_columns:
      describe_missing(out);
      break;
    case TruthResult::too_short:
    case TruthResult::too_long: {
      std::size_t fields = 0;
      for (std::string_view rest = row_; rest.data() != nullptr; ++fields) take_field(rest, columns_.delimiter());
      out << "a row has " << fields << " fields, and there are " << columns_.count() << " columns: ";
      out.quote(row_);
      break;
    }
    case TruthResult::bad_number:
    case TruthResult::not_finite:
    case TruthResult::out_of_range:
      describe_number(result, out);
      break;
    default:
      break;
  }
  return out.size();
}

// Names the columns that are not read.
void ColumnTruthDecoder::describe_header(RemarkWriter& out) const noexcept {
  constexpr std::size_t most = 16;  // columns that are named
  std::size_t unused = 0;
  std::uint32_t seen = 0;  // bit set of the wanted columns
  for (std::string_view rest = header_; rest.data() != nullptr;) {
    const std::string_view field = unquoted(take_field(rest, columns_.delimiter()));
    const std::size_t number = columns_.find(field);
    const bool known = number < columns_.wanted().size(), again = known && ((seen >> number) & 1U) != 0;
    if (known) seen |= 1U << number;
    if (known && !again && reads(number)) continue;
    if (++unused > most) continue;
    (out << (unused == 1 ? "columns that are not used: " : ", ")).quote(field, 64);
    if (again) out << " (given twice)";
    if (!known)
      for (std::size_t i = 0; i < columns_.wanted().size(); ++i)
        if (!columns_.has(i) && is_near(field, columns_.name(i))) {
          (out << " (did you mean ").quote(columns_.name(i)) << "?)";
          break;
        }
    if (!known || again) continue;
    std::size_t first = 0;
    const auto* group = wanted_.groups.data();
    while (first + group->names.size() <= number) first += (group++)->names.size();
    for (std::size_t i = first; i < first + group->names.size(); ++i)
      if (!columns_.has(i)) {
        (out << " (needs ").quote(columns_.name(i)) << ")";
        break;
      }
  }
  if (unused > most) out << " and " << unused - most << " more";
}

// Describes the missing columns. The last row is a header row without enough columns, or no header row came before
// it.
void ColumnTruthDecoder::describe_missing(RemarkWriter& out) const noexcept {
  const char delimiter = delimiter_of(row_);
  const bool is_state = kind_ == Kind::state && parse_real(unquoted(row_.substr(0, row_.find(delimiter))));
  if (is_state) {
    (out << "there was no header row before the row ").quote(row_) << ", ";
  } else {
    std::size_t missing = 0;
    out << "the header row lacks ";
    for (std::size_t i = 0; i < wanted_.required(); ++i) {
      std::string_view meant;
      bool present = kind_ == Kind::header && columns_.has(i);
      constexpr int most = 64;  // fields that are compared, so that a long row costs little
      std::string_view rest = header_;
      for (int compared = 0; rest.data() != nullptr && !present && compared < most; ++compared) {
        const std::string_view field = unquoted(take_field(rest, delimiter));
        const std::size_t number = columns_.find(field);
        present = number == i;
        if (number == columns_.wanted().size() && is_near(field, columns_.name(i))) meant = field;
      }
      if (present) continue;
      (out << (missing++ == 0 ? "" : ", ")).quote(columns_.name(i));
      if (!meant.empty()) (out << " (is it ").quote(meant, 64) << "?)";
    }
    (out << (missing == 0 ? "a column" : "") << ": ").quote(row_) << "; ";
  }
  out << "required are " << wanted_.summary;
}

void ColumnTruthDecoder::describe_number(TruthResult result, RemarkWriter& out) const noexcept {
  for (std::size_t i = 0; i < columns_.wanted().size(); ++i) {
    if (!columns_.has(i) || !reads(i)) continue;
    const std::string_view field = unquoted(columns_.field(i));
    const std::optional<double> number = parse_real(field);
    const double largest = largest_of(fields_[i]);
    const bool is_cause = !number                       ? result == TruthResult::bad_number
                          : !std::isfinite(*number)     ? result == TruthResult::not_finite
                          : std::abs(*number) > largest ? result == TruthResult::out_of_range
                                                        : false;
    if (!is_cause) continue;
    (out << "the column ").quote(columns_.name(i)) << " has ";
    out.quote(field, 64);
    if (result == TruthResult::out_of_range) {
      out << ", and its limit is " << largest;
      write_unit(out, wanted_.quantities[i], fields_[i].quantity);
    }
    if (!number && field.find(',') != field.npos) out << "; the decimal sign must be a point";
    return;
  }
}

}  // namespace imud
