#include "emulator/campaign/cases/test_metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace imud {

namespace {

using Metrics = nlohmann::ordered_json;

constexpr const char* right_text = "write a JSON object, such as {\"error_deg\": 0.1}";

std::string place_of(std::string_view text, std::size_t at) {
  const std::string_view before = text.substr(0, std::min(at, text.size()));
  const auto line = 1 + std::ranges::count(before, '\n');
  const std::size_t begin = before.rfind('\n') + 1;  // npos + 1 is 0
  return fmt::format("line {}, column {}", line, before.size() - begin + 1);
}

// Returns the number or the word without quotes that has a character at `at`; empty if there is none.
std::string_view word_at(std::string_view text, std::size_t at) {
  constexpr std::string_view letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+-._";
  if (at >= text.size() || letters.find(text[at]) == letters.npos) return {};
  const std::size_t before = text.find_last_not_of(letters, at), begin = before == text.npos ? 0 : before + 1;
  return text.substr(begin, text.find_first_not_of(letters, at) - begin);
}

bool is_no_finite_number(std::string_view word) {
  std::string name;
  for (const char c : word)
    if (c != '-' && c != '+') name += static_cast<char>(c | 0x20);  // small letters
  return name.starts_with("nan") || name.starts_with("inf");
}

std::string fault_at(std::string_view text, std::size_t at, const std::string& what) {
  const std::string_view word = word_at(text, at);
  const std::string place = place_of(text, word.empty() ? at : static_cast<std::size_t>(word.data() - text.data()));
  if (is_no_finite_number(word))
    return fmt::format("{}: `{}` is no value of JSON; write null, or leave it out", place, word);
  // "[json.exception.parse_error.101] parse error at line 1, column 2: CAUSE; last read: ...".
  const std::size_t begin = what.find(": ", what.find("column "));
  std::string cause = begin == what.npos ? what : what.substr(begin + 2);
  const std::size_t last_read = cause.find("; last read"), expected = cause.rfind("; expected");
  if (last_read != cause.npos)
    cause = cause.substr(0, last_read) +
            (expected != cause.npos && expected > last_read ? cause.substr(expected) : std::string());
  return fmt::format("{}: {}; {}", place, cause, right_text);
}

}  // namespace

Metrics read_metrics(const std::string& text, std::string& fault) {
  try {
    Metrics metrics = Metrics::parse(text);
    if (metrics.is_object()) return metrics;
    fault = fmt::format("line 1: is a JSON {}; {}", metrics.type_name(), right_text);
  } catch (const Metrics::parse_error& error) {
    fault = fault_at(text, error.byte > 0 ? error.byte - 1 : 0, error.what());
  } catch (const Metrics::out_of_range& error) {  // a number beyond a double: "number overflow parsing '1e999'"
    const std::string what = error.what();
    const std::size_t begin = what.find('\'') + 1;
    const std::string number = what.substr(begin, what.rfind('\'') - begin);
    fault = fmt::format("{}: `{}` is beyond the range of a double; write null, or leave it out",
                        place_of(text, text.find(number)), number);
  }
  return {};
}

}  // namespace imud
