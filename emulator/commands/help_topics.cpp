#include "emulator/commands/help_topics.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <boost/algorithm/string/case_conv.hpp>
#include <boost/algorithm/string/predicate.hpp>
#include <boost/algorithm/string/split.hpp>
#include <string_view>
#include <vector>

#include "emulator/commands/key_rows.hpp"
#include "emulator/commands/list.hpp"
#include "emulator/config/config_parts.hpp"
#include "emulator/config/presets.hpp"
#include "emulator/faults/fault_kinds.hpp"
#include "emulator/frames/described_protocols.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/init/simulators.hpp"

namespace imud {
namespace {

// A name that can be found, and the words about it that are searched as well.
struct Found {
  std::string name, words;
};

bool has(const Found& found, const std::string& topic) {
  return boost::icontains(found.name, topic) || boost::icontains(found.words, topic);
}

// Returns the beginning of a text, up to the end of a word.
std::string beginning(const std::string& text) {
  constexpr std::size_t most = 100;
  if (text.size() <= most) return text;
  return text.substr(0, text.rfind(' ', most)) + " ...";
}

// Prints the entries of `all` that contain the topic, under a title. Returns the number of these entries.
std::size_t print_found(std::string_view title, const std::vector<Found>& all, const std::string& topic) {
  std::size_t count = 0;
  for (const Found& found : all) {
    if (!has(found, topic)) continue;
    if (count++ == 0) fmt::print("{}\n", title);
    fmt::print("  {:<36} {}\n", found.name, beginning(found.words));
  }
  return count;
}

// Adds the commands below `app`, whose own name is `name`, and their options.
void add_commands(const CLI::App& app, const std::string& name, std::vector<Found>& commands,
                  std::vector<Found>& options) {
  for (const CLI::App* command : app.get_subcommands({})) {
    const std::string whole = name + " " + command->get_name();
    commands.push_back({whole, command->get_description()});
    for (const CLI::Option* option : command->get_options())
      options.push_back({whole + " " + option->get_name(), option->get_description()});
    add_commands(*command, whole, commands, options);
  }
}

template <class Entry>
void add_all(std::vector<Found>& all, std::span<const Entry* const> entries) {
  for (const Entry* entry : entries) all.push_back({std::string(entry->name), std::string(entry->summary)});
}

// Returns the names that `imud list` shows.
std::vector<Found> listed_names() {
  std::vector<Found> all;
  add_all(all, protocols());
  for (const DescribedTitle& title : described_titles())
    all.push_back({std::string(title.name), std::string(title.summary)});
  add_all(all, truth_formats());
  add_all(all, transports());
  for (const auto some : {presets(), field_presets()})
    for (const Preset& preset : some) all.push_back({std::string(preset.name), std::string(preset.summary())});
  return all;
}

std::vector<Found> fault_kind_names() {
  std::vector<Found> all;
  for (const FaultKind* kind : fault_kinds()) {
    const auto same = [&](const Found& found) { return found.name == kind->name; };
    if (std::ranges::none_of(all, same)) all.push_back({std::string(kind->name), std::string(kind->summary)});
  }
  return all;
}

std::vector<Found> simulator_names() {
  std::vector<Found> all;
  for (const Simulator& simulator : simulators())
    all.push_back({std::string(simulator.name), std::string(simulator.summary())});
  return all;
}

// Returns true if the key is the topic, or ends with it after a dot.
bool is_key(const std::string& key, const std::string& topic) { return key == topic || key.ends_with("." + topic); }

void print_row(const KeyRow& row, const std::string& topic) {
  const auto key = std::ranges::find_if(row.keys, [&](const std::string& one) { return is_key(one, topic); });
  fmt::print("{}{}\n", *key, row.protocol.empty() ? "" : fmt::format(" of {}", row.protocol));
  for (const auto& [title, text] : row.cells) fmt::print("  {:<9} {}\n", title, text);
  std::vector<std::string> others;
  for (const std::string& one : row.keys)
    if (one != *key) others.push_back(one);
  if (!others.empty()) fmt::print("  {:<9} {}\n", "also", fmt::join(others, ", "));
}

}  // namespace

int help_topic(const CLI::App& app, const std::string& topic) {
  const std::vector<KeyRow> rows = key_rows();
  const std::string key = without_imu(topic, rows);
  bool is_found = false;
  for (const KeyRow& row : rows)
    if (std::ranges::any_of(row.keys, [&](const std::string& one) { return is_key(one, key); })) {
      print_row(row, key);
      is_found = true;
    }
  if (is_found) return 0;
  const std::vector<Found> names = listed_names();
  if (std::ranges::any_of(names, [&](const Found& found) { return found.name == topic; })) return list(topic, false);

  std::vector<Found> keys;
  for (const KeyRow& row : rows)
    keys.push_back({row.keys.front() + (row.protocol.empty() ? "" : " of " + row.protocol),
                    row.cells.empty() ? "" : row.cells.back().second});
  // A sensor's key that is not the first key of its row is found by its own name.
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (const std::string& one : rows[i].keys)
      if (!has(keys[i], key) && boost::icontains(one, key)) keys[i].name = one;
  std::size_t count = print_found("keys, of which imud help KEY explains one", keys, key);
  std::vector<Found> commands, options;
  add_commands(app, "imud", commands, options);
  count += print_found("commands", commands, topic);
  count += print_found("options", options, topic);
  count += print_found("names that imud list explains", names, topic);
  count += print_found("simulators, for imud init", simulator_names(), topic);
  count += print_found("kinds of faults, for [[fault]]: imud list faults", fault_kind_names(), topic);
  if (count > 0) return 0;

  std::vector<std::string> known;
  for (const KeyRow& row : rows)
    for (const std::string& one : row.keys) {
      known.push_back(one);
      std::vector<std::string> parts;  // the name of a table is also a topic
      boost::split(parts, one, [](char c) { return c == '.'; });
      known.insert(known.end(), parts.begin(), parts.end());
    }
  for (const std::vector<Found>& some : {names, simulator_names(), fault_kind_names()})
    for (const Found& found : some) known.push_back(found.name);
  for (const CLI::App* command : app.get_subcommands({})) known.push_back(command->get_name());
  fmt::print(stderr, "imud: there is no command, key, option or name with \"{}\"; {}\n", topic,
             suggestion(key, known, "see imud --help and imud list"));
  return 2;
}

}  // namespace imud
