#include "emulator/frames/frame_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <utility>
#include <vector>

#include "core/time.hpp"
#include "emulator/frames/frame_tables.hpp"
#include "emulator/ground/table_reader.hpp"
#include "emulator/plan/config.hpp"
#include "protocols/frames/frame_device.hpp"
#include "protocols/frames/frame_look_alikes.hpp"
#include "protocols/frames/layout/frame_layout.hpp"

namespace imud {
namespace {

constexpr std::size_t largest_file = 1 << 20;  // bytes

std::vector<std::string> one(std::string fault) { return {std::move(fault)}; }

std::string content_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text(largest_file + 1, '\0');
  if (file) file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!file && !file.eof())
    throw ConfigError(one(fmt::format("{}: {}; give the path of a description", path, std::strerror(errno))));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > largest_file)
    throw ConfigError(one(fmt::format("{}: has more than {} bytes; a description is shorter", path, largest_file)));
  return text;
}

bool is_big(TableReader& table, bool fallback) {
  return table.choice<bool>("byte_order", {{false, "little"}, {true, "big"}}, fallback);
}

UartSettings read_line(TableReader table, std::string& baud_setting) {
  UartSettings uart;
  if (is_text(table, "baud"))
    baud_setting = table.text("baud", "");
  else
    uart.baud = static_cast<unsigned>(table.unsigned_integer("baud", 0, 20'000'000));
  uart.parity = table.choice<Parity>("parity", {{Parity::none, "none"}, {Parity::even, "even"}, {Parity::odd, "odd"}},
                                     Parity::none);
  uart.stop_bits = static_cast<unsigned>(table.unsigned_integer("stop_bits", 1, 2));
  if (uart.stop_bits == 0) table.fault("stop_bits", "give 1 or 2");
  for (const char* key : {"parity", "stop_bits"})
    if (table.has(key) && uart.baud == 0 && baud_setting.empty())
      table.fault(key, "give baud, too; device.baud of a configuration may give another one");
  table.finish();
  return uart;
}

FrameDescription::Start read_start(TableReader table) {
  constexpr double longest_s = 600;
  FrameDescription::Start start;
  start.silent = nanoseconds(table.real("silent_s", 0, 0, longest_s));
  start.until = nanoseconds(table.real("until_s", 0, 0, longest_s));
  start.pattern = static_cast<std::byte>(table.unsigned_integer("pattern", 0, 255));
  if (start.until.count() != 0 && start.until <= start.silent)
    table.fault("until_s", "give more than silent_s, during which nothing is sent");
  if (start.pattern != std::byte{0} && start.until.count() == 0)
    table.fault("pattern", "give until_s, up to which the pattern is sent");
  table.finish();
  return start;
}

FrameDescription::Check read_check(TableReader table, const std::string& name) {
  FrameDescription::Check check{name, {}};
  CrcParameters& crc = check.parameters;
  require(table, "width", "the bits of the CRC");
  require(table, "poly", "the polynomial without its highest bit, such as 0x1021");
  crc.width = static_cast<unsigned>(table.unsigned_integer("width", 16, 64));
  if (crc.width == 0 || crc.width % 8 != 0) {
    table.fault("width", "give 8, 16, 24, 32, 40, 48, 56 or 64 bits");
    crc.width = 64;
  }
  const std::uint64_t most = low_bits(crc.width);
  crc.poly = table.unsigned_integer("poly", 0, most);
  crc.init = table.unsigned_integer("init", 0, most);
  crc.xorout = table.unsigned_integer("xorout", 0, most);
  crc.refin = table.flag("refin", false);
  crc.refout = table.flag("refout", crc.refin);
  table.finish();
  return check;
}

void read_checks(TableReader& table, FrameDescription& description) {
  const toml::node* node = table.node("check");
  if (node == nullptr) return;
  const toml::table* checks = node->as_table();
  if (checks == nullptr || checks->size() > FrameDescription::most_checks)
    return table.fault("check",
                       fmt::format("describe a CRC as [check.NAME], at most {}", FrameDescription::most_checks));
  TableReader reader = table.child("check");
  for (const auto& [key, value] : *checks) {
    const std::string name(key.str());
    constexpr std::string_view separators = ":,+. \t@\"";
    if (name.find_first_of(separators) != name.npos || FrameCheck::find(name, {}))
      reader.fault(name, "give another name: letters, digits and underscores, and no check that is known");
    else if (!value.is_table())
      reader.fault(name, fmt::format("describe the CRC as [check.{}]", name));
    else
      description.checks.push_back(read_check(reader.child(name), name));
  }
}

void read_layout(TableReader& table, std::uint32_t line, FrameDescription::Message& message) {
  if (table.has("text")) {
    if (table.has("layout")) table.fault("text", "give either this, for a line of text, or layout");
    message.text = {table.text("text", ""), table.node("text")->source().begin.line};
    if (message.text->text.size() > FrameDescription::longest_text)
      table.fault("text", fmt::format("has more than {} characters", FrameDescription::longest_text));
    return;
  }
  require(table, "layout", "the list of the elements, in the order of their bytes, or text, a line of text");
  const toml::node* node = table.node("layout");
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list == nullptr || list->empty() || !list->is_homogeneous(toml::node_type::string))
    return table.fault("layout", "give a list of texts, such as [\"AA 55\", \"rate_x_deg_per_s:f32\"]");
  if (list->size() > FrameDescription::most_elements)
    return table.fault("layout", fmt::format("has more than {} elements", FrameDescription::most_elements));
  for (const toml::node& one : *list) {
    const std::uint32_t at = one.source().begin.line;
    message.layout.push_back({one.value_or(std::string()), at != 0 ? at : line});
  }
}

// Returns the nodes of a list, or the node itself if it is none.
std::vector<const toml::node*> nodes_of(TableReader& table, std::string_view key) {
  const toml::node* node = table.node(key);
  if (node == nullptr) return {};
  const toml::array* list = node->as_array();
  if (list == nullptr) return {node};
  std::vector<const toml::node*> nodes;
  for (const toml::node& one : *list) nodes.push_back(&one);
  return nodes;
}

// Reads the values of a test frame.
std::vector<FrameDescription::Value> read_values(TableReader& table, const toml::node& node) {
  std::vector<FrameDescription::Value> all;
  const toml::table* values = node.as_table();
  if (values == nullptr)
    table.fault("test_values", "give a table of quantities, such as {rate_x_deg_per_s = 10}, or one for each frame");
  else
    for (const auto& [key, value] : *values) {
      const auto number = value.is_number() ? value.value<double>() : std::nullopt;
      if (number && std::isfinite(*number))
        all.push_back({std::string(key.str()), *number, value.source().begin.line});
      else
        table.fault("test_values", fmt::format("{}: give a finite number", key.str()));
    }
  return all;
}

void read_tests(TableReader& table, FrameDescription::Message& message) {
  const auto frames = nodes_of(table, "test_frame"), values = nodes_of(table, "test_values");
  if (frames.size() > FrameDescription::most_tests)
    return table.fault("test_frame", fmt::format("give at most {}", FrameDescription::most_tests));
  if (frames.empty() && !values.empty())
    return table.fault("test_values", "give the test_frame that has these values");
  if (!values.empty() && values.size() != frames.size())
    return table.fault("test_values",
                       fmt::format("give a table for each test_frame; there are {} tables for {} frames",
                                   values.size(), frames.size()));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto text = frames[i]->value<std::string>();
    if (!frames[i]->is_string())
      table.fault("test_frame", "give the frame as a text, or a list of frames");
    else
      message.tests.push_back({{*text, frames[i]->source().begin.line}, {}});
    if (!values.empty() && !message.tests.empty()) message.tests.back().values = read_values(table, *values[i]);
  }
  const auto settings = read_test_settings(table, frames.size());
  for (std::size_t i = 0; i < message.tests.size() && message.tests.size() == settings.size(); ++i)
    message.tests[i].settings = settings[i];
}

// Reads a number, or a list of numbers.
void read_phases(TableReader& table, FrameDescription::Message& message) {
  const toml::node* node = table.node("phase");
  const toml::array* list = node == nullptr ? nullptr : node->as_array();
  if (list == nullptr) {
    message.phases = {table.unsigned_integer("phase", 0, FrameDescription::most_samples)};
    return;
  }
  std::vector<std::uint64_t> phases;
  for (const toml::node& one : *list) {
    const auto phase = one.value<std::int64_t>();
    if (one.is_integer() && *phase >= 0) phases.push_back(static_cast<std::uint64_t>(*phase));
  }
  std::ranges::sort(phases);
  if (phases.size() != list->size() || phases.empty() || phases.size() > FrameDescription::most_phases ||
      std::ranges::adjacent_find(phases) != phases.end())
    return table.fault("phase", fmt::format("give a number, or 1 to {} different numbers, such as [0, 1, 2]",
                                            FrameDescription::most_phases));
  message.phases = phases;
}

FrameDescription::Message read_message(TableReader table, std::uint32_t line, bool big, std::size_t number) {
  FrameDescription::Message message;
  message.line = line;
  message.name = table.text("name", fmt::format("{}", number + 1));
  message.is_big = is_big(table, big);
  read_switch(table, message);
  if (message.rate_setting.empty()) message.rate_hz = table.real("rate_hz", 0, 0, Grid::max_rate_hz);
  if (message.rate_hz > 0 && message.rate_hz < 1e-3) table.fault("rate_hz", "give at least 0.001");
  message.divider = table.unsigned_integer("divider", 1, FrameDescription::most_samples);
  read_phases(table, message);
  if (message.divider == 0) table.fault("divider", "give 1 for every sample, 2 for every second one");
  if (table.has("rate_hz") && (table.has("divider") || table.has("phase")))
    table.fault("rate_hz", "give either this, or divider and phase");
  if (message.divider != 0 && message.phases.back() >= message.divider)
    table.fault("phase", "must be less than divider: it is the number of the first sample that is sent");
  read_layout(table, line, message);
  read_tests(table, message);
  table.finish();
  return message;
}

void read_root(TableReader& table, Faults& faults, toml::table& resolved, FrameDescription& description) {
  require(table, "frame_version", "1, the version of the language");
  if (table.has("frame_version") && table.unsigned_integer("frame_version", 1, 1'000'000) != 1)
    table.fault("frame_version", "this imud reads version 1");
  require(table, "name", "the name of the product");
  description.name = table.text("name", "");
  description.document = table.text("document", "");
  description.model = table.text("model", "");
  if (is_path_of_frames(description.model))
    table.fault("model", "give the name of a preset, one that imud list shows");
  description.rate_hz = table.real("rate_hz", 0, 0, Grid::max_rate_hz);
  if (table.has("rate_hz") && description.rate_hz < Grid::min_rate_hz)
    table.fault("rate_hz", fmt::format("give {} to {}", Grid::min_rate_hz, Grid::max_rate_hz));
  const bool big = is_big(table, false);
  description.escape = static_cast<FrameEscape>(table.choice("escape", escape_names, 0));
  description.uart = read_line(table.child("line"), description.baud_setting);
  description.start = read_start(table.child("start"));
  description.host.is_big = big;
  read_host(table, faults, resolved, description.host);
  read_checks(table, description);
  require(table, "message", "at least one [[message]]");
  for (const toml::table* one : tables_of(table, "message", FrameDescription::most_messages)) {
    const std::size_t number = description.messages.size();
    const std::uint32_t line = one->source().begin.line;
    description.messages.push_back(read_message(
        TableReader(one, fmt::format("message.{}.", number), line, faults, resolved), line, big, number));
    const FrameDescription::Message& message = description.messages.back();
    if (description.rate_hz > 0 && message.rate_hz > description.rate_hz)
      table.fault("rate_hz", fmt::format("message \"{}\" is sent at {} Hz, and no more often than there are samples; "
                                         "give at least that",
                                         message.name, message.rate_hz));
  }
  table.finish();
}

}  // namespace

std::shared_ptr<const FrameDescription> frames_of_text(std::string_view text, const std::string& file) {
  Faults faults(file);
  toml::table root, resolved;
  auto description = std::make_shared<FrameDescription>();
  description->file = file;
  try {
    root = toml::parse(text);
  } catch (const toml::parse_error& error) {
    faults.add(error.source().begin.line, "TOML", error.description());
    throw ConfigError(faults.all());
  }
  TableReader table(&root, "", 1, faults, resolved);
  read_root(table, faults, resolved, *description);
  const auto attempt = [&](auto act) {
    try {
      act();
    } catch (const FrameFaults& error) {
      for (const FrameFault& fault : error.faults) faults.add(fault.line, fault.where, fault.what);
    }
  };
  if (faults.all().empty()) {
    attempt([&] { refuse_look_alikes(frame_messages(*description), description->escape, description->file); });
    attempt([&] { test_frame_requests(*description); });
  }
  if (!faults.all().empty()) throw ConfigError(faults.all());
  return description;
}

std::shared_ptr<const FrameDescription> read_frames(const std::string& name) {
  if (is_path_of_frames(name)) return frames_of_text(content_of(name), name);
  std::vector<std::string> words;
  for (const ShippedFrames& shipped : shipped_frames()) {
    if (shipped.name == name) return frames_of_text(shipped.text, name);
    words.emplace_back(shipped.name);
  }
  throw ConfigError(one(fmt::format("no description \"{}\" is shipped; {}; a file is given as \"./{}.toml\"", name,
                                    suggestion(name, words), name)));
}

void attach_frames(Settings& settings, std::span<const Setting> declared) {
  for (const Setting& setting : declared) {
    if (!setting.names_frames || settings.text(setting.key).empty() || settings.frames() != nullptr) continue;
    try {
      settings.attach(read_frames(settings.text(setting.key)));
    } catch (const ConfigError&) {
      settings.set(setting.key, std::string());
      throw;
    }
  }
}

}  // namespace imud
