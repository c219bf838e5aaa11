// Epoch: the clock from whose zero the instants of the samples count.
#pragma once

#include <array>
#include <cstdint>

#include "emulator/ground/words.hpp"

namespace imud {

// CLOCK_TAI, CLOCK_REALTIME, CLOCK_MONOTONIC; none: the instants count from the beginning of the run.
enum class Epoch : std::uint8_t { none, tai, utc, monotonic };
inline constexpr auto epoch_words = std::to_array<Word<Epoch>>(
    {{Epoch::none, "none"}, {Epoch::tai, "tai"}, {Epoch::utc, "utc"}, {Epoch::monotonic, "monotonic"}});

}  // namespace imud
