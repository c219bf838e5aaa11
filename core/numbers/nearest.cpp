#include "core/numbers/nearest.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

namespace imud {

std::string nearest(std::string_view word, const std::vector<std::string>& words) {
  std::string best;
  std::size_t best_distance = 1 + word.size() / 3;
  for (const std::string& candidate : words) {
    if (!word.empty() && candidate.starts_with(word)) return candidate;
    // Optimal string alignment: Levenshtein's distance, in which two exchanged letters are one fault.
    std::vector<std::size_t> row(candidate.size() + 1), above, over;
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= word.size(); ++i) {
      over = std::move(above);
      above = row;
      row[0] = i;
      for (std::size_t j = 1; j <= candidate.size(); ++j) {
        const std::size_t substitute = above[j - 1] + (word[i - 1] == candidate[j - 1] ? 0U : 1U);
        row[j] = std::min({above[j] + 1, row[j - 1] + 1, substitute});
        const bool is_exchanged =
            i > 1 && j > 1 && word[i - 1] == candidate[j - 2] && word[i - 2] == candidate[j - 1];
        if (is_exchanged) row[j] = std::min(row[j], over[j - 2] + 1);
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
