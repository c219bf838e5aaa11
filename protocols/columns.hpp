// Columns: rows of comma-separated text, and truth formats that are made of them.
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

// `text` without blanks, tabs, CR and LF at both ends.
std::string_view trim(std::string_view text) noexcept;

// `field` trimmed, without the quotes that spreadsheets write around it; blanks within them are trimmed, too.
std::string_view unquoted(std::string_view field) noexcept;

// Cuts the first field off `row`, not trimmed. `row` has no data() when that was the last.
std::string_view take_field(std::string_view& row) noexcept;

// The whole of `field`, blanks around it and one '+' allowed; NaN and infinity too. Empty if it is no number, or one
// that a double or 64 bits do not hold.
std::optional<double> parse_real(std::string_view field) noexcept;
std::optional<std::int64_t> parse_integer(std::string_view field) noexcept;

// Finds columns by name. `Columns` is told which names are wanted; a header row, or a list, says where they are.
class Columns {
 public:
  static constexpr std::size_t max_wanted = 32;
  static constexpr std::size_t max_columns = 256;

  // Names compare as equal if `same` says so: (a name of the header, trimmed; a wanted name). `wanted` outlives this.
  using Same = bool (*)(std::string_view given, std::string_view wanted);
  Columns(std::span<const std::string_view> wanted, Same same);

  // The columns, in order, are these. False, and no column is known, if there are too many.
  bool set(std::string_view header) noexcept;
  bool set(std::span<const std::string> names) noexcept;

  std::string_view name(std::size_t wanted) const noexcept { return wanted_[wanted]; }
  // Whether `count` wanted columns from number `first` are all there.
  bool has(std::size_t first, std::size_t count = 1) const noexcept;

  // Splits a row; its fields are views into it. ok, too_short or too_long.
  TruthResult split(std::string_view row) noexcept;

  // Reads wanted columns from `first` on, which must be present (has()), from the row that was split last. Returns ok
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
  std::array<std::uint8_t, max_columns> wanted_at_ = {};  // per column: the number of the wanted name, or `unwanted`
  std::size_t count_ = 0;
  std::uint32_t present_ = 0;                            // bit set of the wanted names
  std::array<std::string_view, max_wanted + 1> fields_;  // the last one takes what is unwanted
};

// The setting that makes a format of columns readable without its header row.
inline constexpr Setting columns_setting = {
    .key = "columns",
    .help = "names of the columns, for a stream whose header row is missed",
    .initial = std::span<const std::string_view>{},
};

// A truth format whose records are rows, and a header row before them. A byte order mark (UTF-8) before a row is
// ignored.
class ColumnTruthDecoder : public LineTruthDecoder {
 protected:
  enum class Kind : std::uint8_t { state, header, remark };

  ColumnTruthDecoder(std::span<const std::string_view> wanted, Columns::Same same) : columns_(wanted, same) {}
  // For the constructor: the setting `columns`, if it is not empty. Throws std::invalid_argument if these columns are
  // not enough; it names those missing of the first `required` ones, and what is wanted.
  void configure(const Settings& settings, std::size_t required, std::string_view wanted);

  const Columns& columns() const noexcept { return columns_; }

 private:
  TruthResult decode(std::string_view line, Truth& truth) noexcept final;
  // Returns the kind of `row`, which is trimmed and not empty; reduces a header row to its names.
  virtual Kind kind(std::string_view& row) const noexcept = 0;
  // Returns true if the columns present are enough.
  virtual bool enough() const noexcept = 0;
  // Converts the row split last. What is not finite, or not in range, may pass if it stands in `truth`.
  virtual TruthResult convert(Truth& truth) const noexcept = 0;

  Columns columns_;
  bool enough_ = false;
};

}  // namespace imud
