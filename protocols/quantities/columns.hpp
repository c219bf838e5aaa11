// Columns: finds fields in rows of text whose columns are separated by commas, semicolons or tabs.
// ColumnTruthDecoder: the base class of truth formats whose records are such rows.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "protocols/quantities/line_truth_decoder.hpp"
#include "protocols/quantities/truth_assembly.hpp"

namespace imud {

// Returns `text` without the byte order mark (UTF-8) that some programs write before the first line.
std::string_view without_order_mark(std::string_view text) noexcept;
// Returns `text` without leading and trailing blanks, tabs, CR and LF.
std::string_view trim(std::string_view text) noexcept;
// Returns `line` without leading and trailing blanks, CR and LF; tabs stay.
std::string_view without_blanks(std::string_view line) noexcept;

// Returns `field` trimmed, without the quotes that spreadsheets write around it; blanks inside the quotes are
// trimmed, too.
std::string_view unquoted(std::string_view field) noexcept;

// Removes the first field from `row` and returns it untrimmed. After the last field, row.data() is nullptr. A field
// in quotes may contain the delimiter.
std::string_view take_field(std::string_view& row, char delimiter = ',') noexcept;

// Returns the delimiter of a header row: its most frequent character among comma, semicolon and tab.
char delimiter_of(std::string_view header) noexcept;

// Both parse the whole of `field`. Surrounding blanks and one leading '+' are allowed; parse_real() accepts NaN
// and infinity, too. Both return nullopt if the field is not a number, or out of the type's range.
std::optional<double> parse_real(std::string_view field) noexcept;
std::optional<std::int64_t> parse_integer(std::string_view field) noexcept;

// Returns whether `given`, a name that is not known, probably is a misspelt `wanted`, perhaps with a unit behind it.
bool is_near(std::string_view given, std::string_view wanted) noexcept;

// Writes to `room` the quantity, with its unit, that `name`, which is none, probably means. Returns the size of the
// text; 0 if there is none.
std::size_t meant_quantity(std::string_view name, std::span<char> room) noexcept;
// Writes to a remark that `name` is no quantity, and which one it probably means. Writes nothing if it means none.
void describe_no_quantity(std::string_view name, RemarkWriter& out) noexcept;

// Finds columns by name. The constructor takes the wanted names; set() takes the names of all columns in their order,
// from a header row or a list. Allocates nothing. One thread.
class Columns {
 public:
  static constexpr std::size_t max_wanted = 32;
  static constexpr std::size_t max_columns = 256;

  // `same(given, wanted)` returns true if `given`, an unquoted name of the header, means the wanted name. `wanted`
  // must outlive this object. The constructor throws std::logic_error for more than max_wanted names.
  using Same = bool (*)(std::string_view given, std::string_view wanted);
  Columns(std::span<const std::string_view> wanted, Same same);

  // Sets the names of the columns, in order, and the delimiter: the delimiter of the header row, or a comma for a
  // list of names. Returns false, and forgets all columns, if there are more than max_columns columns. Of two
  // columns with the same name, the first is used.
  bool set(std::string_view header) noexcept;
  bool set(std::span<const std::string> names) noexcept;

  std::span<const std::string_view> wanted() const noexcept { return wanted_; }
  std::string_view name(std::size_t wanted) const noexcept { return wanted_[wanted]; }
  // Returns the index of the wanted name that `name`, a field of a header row, means; wanted().size() if `name`
  // means no wanted name.
  std::size_t find(std::string_view name) const noexcept;
  // The number of columns; 0 if the columns are not known.
  std::size_t count() const noexcept { return count_; }
  char delimiter() const noexcept { return delimiter_; }
  // Returns true if the `count` wanted columns from index `first` on are all present.
  bool has(std::size_t first, std::size_t count = 1) const noexcept;

  // Returns the index of the wanted name of a column; wanted().size() or more if the column is not wanted.
  // Requires `column` below count().
  std::size_t wanted_at(std::size_t column) const noexcept { return wanted_at_[column]; }

  // Splits a row into fields, which are views into `row`. Returns ok, too_short or too_long.
  TruthResult split(std::string_view row) noexcept;

  // The field of a wanted column in the row that was split last, with its blanks and quotes. Requires that the
  // column is present (has()).
  std::string_view field(std::size_t wanted) const noexcept { return fields_[wanted]; }

 private:
  static constexpr std::uint8_t unwanted = max_wanted;

  void clear() noexcept;
  bool add(std::string_view name) noexcept;
  TruthResult split_quoted(std::string_view row) noexcept;

  std::span<const std::string_view> wanted_;
  Same same_;
  std::array<std::uint8_t, max_columns> wanted_at_ = {};  // per column: the index of its wanted name, or `unwanted`
  std::size_t count_ = 0;
  char delimiter_ = ',';
  std::uint32_t present_ = 0;                            // bit set of the wanted names
  std::array<std::string_view, max_wanted + 1> fields_;  // the last element receives the unwanted fields
};

// The setting that makes a format of columns readable without its header row.
inline constexpr Setting columns_setting = list_setting("columns",
                                                        "names of the columns in their order; needed if imud starts "
                                                        "after the simulator, which sends its header row once");

// The wanted columns of a truth format.
struct ColumnNames {
  std::span<const std::string_view> names;
  std::span<const std::string_view> quantities;  // one for each name, with its unit (truth_quantities.hpp)
  std::span<const ColumnGroup> groups;           // of the names, in their order, required ones first
  std::string_view summary;                      // all required columns, as text for people

  // The number of required names.
  constexpr std::size_t required() const {
    std::size_t count = 0;
    for (const ColumnGroup& group : groups)
      if (group.need == ColumnGroup::required) count += group.names.size();
    return count;
  }
};

// A truth format whose records are rows that follow a header row; its columns are quantities of truth. A byte order
// mark (UTF-8) before a row is ignored.
class ColumnTruthDecoder : public LineTruthDecoder {
 public:
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept final;

 protected:
  enum class Kind : std::uint8_t { state, header, remark };

  ColumnTruthDecoder(const ColumnNames& wanted, Columns::Same same, const TruthAssembly::Axes& axes = {});
  // Applies the setting `columns`, if it is not empty; called by the constructor of a derived class. Throws
  // std::invalid_argument, which names the missing columns, if required ones are missing.
  void configure(const Settings& settings);

  TruthResult decode(std::string_view line, Truth& truth) noexcept final;

 private:
  // Returns the kind of `row`. Requires a row that is not empty and has no leading or trailing blanks. Reduces a
  // header row to its column names.
  virtual Kind kind(std::string_view& row) const noexcept = 0;

  bool choose() noexcept;
  bool read_plain(std::string_view row) noexcept;
  bool reads(std::size_t wanted) const noexcept {
    return wanted < Columns::max_wanted && ((used_ >> wanted) & 1U) != 0;
  }
  void describe_header(RemarkWriter& out) const noexcept;
  void describe_missing(RemarkWriter& out) const noexcept;
  void describe_number(TruthResult result, RemarkWriter& out) const noexcept;

  const ColumnNames wanted_;
  const TruthAssembly::Axes axes_;
  std::array<TruthField, Columns::max_wanted> fields_;  // by wanted column
  Columns columns_;
  std::uint32_t used_ = 0;  // bit set of the wanted columns that are read
  bool enough_ = false;     // columns are present
  TruthReading reading_;
  TruthAssembly assembly_;
  std::string configured_;    // the setting `columns`, as a header row
  Kind kind_ = Kind::header;  // of the last row
  std::string_view row_;      // the last row
  std::string_view header_;   // the last row's column names, if it is a header row
};

}  // namespace imud
