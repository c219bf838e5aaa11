// The words of a command line before CLI11 parses them.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace CLI {
class App;
}

namespace imud {

// Returns the arguments after the program's name; `help COMMAND` becomes `COMMAND --help`.
std::vector<std::string> command_words(int argc, const char* const* argv);

// Returns the fault that the first argument is neither an option nor a command of `app`. If the argument is a command
// with subcommands, the next argument is checked in the same way. Returns an empty text if there is no fault.
std::string unknown_command(const CLI::App& app, std::span<const std::string> arguments);

// Returns the fault of the first option in `arguments` that their command does not have; empty if there is none.
std::string unknown_option(const CLI::App& app, std::span<const std::string> arguments);

// Returns true if the word after `help` is neither a command nor a request for help itself.
bool is_topic(const CLI::App& app, std::string_view word);

}  // namespace imud
