#include "tools/find/frame_finder.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/checks/crc_solver.hpp"
#include "tools/find/frame_begin.hpp"
#include "tools/find/header_checks.hpp"
#include "tools/find/message_types.hpp"

namespace imud {
namespace {

using Stream = std::span<const std::byte>;

constexpr std::size_t most_frames = 200'000;  // frames of a message that are examined
constexpr std::size_t nearest_begin = 16;     // bytes before an anchor, with frames of several lengths

// Windows of `before` bytes and a frame, of the places that have them.
std::vector<Stream> windows_of(const FrameSplit::Kind& kind, std::size_t before, Stream stream) {
  std::vector<Stream> whole, all;
  for (const auto& [at, is_next] : kind.places) {
    if (at < before || at + kind.length > stream.size()) continue;
    all.push_back(stream.subspan(at - before, before + kind.length));
    if (is_next) whole.push_back(all.back());
  }
  return whole.size() >= FrameSplit::fewest_frames ? whole : all;
}

bool is_whole(const FoundCheck& check) { return check.is_whole(); }

// A message that hardly varies does not reveal its check; it may have the check of the other messages.
void adopt_check(Trial& trial, std::size_t kind) {
  for (std::size_t other = 0; other < trial.checks.size(); ++other)
    for (const FoundCheck& check : trial.checks[other])
      if (other != kind && is_whole(check))
        if (auto adopted = trial.searches[kind].adopted(check, trial.split.kinds[other].length)) {
          trial.checks[kind] = {std::move(*adopted)};
          return;
        }
}

// How thoroughly checks are sought: what is rare takes more time, and is sought where nothing else is found.
enum class Depth : std::uint8_t { behind_range, before_range, unknown };

Trial try_split(FrameSplit split, Stream stream, Depth depth) {
  Trial trial;
  trial.split = std::move(split);
  const std::vector<FrameSplit::Kind>& kinds = trial.split.kinds;
  trial.before = kinds.size() == 1 ? kinds.front().length : std::min(nearest_begin, kinds.front().length);
  for (const FrameSplit::Kind& kind : kinds) {
    trial.searches.emplace_back(windows_of(kind, trial.before, stream), kind.length);
    const CheckSearch& search = trial.searches.back();
    std::vector<FoundCheck> found = search.find(CheckSearch::Place::behind_range, trial.before);
    if (depth >= Depth::before_range && std::ranges::none_of(found, is_whole)) {
      for (FoundCheck& check : search.find(CheckSearch::Place::before_range, trial.before))
        found.push_back(std::move(check));
      if (depth >= Depth::unknown && std::ranges::none_of(found, is_whole))
        for (FoundCheck& check : search.find_unknown(trial.before)) found.push_back(std::move(check));
    }
    trial.checks.push_back(std::move(found));
  }
  std::size_t checked = 0, all = 0;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    if (std::ranges::none_of(trial.checks[k], is_whole)) adopt_check(trial, k);
    const std::size_t bytes = kinds[k].length * kinds[k].places.size();
    all += bytes;
    if (std::ranges::any_of(trial.checks[k], is_whole)) checked += bytes;
  }
  trial.checked = static_cast<double>(checked) / static_cast<double>(all);
  choose_begin(trial, stream);
  return trial;
}

double mean_length(const FrameSplit& split) {
  std::size_t bytes = 0, frames = 0;
  for (const FrameSplit::Kind& kind : split.kinds) {
    bytes += kind.length * kind.places.size();
    frames += kind.places.size();
  }
  return static_cast<double>(bytes) / static_cast<double>(frames);
}

// Returns true if the first trial explains more of the stream, or explains it more simply. Several frames with
// checks may look like one frame with all of these checks; without checks, one long frame explains the stream as
// well as several frames.
bool is_better(const Trial& a, const Trial& b) {
  constexpr double alike = 0.01, much_shorter = 0.75;
  const double more = a.checked * a.split.coverage - b.checked * b.split.coverage;
  if (std::abs(more) > alike) return more > 0;
  const double length = mean_length(a.split), other = mean_length(b.split);
  if (a.checked > 0 && length < much_shorter * other) return true;
  if (a.checked > 0 && other < much_shorter * length) return false;
  const double wider = a.split.coverage - b.split.coverage;
  if (std::abs(wider) > alike && !(a.checked > 0 && b.checked > 0)) return wider > 0;
  if (a.split.kinds.size() != b.split.kinds.size()) return a.split.kinds.size() < b.split.kinds.size();
  return length < other;
}

constexpr double nearly_all_checked = 0.95, half_checked = 0.5;

std::optional<Trial> best_trial(std::span<const FrameSplit> splits, Stream stream, Depth depth) {
  std::vector<const FrameSplit*> by_length;
  for (const FrameSplit& split : splits) by_length.push_back(&split);
  std::ranges::sort(by_length, {}, [](const FrameSplit* split) { return mean_length(*split); });
  std::optional<Trial> best;
  for (const FrameSplit* split : by_length) {
    constexpr double longer = 1.34;
    if (best && best->checked * best->split.coverage > nearly_all_checked &&
        mean_length(*split) > longer * mean_length(best->split))
      break;
    Trial trial = try_split(*split, stream, depth);
    if (!best || is_better(trial, *best)) best = std::move(trial);
  }
  return best;
}

void find_constants(FoundMessage& message, Stream stream) {
  const auto frames = frames_of(message, stream);
  message.usual.resize(message.length);
  message.constant.resize(message.length);
  for (std::size_t at = 0; at < message.length; ++at) {
    std::array<std::size_t, 256> counts{};
    for (const Stream frame : frames) ++counts[std::to_integer<std::size_t>(frame[at])];
    const auto most = std::ranges::max_element(counts);
    message.usual[at] = static_cast<std::byte>(most - counts.begin());
    message.constant[at] = static_cast<double>(*most) >= constant_share * static_cast<double>(frames.size());
  }
}

// The header: constant bytes at the beginning, up to the first that could be the high byte of a number.
void find_header(FoundMessage& message) {
  std::size_t limit = std::min(message.length, longest_header);
  for (const FoundCheck& check : message.checks) limit = std::min(limit, check.at);
  std::size_t count = 0;
  while (count < limit && message.constant[count] && (count == 0 || !is_high_byte(message.usual[count]))) ++count;
  message.header = count;
}

// CRCs without a name of messages of different lengths: initial value and final XOR that are right for all.
void solve_together(std::vector<FoundMessage>& messages, Stream stream) {
  struct Own {
    FoundMessage* message;
    FoundCheck* check;
  };
  std::vector<Own> all;
  for (FoundMessage& message : messages)
    for (FoundCheck& check : message.checks)
      if (check.forms.front().own && check.ranges.size() == 1) all.push_back({&message, &check});
  if (all.size() < 2 || all[0].message->length == all[1].message->length) return;
  const CrcParameters& parameters = *all[0].check->forms.front().own;
  if (std::ranges::any_of(all, [&](const Own& one) {
        return one.check->forms.front().own->poly != parameters.poly || one.check->forms.front().extra.size() != 0;
      }))
    return;
  const auto example = [&](const Own& own) {
    const FoundCheck& check = *own.check;
    // A frame whose check agrees.
    for (const Stream frame : frames_of(*own.message, stream)) {
      const FoundCheck::Form& form = check.forms.front();
      const Crc crc(*form.own);
      const Stream bytes = frame.subspan(form.begin, check.at - form.begin);
      const std::uint64_t value = number_at(frame, check.at, check.size, check.is_big);
      if (crc.finish(crc.update(crc.start(), bytes)) == value) return CrcExample{frame.subspan(0, check.at), value};
    }
    return CrcExample{};
  };
  const auto solved = solve_initial(parameters, example(all[0]), example(all[1]));
  if (!solved) return;
  for (const Own& own : all) {
    own.check->forms.front().begin = 0;
    own.check->forms.front().own = solved;
  }
}

// Returns the messages of one length.
std::vector<FoundMessage> messages_of(const Trial& trial, std::size_t kind, Stream stream, std::size_t joint) {
  const std::size_t length = trial.split.kinds[kind].length;
  std::vector<FrameSplit::Place> frames;
  const std::size_t shift = trial.before - trial.begin;  // from the frame's first byte to its anchor
  for (const auto& [at, is_next] : trial.split.kinds[kind].places) {
    // With one length, the frame may begin before the anchor by any number of bytes: its end is the next anchor's.
    if (at >= shift && at - shift + length <= stream.size() && frames.size() < most_frames)
      frames.push_back({at - shift, is_next});
  }
  if (frames.empty()) return {};
  std::vector<FoundCheck> checks;
  std::vector<bool> is_checked(length);
  for (const FoundCheck& check : trial.checks[kind])
    if (auto inside = in_frame(trial, kind, check)) {
      std::fill_n(is_checked.begin() + static_cast<std::ptrdiff_t>(inside->at), inside->size, true);
      checks.push_back(std::move(*inside));
    }
  std::vector<FoundMessage> messages;
  for (auto& of_type : divide_by_type(frames, length, is_checked, stream)) {
    FoundMessage message;
    message.length = length;
    message.frames = std::move(of_type);
    find_constants(message, stream);
    message.checks = checks;
    for (FoundCheck& check : find_header_checks(message, stream)) message.checks.push_back(std::move(check));
    std::ranges::sort(message.checks, {}, &FoundCheck::at);
    find_header(message);
    message.counters = find_counters(message, stream, joint);
    messages.push_back(std::move(message));
  }
  return messages;
}

}  // namespace

std::vector<Stream> frames_of(const FoundMessage& message, Stream stream) {
  std::vector<Stream> frames;
  for (const auto& place : message.frames) frames.push_back(stream.subspan(place.at, message.length));
  return frames;
}

std::optional<FoundFrames> find_frames(Stream stream, std::size_t joint) {
  const std::vector<FrameSplit> splits = find_splits(stream);
  std::optional<Trial> best;
  for (const Depth depth : {Depth::behind_range, Depth::before_range, Depth::unknown}) {
    constexpr std::size_t most_rare = 6;  // splits, the most probable ones
    if (best && best->checked * best->split.coverage > half_checked) break;
    const std::size_t most = depth == Depth::behind_range ? splits.size() : most_rare;
    best = best_trial(std::span(splits).first(std::min(splits.size(), most)), stream, depth);
  }
  if (!best) return std::nullopt;
  FoundFrames found;
  found.coverage = best->split.coverage;
  found.is_checked = best->checked > 0.99;
  found.other_begins = best->other_begins;
  for (std::size_t k = 0; k < best->split.kinds.size(); ++k)
    for (FoundMessage& message : messages_of(*best, k, stream, joint)) found.messages.push_back(std::move(message));
  std::ranges::sort(found.messages, {}, [](const FoundMessage& message) { return message.frames.front().at; });
  solve_together(found.messages, stream);
  find_lengths(found.messages);
  return found;
}

}  // namespace imud
