// nearest: the word that a misspelt one probably means.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace imud {

// Returns the word of `words` that is nearest to `word` by Levenshtein distance, in which two exchanged letters count
// once. If none is near: the first whose beginning, up to a '_', is nearest, such as bias_deg_per_s for "bais". Empty
// if none of these is near either.
std::string nearest(std::string_view word, const std::vector<std::string>& words);

}  // namespace imud
