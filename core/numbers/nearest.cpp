#include "core/numbers/nearest.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace imud {

std::string nearest(std::string_view word, const std::vector<std::string>& words) {
  std::string best;
  std::size_t best_distance = 1 + word.size() / 3;
  for (const std::string& candidate : words) {
    if (!word.empty() && candidate.starts_with(word)) return candidate;
    std::vector<std::size_t> row(candidate.size() + 1);  // Levenshtein
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= word.size(); ++i) {
      std::size_t diagonal = row[0];
      row[0] = i;
      for (std::size_t j = 1; j <= candidate.size(); ++j) {
        const std::size_t substitute = diagonal + (word[i - 1] == candidate[j - 1] ? 0U : 1U);
        diagonal = row[j];
        row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
      }
    }
    if (row.back() <= best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

}  // namespace imud
