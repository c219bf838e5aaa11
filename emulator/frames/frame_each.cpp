// Reads the rows of `each`, for which a request is repeated.
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "emulator/frames/frame_tables.hpp"

namespace imud {
namespace {

using Host = FrameHostDescription;

// Returns the text with the words of a row in place of $1, $2 and so on. Sets `highest` to a higher number that the
// text has.
std::string with_words(std::string_view text, const std::vector<std::string>& row, std::size_t& highest) {
  std::string made;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char digit = text[i] == '$' && i + 1 < text.size() ? text[i + 1] : '\0';
    if (digit < '1' || digit > '9') {
      made += text[i];
      continue;
    }
    ++i;
    const auto number = static_cast<std::size_t>(digit - '0');
    if (number <= row.size()) made += row[number - 1];
    highest = std::max(highest, number);
  }
  return made;
}

template <class Replace>
void replace_texts(Host::Request& request, Replace replace) {
  const auto in_elements = [&](std::vector<Host::Text>& elements) {
    for (Host::Text& one : elements) replace(one.text);
  };
  const auto in_answer = [&](Host::Answer& answer) {
    if (answer.text) replace(answer.text->text);
    in_elements(answer.layout);
  };
  if (request.text) replace(request.text->text);
  in_elements(request.layout);
  for (std::vector<Host::Text>& item : request.items) in_elements(item);
  for (std::vector<Host::Choice>* choices : {&request.when, &request.set})
    for (Host::Choice& choice : *choices) {
      replace(choice.setting);
      for (std::string& value : choice.values) replace(value);
    }
  in_answer(request.answer);
  in_answer(request.otherwise);
  replace(request.poll);
}

// Reads the rows of `each`, all with the same number of words.
std::vector<std::vector<std::string>> read_rows(TableReader& table, const toml::node& node) {
  std::vector<std::vector<std::string>> rows;
  const toml::array* list = node.as_array();
  if (list != nullptr && list->size() <= Host::most_requests)
    for (const toml::node& one : *list) {
      const toml::array* words = one.as_array();
      if (words == nullptr || words->empty() || words->size() > 9 ||
          !words->is_homogeneous(toml::node_type::string)) {
        rows.clear();
        break;
      }
      rows.emplace_back();
      for (const toml::node& word : *words) rows.back().push_back(word.value_or(std::string()));
    }
  if (rows.empty() || std::ranges::any_of(rows, [&](const auto& row) { return row.size() != rows[0].size(); })) {
    table.fault("each",
                fmt::format("give 1 to {} rows of words, such as [[\"00\", \"RATE\"], [\"01\", \"MASK\"]]; all rows "
                            "have equally many words, at most 9",
                            Host::most_requests));
    rows.clear();
  }
  return rows;
}

}  // namespace

void add_for_each(TableReader& table, Host::Request request, std::vector<Host::Request>& into) {
  const toml::node* node = table.node("each");
  if (node == nullptr) return into.push_back(std::move(request));
  std::vector<Host::Test> tests = std::move(request.tests);
  request.tests.clear();
  std::size_t highest = 0;
  for (const std::vector<std::string>& row : read_rows(table, *node)) {
    into.push_back(request);
    into.back().tests = std::exchange(tests, {});
    replace_texts(into.back(), [&](std::string& text) { text = with_words(text, row, highest); });
    if (highest <= row.size()) continue;
    table.fault("each", fmt::format("a row has {} words; there is no ${}", row.size(), highest));
    return;
  }
}

}  // namespace imud
