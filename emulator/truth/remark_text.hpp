// The texts of remarks about truth.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "emulator/ground/counters.hpp"

namespace imud {

// Writes a remark; cuts it off at the end of `room`. Returns the length.
template <class... Values>
std::size_t write_remark(std::span<char> room, fmt::format_string<Values...> format, Values&&... values) noexcept {
  const auto result = fmt::format_to_n(room.data(), room.size(), format, std::forward<Values>(values)...);
  return std::min(result.size, room.size());
}

// Returns the remarks of a run, and the first refusal of each cause.
std::vector<std::string> remarks(const TruthCounters& truth);

}  // namespace imud
