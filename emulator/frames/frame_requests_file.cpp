// Reads the settings and requests of a description.
#include <fmt/format.h>

#include <limits>
#include <optional>
#include <string>

#include "emulator/frames/frame_tables.hpp"

namespace imud {
namespace {

using Host = FrameHostDescription;

// Returns the value as text; a number, which may be the rate inf, in its shortest form.
std::optional<std::string> value_text(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* integer = node.as_integer()) return fmt::to_string(integer->get());
  const auto* real = node.as_floating_point();
  if (real == nullptr || !(real->get() > -std::numeric_limits<double>::infinity())) return std::nullopt;
  return fmt::to_string(real->get());
}

std::uint32_t line_of(const toml::node& node, std::uint32_t fallback) {
  const std::uint32_t line = node.source().begin.line;
  return line != 0 ? line : fallback;
}

void read_values(TableReader& table, std::string_view key, const toml::node* node, Host::Setting& setting) {
  const toml::array* list = node != nullptr ? node->as_array() : nullptr;
  if (list == nullptr || list->empty() || list->size() > Host::most_values)
    return table.fault(
        key, fmt::format("give 1 to {} allowed values, the delivered one first: [100, 50, 10]", Host::most_values));
  setting.is_number = list->front().is_number();
  for (const toml::node& one : *list) {
    const auto text = value_text(one);
    if (!text || one.is_number() != setting.is_number)
      return table.fault(key, "give values that are all texts, or all numbers");
    setting.values.push_back(*text);
  }
}

// Reads the bounds of a setting whose value is any integer between them.
void read_range(TableReader& table, Host::Setting& setting) {
  setting.is_number = setting.is_range = true;
  for (const char* key : {"values", "codes"})
    if (table.node(key) != nullptr)
      table.fault(key, "give either this, or min and max, between which a whole number is its own code");
  const auto bound = [&](const char* key, std::int64_t fallback, std::int64_t low, std::int64_t high) {
    const toml::node* node = table.node(key);
    if (node == nullptr) return fallback;
    const auto number = node->is_integer() ? node->value<std::int64_t>() : std::nullopt;
    if (number && *number >= low && *number <= high) return *number;
    table.fault(key, fmt::format("give a whole number from {} to {}", low, high));
    return fallback;
  };
  for (const char* key : {"min", "max"}) require(table, key, "the other bound of the allowed whole numbers");
  setting.lowest = bound("min", 0, -Host::largest_value, Host::largest_value);
  setting.highest = bound("max", setting.lowest, setting.lowest, Host::largest_value);
  setting.delivered = static_cast<std::uint64_t>(bound("delivered", setting.lowest, setting.lowest, setting.highest) -
                                                 setting.lowest);
}

Host::Setting read_setting(TableReader& table, const std::string& name, const toml::node& node, Faults& faults,
                           toml::table& resolved) {
  Host::Setting setting;
  setting.name = name;
  setting.line = node.source().begin.line;
  const toml::table* described = node.as_table();
  if (described == nullptr) {
    read_values(table, name, &node, setting);
    return setting;
  }
  TableReader reader(described, fmt::format("setting.{}.", name), setting.line, faults, resolved);
  if (reader.has("min") || reader.has("max")) {
    read_range(reader, setting);
    setting.is_kept = reader.flag("kept", false);
    reader.finish();
    return setting;
  }
  require(reader, "values", "the allowed values, as [100, 50, 10], or min and max");
  if (reader.has("values")) read_values(reader, "values", reader.node("values"), setting);
  if (const toml::node* delivered = reader.node("delivered")) {
    const auto text = value_text(*delivered);
    const auto found = text ? std::find(setting.values.begin(), setting.values.end(), *text) : setting.values.end();
    if (found == setting.values.end())
      reader.fault("delivered", "must be one of the values");
    else
      setting.delivered = static_cast<std::size_t>(found - setting.values.begin());
  }
  if (const toml::node* node_of_codes = reader.node("codes")) {
    const toml::array* list = node_of_codes->as_array();
    if (list == nullptr || list->size() != setting.values.size())
      reader.fault("codes", "give a list of whole numbers, one for each value, in their order");
    else
      for (const toml::node& one : *list) {
        const auto code = one.is_integer() ? one.value<std::int64_t>() : std::nullopt;
        if (!code || *code < 0) {
          reader.fault("codes", "give whole numbers that are not negative");
          setting.codes.clear();
          break;
        }
        setting.codes.push_back(static_cast<std::uint64_t>(*code));
      }
  }
  setting.is_kept = reader.flag("kept", false);
  reader.finish();
  return setting;
}

void read_settings_of_host(TableReader& root, Faults& faults, toml::table& resolved, Host& host) {
  const toml::node* node = root.node("setting");
  if (node == nullptr) return;
  const toml::table* settings = node->as_table();
  if (settings == nullptr || settings->size() > Host::most_settings)
    return root.fault("setting", fmt::format("give settings as [setting] NAME = [allowed values], at most {}",
                                             Host::most_settings));
  TableReader reader = root.child("setting");
  for (const auto& [key, value] : *settings)
    host.settings.push_back(read_setting(reader, std::string(key.str()), value, faults, resolved));
}

// Reads {NAME = VALUE, NAME = [VALUE, VALUE]}; a list only if `may_list`.
std::vector<Host::Choice> choices_in(TableReader& table, std::string_view key, const toml::node& node,
                                     bool may_list) {
  std::vector<Host::Choice> choices;
  const toml::table* values = node.as_table();
  if (values == nullptr || values->empty()) {
    table.fault(key, "give settings with their values, as {NAME = VALUE}");
    return choices;
  }
  for (const auto& [name, value] : *values) {
    Host::Choice choice{std::string(name.str()), {}, line_of(value, node.source().begin.line)};
    const toml::array* list = value.as_array();
    if (list != nullptr && may_list && list->size() <= Host::most_values) {
      for (const toml::node& one : *list)
        if (auto text = value_text(one)) choice.values.push_back(std::move(*text));
    } else if (auto text = value_text(value)) {
      choice.values.push_back(std::move(*text));
    }
    if (choice.values.empty())
      table.fault(key, fmt::format("{}: give a value{}", choice.setting, may_list ? ", or a list of values" : ""));
    else
      choices.push_back(std::move(choice));
  }
  return choices;
}

std::vector<Host::Choice> read_choices(TableReader& table, std::string_view key, bool may_list) {
  return choices_in(table, key, *table.node(key), may_list);
}

std::vector<Host::Text> read_elements(TableReader& table, std::string_view key, const toml::node& node) {
  std::vector<Host::Text> elements;
  const toml::array* list = node.as_array();
  if (list == nullptr || list->empty() || list->size() > FrameDescription::most_elements ||
      !list->is_homogeneous(toml::node_type::string)) {
    table.fault(key, fmt::format("give a list of 1 to {} elements, such as [\"AA 55\", \"{{3}}\"]",
                                 FrameDescription::most_elements));
    return elements;
  }
  for (const toml::node& one : *list)
    elements.push_back({one.value_or(std::string()), line_of(one, node.source().begin.line)});
  return elements;
}

// In the answer to a line of text, a text stands for itself; in other answers it is one element.
Host::Answer read_answer(TableReader& table, std::string_view key, bool is_line) {
  Host::Answer answer;
  const toml::node* node = table.node(key);
  if (node == nullptr) return answer;
  if (!node->is_string())
    answer.layout = read_elements(table, key, *node);
  else if (const Host::Text text{table.text(key, ""), node->source().begin.line}; is_line)
    answer.text = text;
  else
    answer.layout.push_back(text);
  return answer;
}

// Reads a text, or a list of texts.
std::vector<std::string> read_texts(TableReader& table, std::string_view key) {
  const toml::node* node = table.node(key);
  if (node == nullptr) return {};
  if (node->is_string()) return {node->value_or(std::string())};
  std::vector<std::string> texts;
  const toml::array* list = node->as_array();
  if (list == nullptr || list->empty() || list->size() > Host::most_tests ||
      !list->is_homogeneous(toml::node_type::string))
    table.fault(key, fmt::format("give a text, or a list of 1 to {} texts", Host::most_tests));
  else
    for (const toml::node& one : *list) texts.push_back(one.value_or(std::string()));
  return texts;
}

std::vector<Host::Test> read_tests(TableReader& table, std::uint32_t line) {
  std::vector<Host::Test> tests;
  const std::vector<std::string> requests = read_texts(table, "test_request"),
                                 answers = read_texts(table, "test_answer");
  if (!answers.empty() && answers.size() != requests.size())
    table.fault("test_answer", fmt::format("there are {} answers to {} requests; give one to each, empty if "
                                           "the unit does not answer",
                                           answers.size(), requests.size()));
  else
    for (std::size_t i = 0; i < requests.size(); ++i)
      tests.push_back({requests[i], answers.empty() ? "" : answers[i], line_of(*table.node("test_request"), line)});
  return tests;
}

// Reads the lists of elements that {items} stands for.
void read_items(TableReader& table, Host::Request& request) {
  const toml::node* node = table.node("items");
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list == nullptr || list->empty() || list->size() > Host::most_items ||
      !list->is_homogeneous(toml::node_type::array))
    return table.fault("items", fmt::format("give 1 to {} lists of elements, such as [[\"1C\", \"{{RATE}}:u32\"]]",
                                            Host::most_items));
  if (!table.has("layout")) table.fault("items", "only a layout has the element {items}");
  for (const toml::node& one : *list) request.items.push_back(read_elements(table, "items", one));
}

void read_request(TableReader table, std::uint32_t line, std::vector<Host::Request>& into) {
  Host::Request request;
  request.line = line;
  const int forms = static_cast<int>(table.has("line")) + static_cast<int>(table.has("bytes")) +
                    static_cast<int>(table.has("layout"));
  if (forms != 1) table.fault("line", "give one of line, bytes and layout: how the request looks");
  const bool is_line = table.has("line");
  if (is_line) request.text = {table.text("line", ""), line_of(*table.node("line"), line)};
  if (table.has("bytes")) request.layout = {{table.text("bytes", ""), line_of(*table.node("bytes"), line)}};
  if (table.has("layout")) request.layout = read_elements(table, "layout", *table.node("layout"));
  read_items(table, request);
  request.ignores_case = table.flag("ignore_case", false);
  if (request.ignores_case && !is_line) table.fault("ignore_case", "only a line has letters");
  if (table.has("when")) request.when = read_choices(table, "when", true);
  if (table.has("stream")) request.streams = table.flag("stream", false);
  if (table.has("set")) {
    if (table.node("set")->is_table())
      request.set = read_choices(table, "set", false);
    else
      request.sets_captured = table.flag("set", false);
  }
  request.saves = table.flag("save", false);
  request.restores = table.flag("restore", false);
  request.resets = table.flag("reset", false);
  request.answer = read_answer(table, "answer", is_line);
  request.otherwise = read_answer(table, "otherwise", is_line);
  request.poll = table.text("poll", "");
  request.delay_ms = static_cast<std::uint32_t>(table.unsigned_integer("delay_ms", 0, Host::longest_delay));
  request.tests = read_tests(table, line);
  add_for_each(table, std::move(request), into);
  table.finish();
}

Host::Unknown read_unknown(TableReader table) {
  Host::Unknown unknown;
  if (table.has("layout")) unknown.layout = read_elements(table, "layout", *table.node("layout"));
  require(table, "answer", "the answer to a line that no request matches, or, with a layout, to bytes of that form");
  if (const toml::node* answer = table.node("answer")) unknown.line = answer->source().begin.line;
  unknown.answer = read_answer(table, "answer", !table.has("layout"));
  if (!table.has("layout") && !unknown.answer.layout.empty())
    table.fault("layout", "missing; give the form of the bytes that are answered, or a text as the answer to lines");
  if (table.has("layout")) unknown.tests = read_tests(table, unknown.line);
  table.finish();
  return unknown;
}

}  // namespace

std::vector<const toml::table*> tables_of(TableReader& table, std::string_view key, std::size_t most) {
  const toml::node* node = table.node(key);
  if (node == nullptr) return {};
  const toml::array* array = node->as_array();
  std::vector<const toml::table*> tables;
  if (array == nullptr || !array->is_array_of_tables())
    table.fault(key, fmt::format("give tables, each as [[{}]]", key));
  else if (array->size() > most)
    table.fault(key, fmt::format("there are more than {}", most));
  else
    for (const toml::node& one : *array) tables.push_back(one.as_table());
  return tables;
}

void read_host(TableReader& root, Faults& faults, toml::table& resolved, FrameHostDescription& host) {
  read_settings_of_host(root, faults, resolved, host);
  std::size_t number = 0;
  for (const toml::table* one : tables_of(root, "request", Host::most_requests)) {
    const std::uint32_t line = one->source().begin.line;
    read_request(TableReader(one, fmt::format("request.{}.", number++), line, faults, resolved), line, host.requests);
  }
  const toml::node* unknown = root.node("unknown");
  if (unknown == nullptr) return;
  if (unknown->is_table()) return host.unknown.push_back(read_unknown(root.child("unknown")));
  number = 0;
  for (const toml::table* one : tables_of(root, "unknown", Host::most_unknown))
    host.unknown.push_back(read_unknown(
        TableReader(one, fmt::format("unknown.{}.", number++), one->source().begin.line, faults, resolved)));
}

std::vector<std::vector<FrameHostDescription::Choice>> read_test_settings(TableReader& message, std::size_t frames) {
  std::vector<std::vector<Host::Choice>> all(frames);
  const toml::node* node = message.node("test_settings");
  if (node == nullptr) return all;
  const toml::array* list = node->as_array();
  if (list != nullptr && list->size() != frames) {
    message.fault("test_settings", fmt::format("give a table for each test_frame; there are {} tables for {} frames",
                                               list->size(), frames));
    return all;
  }
  for (std::size_t i = 0; i < frames; ++i)
    all[i] = choices_in(message, "test_settings", list != nullptr ? *list->get(i) : *node, false);
  return all;
}

void read_switch(TableReader& message, FrameDescription::Message& into) {
  if (message.has("when")) into.when = read_choices(message, "when", true);
  into.is_streamed = !message.flag("polled", false);
  if (is_text(message, "rate_hz")) into.rate_setting = message.text("rate_hz", "");
}

}  // namespace imud
