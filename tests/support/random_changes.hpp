// Random changes of a text, for fuzz tests.
#pragma once

#include <cstddef>
#include <random>
#include <span>
#include <string>
#include <string_view>

namespace imud {

// Changes a text that is not empty at a random place: replaces a character, removes up to `most_removed`, repeats a
// character or a part of the text, cuts the text off, or inserts one of `pieces`, of which there is at least one.
template <class Random>
void change_randomly(std::string& text, std::size_t most_removed, std::span<const std::string_view> pieces,
                     Random& random) {
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  const std::size_t at = below(text.size());
  switch (below(6)) {
    case 0:
      text[at] = static_cast<char>(random());
      break;
    case 1:
      text.erase(at, 1 + below(most_removed));
      break;
    case 2:
      text.insert(at, 1 + below(300), static_cast<char>(random()));
      break;
    case 3:
      text.insert(below(text.size()), text.substr(at, below(200)));
      break;
    case 4:
      text.resize(at);
      break;
    default:
      text.insert(at, pieces[below(pieces.size())]);
      break;
  }
}

}  // namespace imud
