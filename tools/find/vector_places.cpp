#include "tools/find/vector_places.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace imud {
namespace {

constexpr std::size_t longest_stride = 64;  // bytes
constexpr std::size_t most_vectors = 1500;
constexpr std::size_t pairs_of_frames = 512;  // of frames
// A number that follows the motion changes from frame to frame by less than this share of all its changes.
constexpr double most_vector_step = 0.6;
// Its standard deviation is above this multiple of the standard deviation at rest.
constexpr double times_still = 4;

std::vector<FrameNumber> number_types() {
  using enum FrameNumber::Format;
  std::vector<FrameNumber> types;
  for (const bool is_big : {false, true}) {
    types.push_back({float64, 8, is_big});
    types.push_back({float32, 4, is_big});
    for (const std::size_t bytes : {8U, 4U, 3U, 2U}) types.push_back({signed_integer, bytes, is_big});
    for (const std::size_t bytes : {4U, 3U, 2U}) types.push_back({unsigned_integer, bytes, is_big});
  }
  types.push_back({signed_integer, 1, false});
  return types;
}

enum class Liveliness : std::uint8_t { none, still, lively };

Liveliness liveliness_of(const HandledFrames& frames, const NumberPlace& place) {
  const NumberStatistics rest = frames.statistics(place, Handled::rest, pairs_of_frames);
  if (!rest.is_finite) return Liveliness::none;
  const NumberStatistics turned = frames.statistics(place, Handled::turned, pairs_of_frames);
  if (!turned.is_finite) return Liveliness::none;
  // Signed numbers that are read as offset binary lie at the ends of the range, and jump from one to the other; so
  // do numbers in offset binary that are read as signed numbers.
  if (!place.type.is_float()) {
    using enum FrameNumber::Format;
    NumberPlace other = place;
    other.type.format = place.type.format == signed_integer ? unsigned_integer : signed_integer;
    const NumberStatistics read = frames.statistics(other, Handled::turned, pairs_of_frames);
    if (std::hypot(turned.mean, turned.sigma) > std::hypot(read.mean, read.sigma)) return Liveliness::none;
  }
  const bool is_lively =
      turned.sigma > 0 && turned.step < most_vector_step * turned.sigma && turned.sigma > times_still * rest.sigma;
  return is_lively ? Liveliness::lively : Liveliness::still;
}

std::size_t high_byte(const VectorPlace& place) {
  return place.first.at + (place.first.type.is_big ? 0 : place.first.type.bytes - 1);
}

// Returns true if `wide` is the number `narrow` with further low bytes, and the highest of these further bytes takes
// all values equally often. Requires that both have the same high bytes.
bool is_wider(const VectorPlace& wide, const VectorPlace& narrow, const HandledFrames& frames) {
  const FrameNumber &type = wide.first.type, &other = narrow.first.type;
  if ((other.bytes > 1 && (type.is_big != other.is_big || type.format != other.format)) || type.bytes <= other.bytes)
    return false;
  // The highest of the further bytes takes all values alike, if the number has more bits than its noise hides.
  constexpr std::size_t bins = 16, most_values = 2048;
  constexpr double most_difference = 0.3;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!wide.is_lively[i]) continue;
    NumberPlace further = wide.component(i);
    further.at += type.is_big ? other.bytes : type.bytes - other.bytes - 1;
    further.type = {FrameNumber::Format::signed_integer, 1, false};
    std::array<double, bins> counts{};
    const std::vector<double> values = frames.values(further, Handled::turned, most_values);
    for (const double value : values) counts[static_cast<std::size_t>(value + 128) * bins / 256] += 1;
    double difference = 0;
    for (const double count : counts)
      difference += std::abs(count / static_cast<double>(values.size()) - 1.0 / bins) / 2;
    if (difference > most_difference) return false;
  }
  return true;
}

// Returns true if a reading with the same high bytes is better: wider, or as wide and with less noise.
bool is_better_reading(const VectorPlace& one, const VectorPlace& other, const HandledFrames& frames) {
  constexpr double alike = 1.05;
  const double rough = roughness(one, frames), other_rough = roughness(other, frames);
  if (is_wider(one, other, frames)) return rough < alike * other_rough;
  return one.first.type.format == other.first.type.format && one.first.type.bytes == other.first.type.bytes &&
         rough < other_rough;
}

}  // namespace

bool VectorPlace::overlaps(const VectorPlace& other) const {
  if (first.message != other.first.message) return false;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t a = component(i).at, b = other.component(j).at;
      if (a < b + other.first.type.bytes && b < a + first.type.bytes) return true;
    }
  return false;
}

std::vector<VectorPlace> find_vectors(const HandledFrames& frames, const std::vector<std::vector<bool>>& is_free) {
  std::vector<VectorPlace> found;
  for (std::size_t m = 0; m < is_free.size(); ++m)
    for (const FrameNumber& type : number_types()) {
      const std::size_t length = is_free[m].size();
      std::vector<Liveliness> all(length, Liveliness::none);
      for (std::size_t at = 0; at + type.bytes <= length; ++at) {
        const auto begin = is_free[m].begin() + static_cast<std::ptrdiff_t>(at);
        if (std::all_of(begin, begin + static_cast<std::ptrdiff_t>(type.bytes), [](bool one) { return one; }))
          all[at] = liveliness_of(frames, {m, at, type});
      }
      for (std::size_t stride = type.bytes; stride <= longest_stride; ++stride)
        for (std::size_t at = 0; at + 2 * stride + type.bytes <= length; ++at) {
          VectorPlace place{{m, at, type}, stride};
          std::size_t lively = 0;
          bool is_number = true;
          for (std::size_t i = 0; i < 3; ++i) {
            place.is_lively[i] = all[at + i * stride] == Liveliness::lively;
            lively += place.is_lively[i];
            is_number = is_number && all[at + i * stride] != Liveliness::none;
          }
          if (is_number && lively >= 2 && found.size() < most_vectors) found.push_back(place);
        }
    }
  return found;
}

double roughness(const VectorPlace& place, const HandledFrames& frames) {
  double sum = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!place.is_lively[i]) continue;
    const NumberStatistics turned = frames.statistics(place.component(i), Handled::turned, pairs_of_frames);
    sum += turned.step / turned.sigma;
  }
  return sum;
}

std::vector<std::size_t> distinct_vectors(const std::vector<VectorPlace>& all, const HandledFrames& frames) {
  std::vector<std::size_t> order(all.size()), kept;
  std::iota(order.begin(), order.end(), std::size_t{0});
  // Floats come first, then signed numbers; narrow numbers come before wide numbers.
  const auto key = [&all](std::size_t i) {
    const FrameNumber& type = all[i].first.type;
    return std::tuple(!type.is_float(), type.format == FrameNumber::Format::unsigned_integer, type.bytes);
  };
  std::ranges::stable_sort(order, {}, key);
  for (const std::size_t i : order) {
    const auto same = std::ranges::find_if(kept, [&](std::size_t other) {
      return all[i].first.message == all[other].first.message && all[i].stride == all[other].stride &&
             high_byte(all[i]) == high_byte(all[other]);
    });
    if (same == kept.end())
      kept.push_back(i);
    else if (all[*same].first.type.is_float() == all[i].first.type.is_float() &&
             is_better_reading(all[i], all[*same], frames))
      *same = i;
  }
  std::ranges::sort(kept);
  return kept;
}

}  // namespace imud
