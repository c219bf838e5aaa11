// `imud help TOPIC`: explains a configuration key, or finds keys, options, commands and names by a word.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace imud {

// Prints the rows of the reference for a key, the entry of a name that `imud list` shows, or else all keys,
// options, commands and names that contain the word. Requires a `topic` that is no command. Returns the exit code:
// 2 if there is nothing, with the nearest names.
int help_topic(const CLI::App& app, const std::string& topic);

}  // namespace imud
