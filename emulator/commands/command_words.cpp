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

std::string unknown_option(const CLI::App& app, std::span<const std::string> arguments) {
  const CLI::App* owner = &app;
  std::string name = "imud";
  for (; !arguments.empty(); arguments = arguments.subspan(1)) {
    const auto commands = owner->get_subcommands({});
    const auto has_name = [&](const CLI::App* one) { return one->get_name() == arguments.front(); };
    const auto command = std::ranges::find_if(commands, has_name);
    if (command == commands.end()) break;
    owner = *command;
    name += " " + owner->get_name();
  }
  for (const std::string& argument : arguments) {
    if (argument == "--") break;
    const std::string option = argument.substr(0, argument.find('='));
    if (option.size() < 2 || option.front() != '-' || owner->get_option_no_throw(option) != nullptr) continue;
    std::vector<std::string> known;
    for (const CLI::Option* one : owner->get_options())
      for (const std::string& text : one->get_lnames()) known.push_back("--" + text);
    return fmt::format("unknown option {}; {}", option,
                       suggestion(option, known, fmt::format("{} --help shows all", name)));
  }
  return {};
}

bool is_topic(const CLI::App& app, std::string_view word) {
  const auto commands = app.get_subcommands({});
  return word != "-h" && word != "--help" &&
         std::ranges::none_of(commands, [&](const CLI::App* command) { return command->get_name() == word; });
}

}  // namespace imud
