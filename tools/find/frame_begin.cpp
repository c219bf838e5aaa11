#include "tools/find/frame_begin.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

namespace imud {
namespace {

constexpr std::size_t longest_end = 2;  // constant bytes behind a check that end the frame

// Returns the number of bytes by which to move a check into the frame that begins at `begin`; nullopt if the check
// is in no frame.
std::optional<std::ptrdiff_t> moved(const FoundCheck& check, std::size_t begin, std::size_t length, bool is_cyclic) {
  std::size_t first = check.at, last = std::max(check.at + check.size, check.ranges.back().second);
  std::size_t latest = 0;  // the latest begin of a form
  for (const FoundCheck::Form& form : check.forms) latest = std::max(latest, form.begin);
  first = std::min(first, latest);
  for (const std::size_t by : {std::size_t{0}, length}) {
    if (by != 0 && !is_cyclic) break;
    if (first >= by + begin && last <= by + begin + length) return -static_cast<std::ptrdiff_t>(by + begin);
  }
  return std::nullopt;
}

// A byte that ends text, or what is transmitted (ETX).
bool is_usual_end(std::byte byte) {
  return byte == std::byte{0x03} || byte == std::byte{0x0A} || byte == std::byte{0x0D};
}

// Rates how well a byte begins a frame.
bool is_header(std::byte byte, bool follows_check) {
  if (is_usual_end(byte)) return false;
  // Behind a check there is no high byte of a number, but a low one may be 0. STX begins what ETX ends.
  return follows_check ? byte != std::byte{0} : !is_high_byte(byte);
}

// The evidence for a beginning: larger is better.
struct Rating {
  double inside = 0;  // bytes of checks in the frame, by their shares
  double looks = 0;
};

class BeginRating {
 public:
  BeginRating(const Trial& trial, std::span<const std::byte> stream) : trial_(trial), stream_(stream) {
    earliest_ = stream.size();
    for (const FrameSplit::Kind& kind : trial.split.kinds) {
      anchors_.push_back(kind.places[kind.places.size() / 2].at);
      earliest_ = std::min(earliest_, kind.places.front().at);
    }
  }

  Rating of(std::size_t begin) const {
    Rating rating;
    double ends = 0, checked = 0;
    for (std::size_t k = 0; k < trial_.split.kinds.size(); ++k)
      for (const FoundCheck& check : trial_.checks[k]) {
        const std::size_t length = trial_.split.kinds[k].length;
        const auto by = moved(check, begin, length, trial_.is_cyclic());
        if (!by) continue;
        rating.inside += static_cast<double>(check.size) * check.share;
        if (!check.is_whole()) continue;
        const auto place = [by](std::size_t at) {
          return static_cast<std::size_t>(static_cast<std::ptrdiff_t>(at) + *by);
        };
        const std::size_t end = place(std::max(check.at + check.size, check.ranges.back().second));
        ends += looks_of_end(k, begin, end);
        checked += 1;
        if (std::ranges::any_of(check.forms, [&](const FoundCheck::Form& form) { return place(form.begin) == 0; }))
          ends += 1;
      }
    const bool follows_check = ends > 0;
    if (follows_check) rating.looks += ends / checked;
    rating.looks += looks_of_header(begin, follows_check);
    if (is_first(begin)) rating.looks += 3;
    return rating;
  }

 private:
  // All kinds have the same byte there.
  bool is_constant(std::size_t at) const {
    return std::ranges::all_of(trial_.searches, [at](const CheckSearch& one) { return one.is_constant(at); });
  }
  std::byte byte_at(std::size_t kind, std::size_t at) const {
    const std::size_t anchor = anchors_[kind], place = anchor - std::min(anchor, trial_.before) + at;
    return place < stream_.size() ? stream_[place] : std::byte{0};
  }

  // The stream begins with a frame, as captures often do.
  bool is_first(std::size_t begin) const {
    const std::size_t length = trial_.split.kinds.front().length, first = earliest_ + begin;
    return trial_.is_cyclic() ? first % length == 0 && first <= 2 * length
                              : first == trial_.before || first == trial_.before + length;
  }

  // A check and its ranges end at `end` in the frame: the frame ends there, or with a constant byte or two.
  double looks_of_end(std::size_t kind, std::size_t begin, std::size_t end) const {
    const std::size_t length = trial_.split.kinds[kind].length;
    if (end == length) return 6;
    if (end > length || length - end > longest_end) return 0;
    for (std::size_t at = end; at < length; ++at)
      if (!trial_.searches[kind].is_constant(begin + at)) return 0;
    const std::byte last = byte_at(kind, begin + length - 1);
    if (length - end == longest_end) return last == std::byte{0x0A} ? 9 : 3;
    return is_usual_end(last) ? 7 : 4;
  }

  double looks_of_header(std::size_t begin, bool follows_check) const {
    if (!is_constant(begin)) return -6;
    std::size_t header = 0;
    while (header < longest_header && is_constant(begin + header) &&
           is_header(byte_at(0, begin + header), follows_check))
      ++header;
    // Behind a check, two bytes are as good as four, of which the first ones may be the end of the frame.
    if (!follows_check) return 1 + 2 * static_cast<double>(header);
    constexpr std::array<double, longest_header + 1> by_length = {1, 4, 5, 5, 5};
    return by_length[header];
  }

  const Trial& trial_;
  std::span<const std::byte> stream_;
  std::vector<std::size_t> anchors_;  // of a frame of each kind, in the stream
  std::size_t earliest_ = 0;
};

}  // namespace

bool is_high_byte(std::byte byte) noexcept {
  const auto number = std::to_integer<unsigned>(byte), exponent = number & 0x7FU;
  return number < 0x10 || number == 0xFF || (exponent >= 0x3A && exponent <= 0x42);
}

void choose_begin(Trial& trial, std::span<const std::byte> stream) {
  constexpr double nearly = 2;  // looks that do not decide
  const BeginRating rating(trial, stream);
  std::vector<Rating> all;
  // With frames of one length, the last beginning is equivalent to the first.
  for (std::size_t begin = 0; begin < trial.before + (trial.is_cyclic() ? 0 : 1); ++begin)
    all.push_back(rating.of(begin));
  const auto best = std::ranges::max_element(all, [](const Rating& a, const Rating& b) {
    return std::pair(a.inside, a.looks) < std::pair(b.inside, b.looks);
  });
  trial.begin = static_cast<std::size_t>(best - all.begin());
  trial.other_begins.clear();
  const auto length = static_cast<std::ptrdiff_t>(trial.split.kinds.front().length);
  for (auto other = all.begin(); other != all.end(); ++other) {
    if (other == best || other->inside != best->inside || other->looks + nearly < best->looks) continue;
    std::ptrdiff_t later = other - best;
    if (trial.is_cyclic() && 2 * std::abs(later) > length) later += later < 0 ? length : -length;
    trial.other_begins.push_back(later);
  }
  std::ranges::sort(trial.other_begins, {}, [](std::ptrdiff_t later) { return std::abs(later); });
}

std::optional<FoundCheck> in_frame(const Trial& trial, std::size_t kind, FoundCheck check) {
  const auto by = moved(check, trial.begin, trial.split.kinds[kind].length, trial.is_cyclic());
  if (!by) return std::nullopt;
  const auto move = [by](std::size_t& at) { at = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(at) + *by); };
  std::erase_if(check.forms,
                [by](const FoundCheck::Form& form) { return static_cast<std::ptrdiff_t>(form.begin) + *by < 0; });
  if (check.forms.empty()) return std::nullopt;
  for (FoundCheck::Form& form : check.forms) move(form.begin);
  move(check.at);
  for (auto& [first, last] : check.ranges) {
    move(first);
    move(last);
  }
  return check;
}

}  // namespace imud
