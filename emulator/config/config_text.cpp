#include "emulator/config/config_text.hpp"

#include <fmt/format.h>
#include <sha256.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "emulator/config/recorded_config.hpp"
#include "emulator/ground/text_file.hpp"
#include "emulator/plan/config.hpp"

namespace imud {

std::string sha256(const std::string& bytes) {
  std::array<char, SHA256_DIGEST_STRING_LENGTH> text;
  SHA256Data(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), text.data());
  return text.data();
}

namespace {

// Returns true for a file that has a zero byte near its begin, as captures and compressed files have, and no text.
bool is_data(const std::string& path) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none)) return false;  // the begin of a pipe cannot be read twice
  std::array<char, 4096> first{};
  std::ifstream file(path, std::ios::binary);
  file.read(first.data(), first.size());
  return std::ranges::count(std::span(first).first(static_cast<std::size_t>(file.gcount())), '\0') > 0;
}

// Returns the file's content, or the configuration in a record. Throws std::system_error, or std::invalid_argument
// if the file is no text, or a record without a configuration.
std::string read_file(const std::string& path) {
  if (auto config = recorded_config(path)) {
    if (config->empty()) throw std::invalid_argument("is not in this record; give that of its run");
    return *std::move(config);
  }
  if (path == "-") return {std::istreambuf_iterator<char>(std::cin), {}};
  if (is_data(path))
    throw std::invalid_argument(
        "this is no text in UTF-8, but data such as a capture; give the configuration first: imud replay imu.toml "
        "flight.pcap");
  return read_whole(path);
}

// Returns the fault if there is a word without quotes at line and column, where TOML requires a value; otherwise
// an empty text.
std::string bare_word(std::string_view content, std::uint32_t line, std::uint32_t column) {
  for (; line > 1 && !content.empty(); --line)
    content.remove_prefix(std::min(content.find('\n'), content.size() - 1) + 1);
  content = content.substr(0, content.find_first_of("\r\n"));
  constexpr std::string_view blanks = " \t", before = "=[,{", ends = "=[,{]}# \t";
  const std::size_t last = content.substr(0, column - 1).find_last_of(ends);
  const std::size_t begin = last == content.npos ? 0 : last + 1;
  const std::string_view word = content.substr(begin, content.find_first_of(",]}# \t", begin) - begin);
  const std::size_t previous = content.substr(0, begin).find_last_not_of(blanks);
  if (word.empty() || previous == content.npos || before.find(content[previous]) == before.npos) return {};
  if (content.find('=') > previous) return {};  // [table]
  if (word.find_first_of("\"'") != word.npos || std::string_view("+-.0123456789").find(word.front()) != word.npos)
    return {};
  return fmt::format("column {}: {} is not a value of TOML; put text in quotes: \"{}\"", begin + 1, word, word);
}

// Replaces a line by blanks. Returns false if the line is blank already or does not exist.
bool clear_line(std::string& content, std::uint32_t line) {
  std::size_t begin = 0;
  for (; line > 1 && begin < content.size(); --line)
    begin = std::min(content.find('\n', begin), content.size() - 1) + 1;
  const std::size_t end = std::min(content.find('\n', begin), content.size());
  const bool had_text = content.find_first_not_of(" \t\r", begin) < end;
  if (had_text)
    std::fill(content.begin() + static_cast<std::ptrdiff_t>(begin),
              content.begin() + static_cast<std::ptrdiff_t>(end), ' ');
  return had_text;
}

// Returns words for people for the error of a text without a closing quote in its line; empty for another error.
std::string open_text(const std::string& content, const toml::parse_error& error) {
  const auto& [line, column] = error.source().begin;
  std::size_t begin = 0;
  for (toml::source_index i = 1; i < line && begin < content.size(); ++i)
    begin = std::min(content.find('\n', begin), content.size() - 1) + 1;
  const std::string text = content.substr(begin, std::min(content.find('\n', begin), content.size()) - begin);
  const bool is_at_end = column > text.size() || text[column - 1] == '\r';
  if (error.description().find("string") == std::string_view::npos || !is_at_end) return {};
  return fmt::format("a text is not closed: a quotation mark is missing before the end of the line: {}", text);
}

// Adds a fault for each error of syntax. After an error the text is read again without the line of the error,
// because this line may cause later errors. Ends at an error in a line without text, such as a missing bracket at
// the end.
void add_syntax_faults(std::string content, Faults& faults) {
  constexpr int most = 20;
  std::uint32_t first = 0;
  for (int i = 0; i < most; ++i) {
    try {
      static_cast<void>(toml::parse(content));
      return;
    } catch (const toml::parse_error& error) {
      const auto& [line, column] = error.source().begin;
      const std::string word = bare_word(content, line, column);
      std::string what = word.empty() ? open_text(content, error) : word;
      if (what.empty()) what = fmt::format("column {}: {}", column, error.description());
      if (error.description().find("is not representable in 64 bits") != std::string_view::npos)
        what += "; a seed above 9223372036854775807 is given in quotes";
      const bool has_text = clear_line(content, line);
      if (i > 0 && !has_text) return;
      if (i > 0) what += fmt::format(" (it may follow from line {})", first);
      faults.add(line, "TOML", what);
      if (i == 0) first = line;
    }
  }
}

// The items of an array that the first step of a path selects, and the rest of the path.
struct Chosen {
  std::vector<toml::node*> items;
  std::string_view below;
};

// Selects items by number, by name, or all items by *. A name may contain dots: of several names that fit, the
// longest is meant.
Chosen choose(toml::array& array, std::string_view path) {
  const std::size_t dot = path.find('.');
  Chosen chosen{{}, dot == path.npos ? std::string_view() : path.substr(dot + 1)};
  std::size_t longest = 0;
  for (std::size_t i = 0; i < array.size(); ++i)
    if (const std::string_view step = path.substr(0, dot); step == "*" || step == std::to_string(i)) {
      chosen.items.push_back(&array[i]);
      longest = step.size();
    }
  for (std::size_t i = 0; i < array.size(); ++i) {
    const toml::table* table = array[i].as_table();
    if (table == nullptr) continue;
    const std::string name = (*table)["name"].value_or(fmt::format("imu{}", i + 1));
    if (name.size() <= longest || !path.starts_with(name + ".")) continue;
    longest = name.size();
    chosen = {{&array[i]}, path.substr(name.size() + 1)};
  }
  return chosen;
}

// A value of the command line, and the text that gives it.
struct GivenValue {
  const toml::node& value;
  const std::string& text;
};

// Sets the key that `path` names below `at`. Returns the fault; empty if the key was set.
std::string set_key(toml::node& at, std::string_view path, const GivenValue& given, Faults& faults) {
  if (auto* array = at.as_array()) {
    const Chosen chosen = choose(*array, path);
    if (chosen.items.empty())
      return fmt::format("\"{}\" is not an index below {}, a name or *", path.substr(0, path.find('.')),
                         array->size());
    if (chosen.below.empty()) return fmt::format("give a key below \"{}\"", path);
    for (toml::node* item : chosen.items)
      if (std::string fault = set_key(*item, chosen.below, given, faults); !fault.empty()) return fault;
    return {};
  }
  const std::size_t dot = path.find('.');
  const std::string step(path.substr(0, dot));
  auto* table = at.as_table();
  if (table == nullptr) return fmt::format("\"{}\" is below a plain value", step);
  if (dot == path.npos) {
    table->insert_or_assign(step, given.value);
    faults.add_given_text(table->get(step), given.text);
    return {};
  }
  if (!table->contains(step)) table->insert(step, toml::table{});
  return set_key(*table->get(step), path.substr(dot + 1), given, faults);
}

void override_key(toml::table& root, const std::string& assignment, Faults& faults) {
  const auto fault = [&](std::string_view what) { faults.add(0, fmt::format("--set {}", assignment), what); };
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) return fault("give KEY=VALUE, for example imu.0.rate_hz=400");
  const std::string value = assignment.substr(equals + 1);
  toml::table parsed;
  try {
    parsed = toml::parse("v = " + value);
  } catch (const toml::parse_error&) {
    try {  // a bare word; JSON's strings are strings of TOML
      parsed = toml::parse("v = " + nlohmann::json(value).dump());
    } catch (const std::exception&) {
      return fault("give text in UTF-8, without control characters");
    }
  }
  const std::string what = set_key(root, assignment.substr(0, equals), {*parsed.get("v"), value}, faults);
  if (!what.empty()) fault(what);
}

// Removes empty tables.
void prune(toml::node& node) {
  if (auto* array = node.as_array())
    for (toml::node& item : *array) prune(item);
  auto* table = node.as_table();
  if (table == nullptr) return;
  for (auto&& [key, value] : *table) prune(value);
  for (auto item = table->begin(); item != table->end();) {
    const toml::table* child = item->second.as_table();
    item = child != nullptr && child->empty() ? table->erase(item) : std::next(item);
  }
}

}  // namespace

ConfigText read_config_text(const std::string& path, std::span<const std::string> overrides, Faults& faults) {
  ConfigText text;
  std::string content;
  try {
    content = read_file(path);
    text.root = toml::parse(content, path);
  } catch (const std::system_error& error) {
    faults.add(0, "cannot be read", error.code().message());
    throw ConfigError(faults.all());
  } catch (const std::invalid_argument& error) {
    faults.add(0, "configuration", error.what());
    throw ConfigError(faults.all());
  } catch (const toml::parse_error&) {
    add_syntax_faults(content, faults);
    throw ConfigError(faults.all());
  }
  if (const toml::node* version = text.root.get("frame_version")) {
    faults.add(version->source().begin.line, "frame_version",
               "this file describes the frames of a sensor; give it as device.frame_file of an [[imu]] with "
               "protocol = \"frame\"");
    throw ConfigError(faults.all());
  }
  for (const std::string& assignment : overrides) {
    override_key(text.root, assignment, faults);
    content += assignment + "\n";
  }
  text.sha256 = sha256(content);
  return text;
}

std::string toml_text(toml::table table) {
  prune(table);
  std::ostringstream text;
  text << toml::toml_formatter(table,
                               toml::toml_formatter::default_flags &
                                   ~(toml::format_flags::indentation | toml::format_flags::allow_literal_strings))
       << '\n';
  return text.str();
}

}  // namespace imud
