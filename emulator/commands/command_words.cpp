#include "emulator/commands/command_words.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "emulator/ground/table_reader.hpp"

namespace imud {

std::vector<std::string> command_words(int argc, const char* const* argv) {
  std::vector<std::string> all(argv + 1, argv + argc);
  if (all.empty() || all.front() != "help") return all;
  all.erase(all.begin());
  all.emplace_back("--help");
  return all;
}

std::string unknown_command(const CLI::App& app, std::span<const std::string> arguments) {
  const auto all = app.get_subcommands({});
  if (all.empty() || arguments.empty() || arguments.front().starts_with('-')) return {};
  const std::string& given = arguments.front();
  std::vector<std::string> commands;
  for (const CLI::App* command : all) {
    if (command->get_name() == given) return unknown_command(*command, arguments.subspan(1));
    commands.push_back(command->get_name());
  }
  return fmt::format("unknown command \"{}\"; {}", given,
                     suggestion(given, commands, fmt::format("there are {}", fmt::join(commands, ", "))));
}

bool is_topic(const CLI::App& app, std::string_view word) {
  const auto commands = app.get_subcommands({});
  return word != "-h" && word != "--help" &&
         std::ranges::none_of(commands, [&](const CLI::App* command) { return command->get_name() == word; });
}

}  // namespace imud
