#include "tools/find/frame_split.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <numeric>
#include <optional>

namespace imud {
namespace {

using Stream = std::span<const std::byte>;

constexpr std::size_t searched = 64 * 1024;  // bytes, for lengths
constexpr std::size_t most_lengths = 64;
constexpr std::size_t seldom = 50;  // fewer frames than this share of the most frequent ones occur by chance
constexpr std::size_t most_splits = 24;
constexpr std::size_t most_rules = 4;  // rules of the same lengths that are compared on the whole stream
// The share of the anchors of a length that another anchor follows; below 1, because frames may be damaged.
constexpr double regular = 0.8;
constexpr double least_coverage = 0.6;

unsigned byte_at(Stream stream, std::size_t at) { return std::to_integer<unsigned>(stream[at]); }

// One or two bytes, in big-endian order.
struct Anchor {
  std::size_t size = 1;
  unsigned bytes = 0;

  bool is_at(Stream stream, std::size_t at) const {
    if (at + size > stream.size()) return false;
    return size == 1 ? byte_at(stream, at) == bytes : (byte_at(stream, at) << 8 | byte_at(stream, at + 1)) == bytes;
  }
  // Returns true if it has a byte that small numbers have in high places: runs of these vary in length.
  bool is_filling() const {
    const auto fills = [](unsigned byte) { return byte == 0x00 || byte == 0xFF; };
    return fills(bytes & 0xFFU) || (size == 2 && fills(bytes >> 8));
  }
};

std::vector<std::size_t> places_of(const Anchor& anchor, Stream stream) {
  std::vector<std::size_t> places;
  for (std::size_t at = 0; at + anchor.size <= stream.size(); ++at)
    if (anchor.is_at(stream, at)) places.push_back(at);
  return places;
}

// Returns the most frequent anchors that are not too dense to be in frames.
std::vector<Anchor> anchors_in(Stream stream) {
  std::vector<Anchor> all;
  for (const std::size_t size : {std::size_t{2}, std::size_t{1}}) {
    std::vector<std::uint32_t> counts(size == 1 ? 256 : 65536);
    for (std::size_t at = 0; at + size <= stream.size(); ++at)
      ++counts[size == 1 ? byte_at(stream, at) : byte_at(stream, at) << 8 | byte_at(stream, at + 1)];
    const std::size_t fewest = std::max(FrameSplit::fewest_frames, stream.size() / FrameSplit::longest_frame);
    const std::size_t most = stream.size() / FrameSplit::shortest_frame * 5 / 4;
    std::vector<unsigned> frequent;
    for (unsigned bytes = 0; bytes < counts.size(); ++bytes)
      if (counts[bytes] >= fewest && counts[bytes] <= most) frequent.push_back(bytes);
    const std::size_t taken = std::min<std::size_t>(frequent.size(), size == 1 ? 48 : 96);
    std::ranges::partial_sort(frequent, frequent.begin() + static_cast<std::ptrdiff_t>(taken), std::greater<>{},
                              [&](unsigned bytes) { return counts[bytes]; });
    for (std::size_t i = 0; i < taken; ++i) all.push_back({size, frequent[i]});
  }
  return all;
}

// The length of a frame by a byte at `offset` from its anchor.
struct LengthRule {
  Anchor anchor;
  std::optional<int> offset;                                         // nullopt: all frames have lengths[0]
  std::vector<std::size_t> lengths = std::vector<std::size_t>(256);  // by the byte; 0: none

  std::size_t length_at(Stream stream, std::size_t at) const {
    if (!offset) return lengths[0];
    const auto place = static_cast<std::ptrdiff_t>(at) + *offset;
    if (place < 0 || place >= static_cast<std::ptrdiff_t>(stream.size())) return 0;
    return lengths[byte_at(stream, static_cast<std::size_t>(place))];
  }
};

// Returns the smallest distance at which enough of these places have another anchor; 0 if there is none.
std::size_t length_of(std::span<const std::size_t> group, std::span<const std::size_t> all) {
  constexpr std::size_t most_next = 24;
  std::map<std::size_t, std::size_t> counts;
  for (const std::size_t at : group) {
    auto next = std::ranges::upper_bound(all, at);
    for (std::size_t i = 0; i < most_next && next != all.end(); ++i, ++next) {
      if (*next - at > FrameSplit::longest_frame) break;
      if (*next - at >= FrameSplit::shortest_frame) ++counts[*next - at];
    }
  }
  for (const auto& [length, count] : counts)
    if (static_cast<double>(count) >= regular * static_cast<double>(group.size() - 1)) return length;
  return 0;
}

// Returns the rule, and the share of the anchors that have a length by it.
std::optional<LengthRule> rule_of(const Anchor& anchor, std::optional<int> offset, Stream stream,
                                  std::span<const std::size_t> all) {
  LengthRule rule{anchor, offset};
  std::vector<std::vector<std::size_t>> groups(offset ? 256 : 1);
  for (const std::size_t at : all) {
    const auto place = static_cast<std::ptrdiff_t>(at) + offset.value_or(0);
    if (place < 0 || place >= static_cast<std::ptrdiff_t>(stream.size())) continue;
    groups[offset ? byte_at(stream, static_cast<std::size_t>(place)) : 0].push_back(at);
  }
  std::size_t found = 0, lengths = 0;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (groups[i].size() < std::max(FrameSplit::fewest_frames, all.size() / 200)) continue;
    rule.lengths[i] = length_of(groups[i], all);
    if (rule.lengths[i] != 0) found += groups[i].size();
    lengths += rule.lengths[i] != 0;
  }
  if (2 * found < all.size() || lengths > most_lengths) return std::nullopt;
  return rule;
}

// Divides the stream: a frame begins at an anchor, and another anchor, or the end, follows it.
FrameSplit split_by(const LengthRule& rule, Stream stream) {
  std::map<std::size_t, std::vector<FrameSplit::Place>> frames;
  std::size_t covered = 0;
  bool is_next = false;
  for (std::size_t at = 0; at + rule.anchor.size <= stream.size();) {
    const std::size_t length = rule.anchor.is_at(stream, at) ? rule.length_at(stream, at) : 0;
    const std::size_t end = at + length;
    if (length == 0 || end > stream.size() ||
        (end + rule.anchor.size <= stream.size() && !rule.anchor.is_at(stream, end))) {
      ++at;
      is_next = false;
      continue;
    }
    frames[length].push_back({at, is_next});
    covered += length;
    is_next = true;
    at = end;
  }
  FrameSplit split;
  std::size_t most = 0;
  for (const auto& [length, places] : frames) most = std::max(most, places.size());
  for (auto& [length, places] : frames) {
    if (places.size() >= std::max(FrameSplit::fewest_frames, most / seldom))
      split.kinds.push_back({length, std::move(places)});
    else
      covered -= length * places.size();
  }
  split.coverage = static_cast<double>(covered) / static_cast<double>(std::max<std::size_t>(stream.size(), 1));
  return split;
}

// Returns the mean fourth power of the share of the most frequent byte at each place in the frames. Where anchors
// slip, as in a run of zeros after a byte was lost, fewer places have a constant byte.
double steadiness(const FrameSplit& split, Stream stream) {
  constexpr std::size_t most_frames = 128;
  double sum = 0, bytes = 0;
  for (const FrameSplit::Kind& kind : split.kinds) {
    const std::size_t step = kind.places.size() / most_frames + 1;
    for (std::size_t offset = 0; offset < kind.length; ++offset) {
      std::array<std::size_t, 256> counts{};
      std::size_t frames = 0;
      for (std::size_t i = 0; i < kind.places.size(); i += step, ++frames)
        ++counts[byte_at(stream, kind.places[i].at + offset)];
      sum += std::pow(static_cast<double>(*std::ranges::max_element(counts)) / static_cast<double>(frames), 4);
      bytes += 1;
    }
  }
  return bytes > 0 ? sum / bytes : 0;
}

struct RankedRule {
  double rank = 0;
  LengthRule rule;
};

// Rates a rule by its split of the stream. A longer anchor, a rule without a further byte, and anchors other than
// filling are preferred.
double rank_of(const LengthRule& rule, const FrameSplit& split, Stream stream) {
  return split.coverage + steadiness(split, stream) + (rule.anchor.size == 2 ? 0.01 : 0) + (rule.offset ? 0 : 0.005) -
         (rule.anchor.is_filling() ? 0.02 : 0);
}

}  // namespace

std::vector<FrameSplit> find_splits(Stream stream) {
  const Stream head = stream.first(std::min(stream.size(), searched));
  // Rules that give equally many frames of the same lengths differ only in the anchor's place in the frame.
  std::map<std::vector<std::size_t>, std::vector<RankedRule>> by_lengths;
  for (const Anchor& anchor : anchors_in(head)) {
    const std::vector<std::size_t> all = places_of(anchor, head);
    for (int offset = -4; offset <= 8; ++offset) {
      const bool is_own = offset >= 0 && offset < static_cast<int>(anchor.size);
      if (is_own && offset != 0) continue;
      const auto rule = rule_of(anchor, is_own ? std::nullopt : std::optional(offset), head, all);
      if (!rule) continue;
      const FrameSplit split = split_by(*rule, head);
      if (split.coverage < least_coverage) continue;
      std::vector<std::size_t> key;
      for (const FrameSplit::Kind& kind : split.kinds) key.push_back(kind.length);
      std::vector<RankedRule>& rules = by_lengths[key];
      rules.push_back({rank_of(*rule, split, head), *rule});
      std::ranges::stable_sort(rules, std::greater<>{}, &RankedRule::rank);
      if (rules.size() > most_rules) rules.pop_back();
    }
  }
  std::vector<FrameSplit> splits;
  for (const auto& [key, rules] : by_lengths) {
    // Bytes that do not change at first may do so later.
    double best = -1;
    for (const RankedRule& one : rules) {
      FrameSplit split = split_by(one.rule, stream);
      const double rank = rank_of(one.rule, split, stream);
      if (rank <= best) continue;
      if (best < 0) splits.emplace_back();
      best = rank;
      splits.back() = std::move(split);
    }
  }
  std::erase_if(splits, [](const FrameSplit& split) { return split.kinds.empty(); });
  const auto rank = [](const FrameSplit& split) {
    return std::tuple(-std::round(split.coverage * 25), split.kinds.size(), split.kinds.front().length);
  };
  std::ranges::sort(splits, {}, rank);
  if (splits.size() > most_splits) splits.resize(most_splits);
  return splits;
}

}  // namespace imud
