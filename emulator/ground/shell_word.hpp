// A text as a word of a command line, for commands that are shown to people or given to a shell.
#pragma once

#include <string>
#include <string_view>

namespace imud {

// Returns a text as one word of a POSIX shell, whatever it contains: in quotes where it needs them.
inline std::string shell_word(std::string_view text) {
  constexpr std::string_view plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./:,=+@%";
  if (!text.empty() && text.find_first_not_of(plain) == text.npos) return std::string(text);
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string_view("'\\''") : std::string_view(&c, 1);
  return word + "'";
}

// Returns the path of a file as one word. A path such as -a.toml would be an option: ./-a.toml is the same file.
inline std::string path_word(std::string_view path) {
  return shell_word(path.size() > 1 && path.front() == '-' ? "./" + std::string(path) : std::string(path));
}

}  // namespace imud
