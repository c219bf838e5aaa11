// nearest: the word that a misspelt one probably means.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace imud {

// Returns the word of `words` that is nearest to `word` by Levenshtein distance, in which two exchanged letters count
// once; empty if none is near.
std::string nearest(std::string_view word, const std::vector<std::string>& words);

}  // namespace imud
