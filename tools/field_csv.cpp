#include "tools/field_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <span>

#include "protocols/wire/csv_field.hpp"
#include "protocols/wire/shortest_text.hpp"

namespace imud {
namespace {

void append(std::string& row, const FieldValue& value) {
  row += ',';
  if (value.kind == FieldValue::Kind::integer) {
    fmt::format_to(std::back_inserter(row), "{}{}", value.is_negative ? "-" : "", value.magnitude);
  } else if (value.kind == FieldValue::Kind::real) {
    char text[longest_shortest_text];
    const char* const end =
        value.digits == all_digits ? write_shortest(text, value.real) : write_rounded(text, value.real, value.digits);
    row.append(text, static_cast<std::size_t>(end - text));
  }
}

}  // namespace

FieldCsv::FieldCsv(const FrameStreamDecoder& decoder, TextOutput& out) : decoder_(decoder), out_(out) {
  const std::span<const FrameKind> kinds = decoder.frame_kinds();
  std::string header = "message,offset";
  std::size_t columns = 0, longest = 0;
  for (const FrameKind& kind : kinds) {
    kinds_.push_back({csv_field(kind.name), kind.fields.size(), columns});
    columns += kind.fields.size();
    longest = std::max(longest, kind.fields.size());
    for (const std::string& field : kind.fields) header += "," + csv_field(kind.name + "." + field);
  }
  for (Kind& kind : kinds_) kind.after = columns - kind.before - kind.fields;
  values_.resize(longest);
  out_.write(header + "\n");
}

void FieldCsv::write(const DecodedFrame& frame) {
  Kind& kind = kinds_[frame.kind];
  const std::span<FieldValue> values = std::span(values_).first(kind.fields);
  std::ranges::fill(values, FieldValue());
  decoder_.read_fields(frame, values);
  row_ = kind.name;
  fmt::format_to(std::back_inserter(row_), ",{}", frame.offset);
  row_.append(kind.before, ',');
  for (const FieldValue& value : values) append(row_, value);
  row_.append(kind.after, ',');
  row_ += '\n';
  out_.write(row_);
  ++kind.rows;
  ++rows_;
}

std::string FieldCsv::counts_text() const {
  std::string text;
  for (const Kind& kind : kinds_)
    fmt::format_to(std::back_inserter(text), "{}{} {}", text.empty() ? "" : ", ", kind.rows, kind.name);
  return text;
}

}  // namespace imud
