// Finds the numbers of a frame that depend on the frame's place in the stream, or on its length.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <tuple>

#include "protocols/frames/layout/frame_layout.hpp"
#include "tools/find/frame_finder.hpp"

namespace imud {
namespace {

using Stream = std::span<const std::byte>;

constexpr double steady_share = 0.85;
constexpr std::size_t most_compared = 4000;  // frames

// A number that may be a counter.
struct Number {
  std::size_t at, size;
  bool is_big, is_float;
};

// Pairs of frames that follow each other in the stream without a gap.
using Pairs = std::vector<std::pair<Stream, Stream>>;

// Frames of other messages may stand between both.
Pairs pairs_of(const FoundMessage& message, Stream stream, std::size_t joint) {
  Pairs pairs;
  const std::size_t count = std::min(message.frames.size(), most_compared);
  for (std::size_t i = 1; i < count; ++i) {
    if (message.frames[i - 1].at < joint && message.frames[i].at >= joint) continue;
    pairs.emplace_back(stream.subspan(message.frames[i - 1].at, message.length),
                       stream.subspan(message.frames[i].at, message.length));
  }
  return pairs;
}

std::uint64_t value_at(Stream frame, const Number& number) {
  return number_at(frame, number.at, number.size, number.is_big);
}

// The steps of a number that counts: one, or two neighbours, if the period is no whole number of units.
struct Steps {
  std::uint64_t low = 0, high = 0;
  double mean = 0, share = 0;
  bool has(std::uint64_t step) const { return step == low || step == high; }
};

std::optional<Steps> steps_of(const Number& number, const Pairs& pairs) {
  const std::uint64_t mask = low_bits(static_cast<unsigned>(8 * number.size));
  std::map<std::uint64_t, std::size_t> counts;
  for (const auto& [one, other] : pairs) ++counts[(value_at(other, number) - value_at(one, number)) & mask];
  const auto most = std::ranges::max_element(counts, {}, [](const auto& step) { return step.second; });
  const auto all = static_cast<double>(pairs.size());
  const auto count = [&](std::uint64_t step) {
    const auto known = counts.find(step);
    return known == counts.end() ? 0.0 : static_cast<double>(known->second);
  };
  const std::uint64_t step = most->first;
  Steps found{step, step, static_cast<double>(step), count(step) / all};
  if (found.share < steady_share && step > 0) {
    found.low = step > 1 && count(step - 1) > count(step + 1) ? step - 1 : step;
    found.high = found.low + 1;
    const double both = count(found.low) + count(found.high);
    found.mean = static_cast<double>(found.low) + count(found.high) / both;
    found.share = both / all;
  }
  // If no step changes the lowest byte, the counter is the number without this byte.
  if (found.low == 0 || (found.low == found.high && (step & 0xFFU) == 0) || step > mask / 2 ||
      found.share < steady_share)
    return std::nullopt;
  return found;
}

std::optional<FoundCounter> integer_counter(const Number& number, const Pairs& pairs) {
  const auto steps = steps_of(number, pairs);
  if (!steps) return std::nullopt;
  const std::uint64_t mask = low_bits(static_cast<unsigned>(8 * number.size));
  std::uint64_t highest = 0;
  for (const auto& [one, other] : pairs) {
    const std::uint64_t a = value_at(one, number), b = value_at(other, number);
    if (steps->has((b - a) & mask)) highest = std::max({highest, a, b});
  }
  // Bytes belong together if the higher ones step where the lower ones begin again: two counters side by side do not.
  for (std::size_t count = 1; count < number.size; ++count) {
    const std::uint64_t low = low_bits(static_cast<unsigned>(8 * count));
    std::size_t carries = 0, right = 0;
    for (const auto& [one, other] : pairs) {
      const std::uint64_t a = value_at(one, number), b = value_at(other, number);
      if ((b & low) >= (a & low)) continue;
      ++carries;
      right += steps->has((b - a) & mask);
    }
    if (carries == 0 || 2 * right < carries) return std::nullopt;
  }
  FoundCounter found{number.at, number.size, number.is_big, false, steps->mean, 0, steps->share, highest};
  if (steps->low != steps->high) return found;
  // Where it begins again before the type ends, it steps back by the modulus less the step.
  const std::uint64_t step = steps->low;
  std::map<std::uint64_t, std::size_t> falls;
  for (const auto& [one, other] : pairs) {
    const std::uint64_t a = value_at(one, number), b = value_at(other, number);
    if (b < a && ((b - a) & mask) != step) ++falls[a - b + step];
  }
  const auto fall = std::ranges::max_element(falls, {}, [](const auto& one) { return one.second; });
  if (fall != falls.end() && fall->first > highest && fall->first - highest <= step && fall->first <= mask &&
      (fall->second > 1 || fall->first % 2 == 0 || fall->first % 5 == 0))
    found.modulus = fall->first;
  return found;
}

std::optional<FoundCounter> float_clock(const Number& number, const Pairs& pairs) {
  std::vector<double> steps;
  std::vector<double> values;
  for (const auto& [one, other] : pairs) {
    const double a = float_at(one, number.at, number.size, number.is_big);
    const double b = float_at(other, number.at, number.size, number.is_big);
    if (!std::isfinite(a) || !std::isfinite(b)) continue;
    steps.push_back(b - a);
    values.push_back(std::abs(b));
  }
  if (steps.size() < pairs.size() * 9 / 10 || steps.empty()) return std::nullopt;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::ranges::nth_element(steps, middle);
  const double step = *middle;
  // Nearly the largest value, because damaged frames may have any value.
  const auto high = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 9 / 10);
  std::ranges::nth_element(values, high);
  const double largest = *high;
  const double rounding = 2 * largest * (number.size == 4 ? 0x1p-23 : 0x1p-52);
  // Numbers outside of these limits are other numbers that are read as a float.
  constexpr double least_step = 1e-5, most_time = 1e10;
  if (!(step > 4 * rounding) || step < least_step || largest > most_time) return std::nullopt;
  const auto steady =
      std::ranges::count_if(steps, [&](double one) { return std::abs(one - step) <= 1e-3 * step + 2 * rounding; });
  const double share = static_cast<double>(steady) / static_cast<double>(pairs.size());
  if (share < steady_share) return std::nullopt;
  return FoundCounter{number.at, number.size, number.is_big, true, step, 0, share};
}

// A number that has not come to the end of its type may be longer, where the bytes beside it are always 0.
template <class IsFree>
void lengthen(FoundCounter& one, const FoundMessage& message, IsFree is_free) {
  if (one.is_float || one.modulus != 0) return;
  const std::uint64_t last = low_bits(static_cast<unsigned>(8 * one.size));
  if (one.highest + static_cast<std::uint64_t>(one.step) > last) return;
  const std::size_t size = one.size <= 2 ? 2 * one.size : one.size <= 4 ? 4 : 8, more = size - one.size;
  if (more == 0) return;
  const std::size_t begin = one.is_big ? one.at - std::min(one.at, more) : one.at + one.size;
  if ((one.is_big && one.at < more) || begin + more > message.length || !is_free(begin, more)) return;
  for (std::size_t i = begin; i < begin + more; ++i)
    if (!message.constant[i] || message.usual[i] != std::byte{0}) return;
  if (one.is_big) one.at = begin;
  one.size = size;
  lengthen(one, message, is_free);
}

}  // namespace

std::vector<FoundCounter> find_counters(const FoundMessage& message, Stream stream, std::size_t joint) {
  const Pairs pairs = pairs_of(message, stream, joint);
  constexpr std::size_t fewest = 8;
  if (pairs.size() < fewest) return {};
  std::vector<bool> is_taken(message.length);
  for (const FoundCheck& check : message.checks)
    for (std::size_t i = 0; i < check.size; ++i) is_taken[check.at + i] = true;
  const auto is_free = [&](std::size_t at, std::size_t size) {
    for (std::size_t i = at; i < at + size; ++i)
      if (is_taken[i]) return false;
    return true;
  };
  std::vector<FoundCounter> all;
  for (const std::size_t size : {8U, 6U, 5U, 4U, 3U, 2U, 1U})
    for (std::size_t at = 0; at + size <= message.length; ++at)
      for (const bool is_big : {false, true}) {
        if (!is_free(at, size) || (size == 1 && is_big)) continue;
        const std::size_t low = is_big ? at + size - 1 : at;
        if (message.constant[low]) continue;
        if (size == 8 || size == 4)
          if (const auto found = float_clock({at, size, is_big, true}, pairs)) all.push_back(*found);
        if (const auto found = integer_counter({at, size, is_big, false}, pairs)) all.push_back(*found);
      }
  // Low bytes of an integer in the high places of a float step evenly, too, but not where they begin again.
  std::vector<FoundCounter> integers;
  std::ranges::copy_if(all, std::back_inserter(integers), [](const FoundCounter& one) { return !one.is_float; });
  std::erase_if(all, [&](const FoundCounter& one) {
    constexpr double steadier = 0.02;
    return one.is_float && std::ranges::any_of(integers, [&](const FoundCounter& other) {
             return other.at < one.at + one.size && one.at < other.at + other.size &&
                    other.share > one.share + steadier;
           });
  });
  // The longest numbers, and of these the steadiest ones.
  std::ranges::stable_sort(all, [](const FoundCounter& a, const FoundCounter& b) {
    return std::tuple(a.size, a.share) > std::tuple(b.size, b.share);
  });
  std::vector<FoundCounter> chosen;
  for (const FoundCounter& one : all) {
    if (!is_free(one.at, one.size)) continue;
    for (std::size_t i = 0; i < one.size; ++i) is_taken[one.at + i] = true;
    chosen.push_back(one);
  }
  for (FoundCounter& one : chosen) lengthen(one, message, is_free);
  std::ranges::sort(chosen, {}, &FoundCounter::at);
  return chosen;
}

double suggested_rate(const FoundFrames& found) {
  constexpr double usual[] = {1,   2,   4,   5,   8,   10,  20,  25,  40,   50,   80,
                              100, 125, 200, 250, 256, 400, 500, 800, 1000, 2000, 4000};
  std::size_t most = 0;
  for (const FoundMessage& message : found.messages) most = std::max(most, message.frames.size());
  for (const FoundMessage& message : found.messages)
    for (const FoundCounter& one : message.counters) {
      if (one.is_counter() || one.size == 1) continue;
      for (const double unit_s : {1.0, 1e-3, 1e-6, 1e-9}) {
        if (one.is_float != (unit_s == 1)) continue;
        const double share = std::round(static_cast<double>(most) / static_cast<double>(message.frames.size()));
        const double rate_hz = std::max(share, 1.0) / (one.step * unit_s);
        for (const double rate : usual)
          if (std::abs(rate_hz / rate - 1) < 1e-3) return rate;
      }
    }
  return 0;
}

namespace {

constexpr std::size_t last_length_place = 16;

std::uint64_t length_at(const FoundMessage& message, const FoundLength& length) {
  return number_at(message.usual, length.at, length.size, length.is_big);
}

// A length stands near the beginning: all bytes before it are constant, except for a check. A length is no part of
// a check.
bool may_be_length(const FoundMessage& message, const FoundLength& length) {
  const std::size_t end = length.at + length.size;
  if (end > std::min(last_length_place, message.length)) return false;
  for (std::size_t i = 0; i < end; ++i) {
    const bool is_check = std::ranges::any_of(
        message.checks, [i](const FoundCheck& check) { return i >= check.at && i < check.at + check.size; });
    if (i >= length.at ? is_check || !message.constant[i] : !is_check && !message.constant[i]) return false;
  }
  return true;
}

// Finds the bytes that a length counts. The most usual ranges are tried first: these begin behind the length, or
// behind a check or two that follow the length. Ranges from the begin of the frame are next, and others last. Every
// range ends at a check, where the range of a check ends, or at the end of the frame. Returns 3 for the most usual
// ranges, then 2 and 1; 0: no range fits.
int find_counted(const FoundMessage& message, FoundLength& length) {
  const std::uint64_t counted = length_at(message, length);
  std::vector<std::size_t> ends = {message.length}, behind = {length.at + length.size};
  for (const FoundCheck& check : message.checks) {
    ends.push_back(check.at);
    if (check.at == behind.back()) behind.push_back(check.at + check.size);
    for (const auto& [begin, end] : check.ranges_of(check.forms.front())) {
      if (end > check.at) ends.push_back(end);
      if (begin > length.at + length.size) behind.push_back(begin);
    }
  }
  const auto is_from = [&](std::size_t from) {
    for (const std::size_t to : ends)
      if (from < to && to - from == counted) {
        length.from = from;
        length.to = to;
        return true;
      }
    return false;
  };
  if (std::ranges::any_of(behind, is_from)) return 3;
  if (is_from(0)) return 2;
  for (std::size_t from = 1; from <= std::min<std::size_t>(length.at, 4); ++from)
    if (is_from(from)) return 1;
  return is_from(length.at) ? 1 : 0;
}

}  // namespace

void find_lengths(std::vector<FoundMessage>& messages) {
  if (messages.empty()) return;
  const FoundMessage& first = messages.front();
  const bool differ =
      std::ranges::any_of(messages, [&](const FoundMessage& message) { return message.length != first.length; });
  int best = 0;
  for (const std::size_t size : {2U, 1U})
    for (std::size_t at = 1; at + size <= last_length_place; ++at)
      for (const bool is_big : {false, true}) {
        FoundLength length{at, size, is_big, 0, first.length, 0, differ};
        if ((size == 1 && is_big) || !may_be_length(first, length)) continue;
        const auto plus_of = [&](const FoundMessage& message) {
          return static_cast<std::int64_t>(length_at(message, length)) - static_cast<std::int64_t>(message.length);
        };
        const std::int64_t plus = plus_of(first);
        if (plus > 0 || !std::ranges::all_of(messages, [&](const FoundMessage& message) {
              return may_be_length(message, length) && plus_of(message) == plus;
            }))
          continue;
        // If all messages have the same length, the number must be the size of a part of the frame.
        const int usual = find_counted(first, length) + (differ ? 4 : 0);
        if (usual <= best) continue;
        best = usual;
        for (FoundMessage& message : messages) {
          message.length_field = length;
          if (find_counted(message, *message.length_field) != 0) continue;
          message.length_field->to = message.length;
          message.length_field->plus = plus;
        }
      }
}

}  // namespace imud
