#include "core/numbers/nearest.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

namespace imud {

namespace {

// Returns the optimal string alignment distance: Levenshtein's, in which two exchanged letters are one fault.
std::size_t distance(std::string_view word, std::string_view candidate) {
  std::vector<std::size_t> row(candidate.size() + 1), above, over;
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= word.size(); ++i) {
    over = std::move(above);
    above = row;
    row[0] = i;
    for (std::size_t j = 1; j <= candidate.size(); ++j) {
      const std::size_t substitute = above[j - 1] + (word[i - 1] == candidate[j - 1] ? 0U : 1U);
      row[j] = std::min({above[j] + 1, row[j - 1] + 1, substitute});
      const bool is_exchanged = i > 1 && j > 1 && word[i - 1] == candidate[j - 2] && word[i - 2] == candidate[j - 1];
      if (is_exchanged) row[j] = std::min(row[j], over[j - 2] + 1);
    }
  }
  return row.back();
}

}  // namespace

std::string nearest(std::string_view word, const std::vector<std::string>& words) {
  std::string best;
  std::size_t best_distance = 1 + word.size() / 3;
  for (const std::string& candidate : words) {
    if (!word.empty() && candidate.starts_with(word)) return candidate;
    const std::size_t found = distance(word, candidate);
    if (found <= best_distance) {
      best_distance = found;
      best = candidate;
    }
  }
  if (!best.empty()) return best;
  // A misspelt beginning of a name, such as a key without its unit.
  best_distance = word.size() / 3;
  for (const std::string& candidate : words)
    for (std::size_t end = candidate.find('_'); end != candidate.npos; end = candidate.find('_', end + 1)) {
      const std::size_t found = distance(word, std::string_view(candidate).substr(0, end));
      if (found > best_distance || (found == best_distance && !best.empty())) continue;
      best_distance = found;
      best = candidate;
    }
  return best;
}

}  // namespace imud
