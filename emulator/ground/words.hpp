// Words: the words of an enumeration's values in a configuration, a table of pairs.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace imud {

template <class Enum>
struct Word {
  Enum value;
  std::string_view word;
};

// Returns the word of a value; empty if the table lacks it.
template <class Enum, std::size_t n>
constexpr std::string_view word_of(const std::array<Word<Enum>, n>& words, Enum value) noexcept {
  for (const Word<Enum>& one : words)
    if (one.value == value) return one.word;
  return {};
}

// Returns the words at the numbers of their values, which are 0 to n - 1; otherwise it does not compile.
template <class Enum, std::size_t n>
consteval std::array<std::string_view, n> words_by_number(const std::array<Word<Enum>, n>& words) {
  std::array<std::string_view, n> all;
  for (const Word<Enum>& one : words) all.at(static_cast<std::size_t>(one.value)) = one.word;
  for (const std::string_view word : all)
    if (word.empty()) throw "a value has no word";
  return all;
}

}  // namespace imud
