#include "tools/find/handled_frames.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "tools/find/frame_checks.hpp"

namespace imud {
namespace {

constexpr std::size_t most_handled = 50'000;  // of a message in a capture
constexpr std::size_t most_blocks = 1500;
// A number of a sensor is 0, or its magnitude is between these limits. Other values are not numbers of a sensor,
// but other bytes read as a float.
constexpr double smallest_number = 1e-12, largest_number = 1e12;

bool is_plausible(double value) {
  return value == 0 ||
         (std::isfinite(value) && std::abs(value) < largest_number && std::abs(value) > smallest_number);
}

}  // namespace

double value_in(std::span<const std::byte> frame, std::size_t at, const FrameNumber& type) noexcept {
  const std::uint64_t bits = load_number(type, frame.data() + at);
  switch (type.format) {
    case FrameNumber::Format::float32:
      return double{std::bit_cast<float>(static_cast<std::uint32_t>(bits))};
    case FrameNumber::Format::float64:
      return std::bit_cast<double>(bits);
    case FrameNumber::Format::unsigned_integer:
      return static_cast<double>(bits) - std::ldexp(1.0, static_cast<int>(8 * type.bytes) - 1);
    case FrameNumber::Format::signed_integer:
      break;
  }
  const auto unused = static_cast<unsigned>(64 - 8 * type.bytes);
  return static_cast<double>(static_cast<std::int64_t>(bits << unused) >> unused);
}

HandledFrames::HandledFrames(const std::vector<FoundMessage>& messages, std::span<const std::byte> stream,
                             std::size_t turned_bytes) {
  std::size_t most_frequent = 0;
  for (Part& part : parts_) {
    part.frames.resize(messages.size());
    part.nearest.resize(messages.size());
  }
  for (std::size_t m = 0; m < messages.size(); ++m) {
    const FoundMessage& message = messages[m];
    if (message.frames.size() > messages[most_frequent].frames.size()) most_frequent = m;
    const FrameChecks checks(message);
    for (const FrameSplit::Place& place : message.frames) {
      if (place.at < turned_bytes && place.at + message.length > turned_bytes) continue;
      Frames& frames = parts_[place.at < turned_bytes ? 1 : 0].frames[m];
      const auto frame = stream.subspan(place.at, message.length);
      if (frames.size() < most_handled && checks.hold(frame)) frames.push_back(frame);
    }
  }
  for (Part& part : parts_) align(part, most_frequent, messages.size() == 1);
}

void HandledFrames::align(Part& part, std::size_t most_frequent, bool is_alone) {
  const Frames& base = part.frames[most_frequent];
  if (base.empty()) return;
  std::vector<double> times(base.size());
  const auto length = static_cast<double>(base.front().size());
  const double mean = base.size() > 1 ? static_cast<double>(base.back().data() - base.front().data()) /
                                            static_cast<double>(base.size() - 1)
                                      : length;
  for (std::size_t k = 1; k < base.size(); ++k) {
    // Lost frames take time, too. Where messages alternate, the bytes of all of them are the clock.
    const auto gap = static_cast<double>(base[k].data() - base[k - 1].data());
    times[k] = times[k - 1] + (is_alone ? std::max(1.0, std::round(gap / length)) : gap / mean);
  }
  part.block = 1 + (base.size() - 1) / most_blocks;
  for (std::size_t k = 0; k + part.block <= base.size(); k += part.block)
    part.time.push_back((times[k] + times[k + part.block - 1]) / 2);
  for (std::size_t m = 0; m < part.frames.size(); ++m) {
    const Frames& frames = part.frames[m];
    if (frames.empty()) continue;
    std::size_t near = 0;
    for (const auto& frame : base) {
      const auto distance = [&](std::size_t i) { return std::abs(frames[i].data() - frame.data()); };
      while (near + 1 < frames.size() && distance(near + 1) <= distance(near)) ++near;
      part.nearest[m].push_back(near);
    }
  }
}

NumberStatistics HandledFrames::statistics(const NumberPlace& number, Handled capture, std::size_t most_pairs) const {
  const Frames& frames = part(capture).frames[number.message];
  NumberStatistics found;
  if (frames.size() < 2) return found;
  const std::size_t stride = 1 + (frames.size() - 1) / most_pairs;
  double sum = 0, squares = 0, steps = 0, count = 0, first = 0;
  for (std::size_t k = 0; k + 1 < frames.size(); k += stride) {
    const double one = value_in(frames[k], number.at, number.type);
    const double next = value_in(frames[k + 1], number.at, number.type);
    if (!is_plausible(one) || !is_plausible(next)) return found;
    if (count == 0) first = one;
    sum += one - first;
    squares += (one - first) * (one - first);
    steps += (next - one) * (next - one);
    count += 1;
  }
  found.is_finite = true;
  found.mean = first + sum / count;
  found.sigma = std::sqrt(std::max(0.0, squares / count - sum / count * (sum / count)));
  found.step = std::sqrt(steps / count);
  return found;
}

std::vector<double> HandledFrames::values(const NumberPlace& number, Handled capture, std::size_t most) const {
  const Frames& frames = part(capture).frames[number.message];
  std::vector<double> all;
  const std::size_t stride = 1 + frames.size() / most;
  for (std::size_t k = 0; k < frames.size(); k += stride) all.push_back(value_in(frames[k], number.at, number.type));
  return all;
}

const std::vector<double>& HandledFrames::blocks(const NumberPlace& number, Handled capture) const {
  const Part& from = part(capture);
  const auto [known, is_new] = from.means.try_emplace(number);
  std::vector<double>& means = known->second;
  if (!is_new) return means;
  means.resize(from.time.size());
  if (from.frames[number.message].empty()) return means;
  for (std::size_t b = 0; b < means.size(); ++b) {
    for (std::size_t k = b * from.block; k < (b + 1) * from.block; ++k)
      means[b] += value_in(from.frames[number.message][from.nearest[number.message][k]], number.at, number.type);
    means[b] /= static_cast<double>(from.block);
  }
  return means;
}

}  // namespace imud
