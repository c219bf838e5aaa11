// Fields of comma-separated values.
#pragma once

#include <string>
#include <string_view>

namespace imud {

// Appends `text` as a CSV field, in quotes where RFC 4180 requires quotes.
inline void append_csv_field(std::string& row, std::string_view text) {
  if (text.find_first_of(",\"\r\n") == text.npos) {
    row += text;
    return;
  }
  row += '"';
  for (const char c : text) row.append(c == '"' ? 2 : 1, c);
  row += '"';
}

// Returns `text` as a CSV field, quoted as by append_csv_field().
inline std::string csv_field(std::string_view text) {
  std::string field;
  append_csv_field(field, text);
  return field;
}

}  // namespace imud
