// program: the beginning and the end of main() that the tools share.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace imud {

// Exit codes; 0 is done, and each tool defines 3.
inline constexpr int failed = 1;
inline constexpr int wrong_command_line = 2;

// Adds an option, whose value is called `unit` in the help.
template <class Value>
CLI::Option* add(CLI::App& app, const std::string& name, Value& value, const std::string& unit,
                 const std::string& help) {
  return app.add_option(name, value, help)->type_name(unit);
}

// Parses the command line. Returns the exit code if the program ends with the command line: 0 after --help or
// --version.
std::optional<int> parse(CLI::App& app, int argc, char** argv);

// Runs the tool; returns the exit code, which is `failed` if all went well, but standard output cannot be written. An
// exception of `execute` is printed; then the exit code is `failed` if it has set `running`, else wrong_command_line.
int run_tool(std::string_view name, int (*execute)(int argc, char** argv, bool& running), int argc, char** argv);

}  // namespace imud
