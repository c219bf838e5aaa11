// nearest: the word that a misspelt one probably means.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace imud {

// Returns the word of `words` that is nearest to `word` by Levenshtein distance, in which two exchanged letters count
// once. If no word is near, returns the first word whose beginning, up to a '_', is nearest, such as bias_deg_per_s
// for "bais". Returns an empty string if no beginning is near either.
std::string nearest(std::string_view word, const std::vector<std::string>& words);

}  // namespace imud
