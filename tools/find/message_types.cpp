#include "tools/find/message_types.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>

namespace imud {
namespace {

using Places = std::span<const FrameSplit::Place>;
using Stream = std::span<const std::byte>;

constexpr std::size_t last_type_place = 12;  // of a type, in the frame
constexpr std::size_t most_types = 16;
constexpr std::size_t most_typed = 2000;   // frames
constexpr double least_alternating = 0.3;  // of the frames, another type follows
constexpr double least_ordered = 0.85;     // of the frames, the type follows that follows most often
constexpr double least_gain = 0.1;         // of one byte
constexpr double most_damaged = 0.05;      // of the frames, other values

unsigned value_at(Stream stream, const FrameSplit::Place& frame, std::size_t at) {
  return std::to_integer<unsigned>(stream[frame.at + at]);
}

// Returns the values that are types, if the byte at `at` is a type; otherwise an empty list.
std::vector<unsigned> types_at(Places frames, std::size_t at, Stream stream) {
  std::array<std::size_t, 256> counts{};
  for (const FrameSplit::Place& frame : frames) ++counts[value_at(stream, frame, at)];
  std::vector<unsigned> types;
  std::size_t others = 0;
  for (unsigned value = 0; value < counts.size(); ++value)
    if (counts[value] >= std::max(FrameSplit::fewest_frames, frames.size() / 50))
      types.push_back(value);
    else
      others += counts[value];
  const auto all = static_cast<double>(frames.size());
  if (types.size() < 2 || types.size() > most_types || static_cast<double>(others) > most_damaged * all) return {};
  std::map<unsigned, std::map<unsigned, std::size_t>> next;
  double alternating = 0, ordered = 0, pairs = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (!frames[i].is_next) continue;
    const unsigned one = value_at(stream, frames[i - 1], at), other = value_at(stream, frames[i], at);
    ++next[one][other];
    alternating += one != other;
    pairs += 1;
  }
  for (const auto& [type, follows] : next)
    ordered += static_cast<double>(
        std::ranges::max_element(follows, {}, [](const auto& one) { return one.second; })->second);
  return alternating >= least_alternating * pairs && ordered >= least_ordered * pairs ? types
                                                                                      : std::vector<unsigned>{};
}

using Counts = std::array<std::size_t, 256>;

// The number of frames that have the most frequent value of a byte among the frames of their label.
std::size_t alike(Places frames, std::size_t at, std::span<const unsigned> labels, Stream stream) {
  std::map<unsigned, Counts> by_label;
  for (std::size_t i = 0; i < frames.size(); ++i) ++by_label[labels[i]][value_at(stream, frames[i], at)];
  std::size_t sum = 0;
  for (const auto& [label, counts] : by_label) sum += *std::ranges::max_element(counts);
  return sum;
}

// How much more the types tell about the other bytes than the same types in random order: the sum of the shares of
// frames, by bytes. 0 if fewer than two bytes depend on the type, because a single byte may be another counter.
double gain_of(Places frames, std::size_t length, std::size_t type_at, const std::vector<bool>& is_taken,
               Stream stream) {
  std::vector<unsigned> types;
  for (const FrameSplit::Place& frame : frames) types.push_back(value_at(stream, frame, type_at));
  std::vector<unsigned> shuffled = types;
  std::ranges::shuffle(shuffled, std::mt19937(1));
  const auto count = static_cast<double>(frames.size());
  const double large = std::max(least_gain, 2 / std::sqrt(count));
  double sum = 0;
  std::size_t dependent = 0;
  for (std::size_t at = 0; at < length; ++at) {
    if (at == type_at || is_taken[at]) continue;
    const double gain = (static_cast<double>(alike(frames, at, types, stream)) -
                         static_cast<double>(alike(frames, at, shuffled, stream))) /
                        count;
    sum += gain;
    dependent += gain > large;
  }
  return dependent >= 2 ? sum : 0;
}

}  // namespace

std::vector<std::vector<FrameSplit::Place>> divide_by_type(Places frames, std::size_t length,
                                                           const std::vector<bool>& is_taken, Stream stream) {
  const Places compared = frames.first(std::min(frames.size(), most_typed));
  std::size_t best_at = 0;
  // By chance, the sum over 100 random bytes has a standard deviation of less than 3 / sqrt(n).
  constexpr double least = 0.2, sigmas = 5;
  double best = least + sigmas / std::sqrt(static_cast<double>(compared.size()));
  for (std::size_t at = 1; at < std::min(length, last_type_place); ++at) {
    if (is_taken[at] || types_at(compared, at, stream).empty()) continue;
    if (const double gain = gain_of(compared, length, at, is_taken, stream); gain > best) {
      best = gain;
      best_at = at;
    }
  }
  std::vector<std::vector<FrameSplit::Place>> groups;
  if (best_at == 0) {
    groups.emplace_back(frames.begin(), frames.end());
    return groups;
  }
  const std::vector<unsigned> types = types_at(compared, best_at, stream);
  std::map<unsigned, std::size_t> index;
  for (const FrameSplit::Place& frame : frames) {
    const unsigned type = value_at(stream, frame, best_at);
    if (!std::ranges::binary_search(types, type)) continue;  // the frame is damaged
    const auto [known, is_new] = index.try_emplace(type, groups.size());
    if (is_new) groups.emplace_back();
    groups[known->second].push_back(frame);
  }
  return groups;
}

}  // namespace imud
