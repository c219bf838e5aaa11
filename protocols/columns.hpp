// Columns: rows of comma-separated text, and the base class of truth formats made of such rows.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/line_truth_decoder.hpp"

namespace imud {

// Returns `text` without blanks, tabs, CR and LF at both ends.
std::string_view trim(std::string_view text) noexcept;

// Returns `field` trimmed, without the quotes that spreadsheets write around it; blanks inside the quotes are
// trimmed, too.
std::string_view unquoted(std::string_view field) noexcept;

// Removes the first field from `row` and returns it untrimmed. After the last field, row.data() is nullptr.
std::string_view take_field(std::string_view& row) noexcept;

// Parse the whole of `field`. Surrounding blanks and one leading '+' are allowed; parse_real() accepts NaN and
// infinity, too. Return nullopt if the field is not a number, or out of the type's range.
std::optional<double> parse_real(std::string_view field) noexcept;
std::optional<std::int64_t> parse_integer(std::string_view field) noexcept;

// Finds columns by name. The constructor takes the wanted names; set() takes the names of all columns in their order,
// from a header row or a list. Allocates nothing. One thread.
class Columns {
 public:
  static constexpr std::size_t max_wanted = 32;
  static constexpr std::size_t max_columns = 256;

  // `same(given, wanted)` returns true if `given`, an unquoted name of the header, means the wanted name. `wanted`
  // must outlive this; more than max_wanted names throw std::logic_error.
  using Same = bool (*)(std::string_view given, std::string_view wanted);
  Columns(std::span<const std::string_view> wanted, Same same);

  // Sets the names of the columns, in order. Returns false, and forgets all columns, if there are more than
  // max_columns. Of two columns with the same name, the first is used.
  bool set(std::string_view header) noexcept;
  bool set(std::span<const std::string> names) noexcept;

  std::string_view name(std::size_t wanted) const noexcept { return wanted_[wanted]; }
  // Returns true if the `count` wanted columns from index `first` on are all present.
  bool has(std::size_t first, std::size_t count = 1) const noexcept;

  // Splits a row into fields, which are views into `row`. Returns ok, too_short or too_long.
  TruthResult split(std::string_view row) noexcept;

  // Read wanted columns from index `first` on of the row that was split last; they must be present (has()). Return ok
  // or bad_number.
  TruthResult read(std::size_t first, double& number) const noexcept;
  TruthResult read(std::size_t first, Vector3& vector) const noexcept;
  std::string_view field(std::size_t wanted) const noexcept { return unquoted(fields_[wanted]); }

 private:
  static constexpr std::uint8_t unwanted = max_wanted;

  void clear() noexcept;
  bool add(std::string_view name) noexcept;

  std::span<const std::string_view> wanted_;
  Same same_;
  std::array<std::uint8_t, max_columns> wanted_at_ = {};  // per column: the index of its wanted name, or `unwanted`
  std::size_t count_ = 0;
  std::uint32_t present_ = 0;                            // bit set of the wanted names
  std::array<std::string_view, max_wanted + 1> fields_;  // the last element receives the unwanted fields
};

// The setting that makes a format of columns readable without its header row.
inline constexpr Setting columns_setting = {
    .key = "columns",
    .help = "names of the columns, for a stream whose header row is missed",
    .initial = std::span<const std::string_view>{},
};

// Returns the number of columns of the groups that are needed so.
constexpr std::size_t column_count(std::span<const ColumnGroup> groups, ColumnGroup::Need need) {
  std::size_t count = 0;
  for (const ColumnGroup& group : groups)
    if (group.need == need) count += group.names.size();
  return count;
}

// A truth format whose records are rows that follow a header row. A byte order mark (UTF-8) before a row is ignored.
class ColumnTruthDecoder : public LineTruthDecoder {
 protected:
  enum class Kind : std::uint8_t { state, header, remark };

  ColumnTruthDecoder(std::span<const std::string_view> wanted, Columns::Same same) : columns_(wanted, same) {}
  // Applies the setting `columns`, if it is not empty; called by the constructor of a derived class. Throws
  // std::invalid_argument if required columns are missing: the message names the missing ones among the first
  // `required` wanted names, then `wanted`.
  void configure(const Settings& settings, std::size_t required, std::string_view wanted);

  const Columns& columns() const noexcept { return columns_; }

 private:
  TruthResult decode(std::string_view line, Truth& truth) noexcept final;
  // Returns the kind of `row`, which is trimmed and not empty. Removes from a header row all but the column names.
  virtual Kind kind(std::string_view& row) const noexcept = 0;
  // Returns true if the columns present are enough.
  virtual bool enough() const noexcept = 0;
  // Converts the row that was split last. Numbers stored in `truth` need no check: the caller checks that they are
  // finite and in range.
  virtual TruthResult convert(Truth& truth) const noexcept = 0;

  Columns columns_;
  bool enough_ = false;
};

}  // namespace imud
