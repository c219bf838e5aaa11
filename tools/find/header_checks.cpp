#include "tools/find/header_checks.hpp"

#include <algorithm>

namespace imud {
namespace {

constexpr std::size_t longest_head = 16, shortest_head = 3;  // bytes
// A match by chance in any head is less probable: two bytes that depend on each other must not look like a check.
constexpr double most_chance_log2 = -32;
constexpr double least_agreeing = 0.97;

// A sum over a single varying byte is a copy of this byte, or another counter.
bool is_copy(const FoundCheck& check, const CheckSearch& search) {
  if (check.forms.front().name.starts_with("crc")) return false;
  std::size_t varying = 0;
  for (const auto& [begin, end] : check.ranges_of(check.forms.front()))
    for (std::size_t at = begin; at < end; ++at) varying += !search.is_constant(at);
  return varying < 2;
}

}  // namespace

std::vector<FoundCheck> find_header_checks(const FoundMessage& message, std::span<const std::byte> stream) {
  std::vector<FoundCheck> found;
  const auto overlaps = [](const FoundCheck& one, const FoundCheck& other) {
    return one.at < other.at + other.size && other.at < one.at + one.size;
  };
  const auto is_apart = [&](const FoundCheck& check) {
    const auto apart = [&](const FoundCheck& other) { return !overlaps(check, other); };
    return std::ranges::all_of(message.checks, apart) && std::ranges::all_of(found, apart);
  };
  // A head ends with the check, or with the bytes that the check covers.
  for (std::size_t head = shortest_head; head <= std::min(longest_head, message.length); ++head) {
    std::vector<CheckSearch::Window> windows;
    for (const FrameSplit::Place& frame : message.frames) windows.push_back(stream.subspan(frame.at, head));
    const CheckSearch search(std::move(windows), head);
    for (const auto place : {CheckSearch::Place::behind_range, CheckSearch::Place::before_range})
      for (FoundCheck& check : search.find(place, head - 1)) {
        const FoundCheck::Form& form = check.forms.front();
        const bool is_certain =
            check.chance_log2 < most_chance_log2 &&
            static_cast<double>(check.agreeing) >= least_agreeing * static_cast<double>(check.compared);
        if (is_certain && check.size <= 2 && !form.own && form.extra.empty() && is_apart(check) &&
            !is_copy(check, search))
          found.push_back(std::move(check));
      }
  }
  return found;
}

}  // namespace imud
