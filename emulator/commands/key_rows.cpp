#include "emulator/commands/key_rows.hpp"

#include <algorithm>
#include <boost/algorithm/string/erase.hpp>
#include <boost/algorithm/string/replace.hpp>
#include <boost/algorithm/string/trim.hpp>
#include <regex>
#include <sstream>

namespace imud {
namespace {

// Returns the cells of a row of a table. A | in code or after \ does not separate cells.
std::vector<std::string> cells_of(const std::string& row) {
  std::vector<std::string> cells(1);
  bool is_code = false;
  for (std::size_t i = 1; i < row.size(); ++i) {
    if (row[i] == '`') is_code = !is_code;
    if (row[i] == '|' && !is_code && row[i - 1] != '\\')
      cells.emplace_back();
    else
      cells.back() += row[i];
  }
  if (boost::trim_copy(cells.back()).empty()) cells.pop_back();
  for (std::string& cell : cells) {
    boost::trim(cell);
    boost::replace_all(cell, "\\|", "|");
  }
  return cells;
}

// Returns the parts of a text that are marked as code: `a`, `b`.
std::vector<std::string> in_code(const std::string& text) {
  static const std::regex code("`([^`]+)`");
  std::vector<std::string> all;
  for (std::sregex_iterator i(text.begin(), text.end(), code), end; i != end; ++i) all.push_back((*i)[1]);
  return all;
}

// Returns a text without the marks of Markdown.
std::string plain(std::string text) {
  static const std::regex link(R"(\[([^\]\[]*)\]\([^)]*\))");
  text = std::regex_replace(text, link, "$1");
  boost::erase_all(text, "`");
  return text;
}

// The tables and the protocol that the headings above a row name, such as "imu.gyro.".
struct Place {
  std::vector<std::string> tables;
  std::string protocol;
};

// Updates the place by the next heading.
void enter(Place& place, const std::string& heading) {
  const std::vector<std::string> names = in_code(heading);
  place.protocol.clear();
  if (heading.starts_with("### ") && !names.empty()) {
    place.protocol = names.front();
    return;
  }
  if (!heading.starts_with("## ")) return;
  place.tables.clear();
  if (heading == "## The file") place.tables = {""};
  if (heading == "## Keys") place.tables = {"fault."};
  if (heading == "## What is expected of the flight computer") place.tables = {"expect."};
  for (std::string name : names) {
    boost::erase_all(name, "[");
    boost::erase_all(name, "]");
    place.tables.push_back(name + ".");
  }
}

// Returns the full names of the keys in a row's first cell. A key that begins with the name of a sensor belongs to
// the table of this sensor.
std::vector<std::string> keys_of(const std::string& cell, const Place& place) {
  static const std::regex key("[a-z_0-9.A-Z]+");
  std::vector<std::string> all;
  for (const std::string& name : in_code(cell)) {
    if (!std::regex_match(name, key)) continue;
    const auto of_sensor = [&](const std::string& table) {
      return name.find('.') != name.npos && table == "imu." + name.substr(0, name.find('.')) + ".";
    };
    if (std::ranges::any_of(place.tables, of_sensor) || place.tables.front().starts_with("imu.gyro."))
      all.push_back("imu." + name);
    else
      for (const std::string& table : place.tables) all.push_back(table + name);
  }
  return all;
}

void read_page(std::string_view text, std::vector<KeyRow>& rows) {
  std::istringstream lines{std::string(text)};
  Place place;
  std::vector<std::string> titles;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) enter(place, line);
    if (!line.starts_with('|')) {
      titles.clear();
      continue;
    }
    const std::vector<std::string> cells = cells_of(line);
    if (titles.empty()) {
      titles = cells;
      continue;
    }
    if (titles.front() != "key" || place.tables.empty()) continue;
    KeyRow row{keys_of(cells.front(), place), place.protocol, {}};
    for (std::size_t i = 1; i < std::min(cells.size(), titles.size()); ++i)
      row.cells.emplace_back(titles[i], plain(cells[i]));
    if (!row.keys.empty()) rows.push_back(std::move(row));
  }
}

}  // namespace

std::vector<KeyRow> key_rows() {
  std::vector<KeyRow> rows;
  for (const ReferencePage& page : reference_pages()) read_page(page.text, rows);
  return rows;
}

std::string without_imu(const std::string& key, const std::vector<KeyRow>& rows) {
  constexpr std::string_view imu = "imu.";
  if (!key.starts_with(imu)) return key;
  const auto begins = [&](const std::string& part) {
    return std::ranges::any_of(rows, [&](const KeyRow& row) {
      return std::ranges::any_of(row.keys,
                                 [&](const std::string& one) { return one == part || one.starts_with(part + "."); });
    });
  };
  const std::size_t end = key.find('.', imu.size());
  if (end == key.npos || begins(key.substr(0, end))) return key;
  return "imu" + key.substr(end);
}

}  // namespace imud
