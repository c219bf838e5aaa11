// MappedColumns: rows of text whose columns are quantities of truth.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "protocols/quantities/line_truth_decoder.hpp"
#include "protocols/quantities/truth_map.hpp"

namespace imud {

// Columns are separated by commas, semicolons or tabs; in a row without these characters, by blanks. A byte order
// mark (UTF-8) before a row is ignored, and so are quotes around a field. A row that begins with '#' is a remark,
// unless the text after the '#' is a header row. A later header row replaces the former. decode() allocates
// nothing. One thread.
class MappedColumns {
 public:
  static constexpr std::size_t max_columns = 256;

  // A header row names the columns by quantities with their units. Columns with other names are not used.
  explicit MappedColumns(const TruthAssembly::Axes& axes) : axes_(axes) {}
  // A header row names the columns by the simulator's names. If all names are numbers, the columns have these
  // numbers, from 0 on, no row is a header row, and a row may have further columns. Throws
  // std::invalid_argument, "columns: ...", also if two quantities have the same column.
  MappedColumns(TruthMap map, const TruthAssembly::Axes& axes);

  // Returns whether `line` is a header row, which may follow a '#'.
  bool is_header(std::string_view line) const noexcept;
  // Decodes a row; returns as TruthDecoder::next() does.
  TruthResult decode(std::string_view line, Truth& truth) noexcept;
  // Returns TruthDecoder::frame(): the frame of the map.
  TruthFrame frame() const noexcept { return map_.empty() ? TruthFrame{} : assembly_.frame(); }
  // Writes a remark on the last row, as TruthDecoder::describe() does.
  void describe(TruthResult result, RemarkWriter& out) const noexcept;
  // Restarts, as TruthAssembly::begin() does. The columns remain.
  void begin() noexcept { assembly_.begin(); }

 private:
  enum class Kind : std::uint8_t { state, header, remark };

  // Where a field of a row is stored.
  struct Column {
    bool is_used = false;
    TruthField field;
  };

  bool names_columns(std::string_view row, bool is_remark) const noexcept;
  std::optional<TruthField> find(std::string_view name) const noexcept;
  bool set_columns(std::string_view header) noexcept;
  TruthResult read(std::string_view row) noexcept;
  void describe_unknown(RemarkWriter& out) const noexcept;
  void describe_header(RemarkWriter& out) const noexcept;

  TruthMap map_;  // empty: the header row has names of quantities
  TruthAssembly::Axes axes_;
  bool is_by_number_ = false;
  std::array<Column, max_columns> columns_ = {};
  std::size_t count_ = 0;  // of the columns; 0: the columns are not known
  char delimiter_ = ',';
  TruthReading reading_;
  TruthAssembly assembly_;

  // Members of the last row.
  Kind kind_ = Kind::remark;
  std::string_view row_, bad_field_;
  std::size_t bad_column_ = 0;
  std::array<char, 400> fault_ = {};  // of the last header row
  std::size_t fault_size_ = 0;
};

// A truth format whose records are rows for MappedColumns.
class MappedColumnDecoder : public LineTruthDecoder {
 public:
  explicit MappedColumnDecoder(MappedColumns columns) : columns_(std::move(columns)) {}

  TruthFrame frame() const noexcept override { return columns_.frame(); }
  std::size_t describe(TruthResult result, std::span<char> room) const noexcept override;
  void finish() noexcept override;

 private:
  TruthResult decode(std::string_view line, Truth& truth) noexcept override;

  MappedColumns columns_;
};

}  // namespace imud
