// Epoch: the clock from whose zero the instants of the samples count.
#pragma once

#include <array>

#include "core/time.hpp"
#include "emulator/ground/words.hpp"

namespace imud {

// none: the instants count from the beginning of the run.
using Epoch = SharedClock;
inline constexpr auto epoch_words = std::to_array<Word<Epoch>>(
    {{Epoch::none, "none"}, {Epoch::tai, "tai"}, {Epoch::utc, "utc"}, {Epoch::monotonic, "monotonic"}});

}  // namespace imud
