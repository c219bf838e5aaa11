// `imud help TOPIC`: explains a configuration key, or finds keys, options, commands and names by a word.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace imud {

// Prints the rows of the reference if `topic` is a key, or the entry if it is a name that `imud list` shows;
// otherwise all keys, options, commands and names that contain the word. Requires a `topic` that is no command.
// Returns the exit code: 2 if nothing is found; then prints the nearest names.
int help_topic(const CLI::App& app, const std::string& topic);

}  // namespace imud
