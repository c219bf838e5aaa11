#include "tools/checks/check_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "protocols/wire/bits.hpp"
#include "tools/checks/crc_solver.hpp"

namespace imud {
namespace {

constexpr std::size_t most_windows = 128;
constexpr std::size_t most_pairs = 3;     // in which candidates are sought; damaged frames have none
constexpr std::size_t most_starts = 160;  // of ranges
constexpr std::size_t most_candidates = 100'000;
// Shares of frames that agree, or of bytes that are the same: the rest is damage.
constexpr double holds_share = 0.75, form_share = 0.85;
constexpr double least_share = 0.6;  // of the varying bytes, or:
constexpr std::size_t many_bytes = 8;
constexpr double most_chance_log2 = -10;

bool is_share(std::size_t part, std::size_t whole, double share) {
  return static_cast<double>(part) >= share * static_cast<double>(whole);
}

// The byte orders to try for words, and for the check behind them.
constexpr bool orders[] = {false, true};
std::span<const bool> word_orders(const CheckRule& rule) {
  return std::span(orders).first(rule.word_size > 1 ? 2 : 1);
}
std::span<const bool> check_orders(const CheckRule& rule, bool words) {
  if (rule.word_size > 1) return std::span(orders).subspan(words ? 1 : 0, 1);
  return std::span(orders).first(rule.size == 1 || rule.kind == CheckRule::Kind::fletcher ? 1 : 2);
}

}  // namespace

bool FoundCheck::Form::has_constant() const {
  return std::ranges::any_of(extra, [](std::byte one) { return one != std::byte{0}; });
}

bool FoundCheck::is_whole() const {
  const Form& form = forms.front();
  constexpr std::size_t many_frames = 64;
  return share >= whole_share && (size > 1 || !form.has_constant()) &&
         (!form.own || (size > 1 && compared >= many_frames));
}

std::vector<FrameCheck::Range> FoundCheck::ranges_of(const Form& form) const {
  std::vector<FrameCheck::Range> all = ranges;
  all.front().first = form.begin;
  return all;
}

CheckSearch::CheckSearch(std::vector<Window> windows, std::size_t length) : length_(length) {
  const std::size_t step = std::max<std::size_t>(1, windows.size() / most_windows);
  for (std::size_t i = 0; i < windows.size() && windows_.size() < most_windows; i += step)
    windows_.push_back(windows[i]);
  const std::size_t size = windows_.empty() ? 0 : windows_.front().size();
  varies_.resize(size);
  for (std::size_t at = 0; at < size; ++at) {
    std::array<std::size_t, 256> counts{};
    for (const Window& window : windows_) ++counts[std::to_integer<std::size_t>(window[at])];
    varies_[at] = !is_share(*std::ranges::max_element(counts), windows_.size(), constant_share);
  }
  for (std::size_t at = 0; at < size; ++at)
    if (varies_[at]) starts_.push_back(at);
  if (starts_.size() > most_starts)
    std::erase_if(starts_, [this](std::size_t at) { return at > 0 && varies_[at - 1]; });
  if (starts_.size() > most_starts) starts_.resize(most_starts);
}

std::size_t CheckSearch::varying_in(std::size_t begin, std::size_t end) const {
  return static_cast<std::size_t>(std::count(varies_.begin() + static_cast<std::ptrdiff_t>(begin),
                                             varies_.begin() + static_cast<std::ptrdiff_t>(end), true));
}

void CheckSearch::before_pair(const std::vector<CheckRule>& rules, std::size_t first_end, std::size_t pair,
                              std::vector<Candidate>& found) const {
  const Window one = windows_[2 * pair], other = windows_[2 * pair + 1];
  for (const CheckRule& rule : rules)
    for (const bool words : word_orders(rule))
      for (const std::size_t start : starts_)
        // The first word may begin with constant bytes.
        for (std::size_t back = 0; back < std::min(rule.word_size, start + 1); ++back) {
          const std::size_t begin = start - back;
          if (back > 0 && varies_[begin]) break;
          CheckDifference difference(rule, words);
          for (std::size_t end = begin; end + rule.size <= one.size() && end + rule.size - begin <= length_; ++end) {
            if (end > begin && end + rule.size > first_end && difference.is_whole() &&
                varying_in(end, end + rule.size) > 0)
              for (const bool order : check_orders(rule, words))
                if (difference.agrees(one, other, end, order) && found.size() < most_candidates)
                  found.push_back({&rule, {{begin, end}}, end, order});
            difference.add(one[end], other[end]);
          }
        }
}

void CheckSearch::after_pair(const std::vector<CheckRule>& rules, std::size_t first_end, std::size_t pair,
                             std::vector<Candidate>& found) const {
  constexpr std::size_t longest_head = 8;
  const Window one = windows_[2 * pair], other = windows_[2 * pair + 1];
  for (const CheckRule& rule : rules) {
    if (rule.zeros != 0) continue;
    for (const bool words : word_orders(rule))
      for (const std::size_t start : starts_) {
        // The check begins at a byte that varies, or its high bytes are constant.
        for (std::size_t at = start - std::min(start, rule.size - 1); at <= start; ++at)
          for (std::size_t head = at - std::min(at, longest_head); head <= at; ++head) {
            // A range that begins with constant bytes is equivalent to a range that begins after them.
            if (head != at && !varies_[head]) continue;
            CheckDifference difference(rule, words);
            for (std::size_t i = head; i < at; ++i) difference.add(one[i], other[i]);
            for (std::size_t end = at + rule.size; end < one.size() && end < head + length_;) {
              difference.add(one[end], other[end]);
              if (++end <= first_end || !difference.is_whole()) continue;
              for (const bool order : check_orders(rule, words))
                if (difference.agrees(one, other, at, order) && found.size() < most_candidates)
                  found.push_back({&rule, {{head, at}, {at + rule.size, end}}, at, order});
            }
          }
      }
  }
}

bool CheckSearch::holds(const Candidate& candidate) const {
  constexpr std::size_t few = 8, fewest = 4;
  std::size_t agreed = 0, compared = 0;
  for (std::size_t i = 0; i + 1 < windows_.size(); ++i) {
    agreed += agrees(*candidate.rule, candidate.ranges, candidate.at, candidate.is_big, windows_[i], windows_[i + 1]);
    if (++compared == few && agreed < fewest) return false;
  }
  return is_share(agreed, compared, holds_share);
}

std::size_t CheckSearch::frame_begin(const FoundCheck& check) const {
  const std::size_t end = std::max(check.at + check.size, check.ranges.back().second);
  return end > length_ ? end - length_ : 0;
}

std::size_t CheckSearch::agreeing(const FoundCheck& check, const FoundCheck::Form& form) const {
  std::vector<FrameDescription::Check> own;
  if (form.own) own.push_back({"own", *form.own});
  const auto known = FrameCheck::find(form.own ? "own" : form.name, own);
  const std::vector<FrameCheck::Range> ranges = check.ranges_of(form);
  std::size_t bytes = form.extra.size(), count = 0;
  for (const auto& [begin, end] : ranges) bytes += end - begin;
  if (!known || bytes % known->word_size() != 0) return 0;
  const std::uint64_t mask = low_bits(static_cast<unsigned>(8 * check.size));
  constexpr std::size_t few = 8, fewest = 3;
  for (std::size_t i = 0; i < windows_.size(); ++i) {
    const Window window = windows_[i];
    if (i == few && count < fewest) return 0;
    count += (known->of(window, ranges, form.extra, check.is_big) & mask) ==
             number_at(window, check.at, check.size, check.is_big);
  }
  return count;
}

void CheckSearch::find_forms(const Candidate& candidate, FoundCheck& check) const {
  const std::size_t last = candidate.ranges.front().first;
  const std::size_t lowest = frame_begin(check);
  std::size_t first = last;
  while (first > lowest && !varies_[first - 1]) --first;
  const unsigned extras = candidate.rule->is_extra_known ? 1 : 256;
  for (std::size_t begin = first; begin <= last; ++begin)
    for (const std::string& name : candidate.rule->names)
      for (unsigned extra = 0; extra < extras; ++extra) {
        FoundCheck::Form form{name, begin, std::vector(candidate.rule->zeros, static_cast<std::byte>(extra))};
        const std::size_t count = agreeing(check, form);
        if (!is_share(count, windows_.size(), form_share)) continue;
        check.forms.push_back(std::move(form));
        check.agreeing = std::max(check.agreeing, count);
      }
  if (check.forms.empty() && candidate.rule->is_extra_known) find_own_forms(candidate, check);
}

// Adds forms for the whole range that have an own initial value, or cover a further byte that is not sent.
void CheckSearch::find_own_forms(const Candidate& candidate, FoundCheck& check) const {
  const CheckRule& rule = *candidate.rule;
  std::size_t first = candidate.ranges.front().first;
  const std::size_t lowest = frame_begin(check);
  const auto add = [&](FoundCheck::Form form) {
    const std::size_t count = agreeing(check, form);
    if (!is_share(count, windows_.size(), form_share)) return;
    check.agreeing = std::max(check.agreeing, count);
    check.forms.push_back(std::move(form));
  };
  if (rule.kind == CheckRule::Kind::crc) {
    if (candidate.ranges.size() > 1) return;
    while (first > lowest && !varies_[first - 1]) --first;
    const std::uint64_t all = low_bits(static_cast<unsigned>(8 * rule.size));
    // The initial values 0 and all ones are the most probable ones.
    std::vector<FoundCheck::Form> others;
    for (std::size_t begin = first; begin <= candidate.ranges.front().first; ++begin)
      for (const std::uint64_t xorout : {std::uint64_t{0}, all})
        for (std::size_t i = 0; i < std::min<std::size_t>(windows_.size(), 3); ++i) {
          FoundCheck::Form form{"", begin, std::vector<std::byte>(rule.zeros), rule.parameters};
          form.own->xorout = xorout;
          form.own->init = initial_value(*form.own, windows_[i].subspan(begin, candidate.at - begin), rule.zeros,
                                         number_at(windows_[i], check.at, check.size, check.is_big));
          if (form.own->init == 0 || form.own->init == all)
            add(std::move(form));
          else if (xorout == 0 && begin == first)
            others.push_back(std::move(form));
          if (!check.forms.empty()) return;
        }
    for (FoundCheck::Form& form : others)
      if (check.forms.empty()) add(std::move(form));
    return;
  }
  // A sum of few bytes with a constant would also fit relations of the data.
  if (rule.size != 1 || check.share < whole_share ||
      varying_in(candidate.ranges.back().first, candidate.ranges.back().second) < many_bytes)
    return;
  for (const std::string& name : rule.names)
    for (unsigned extra = 1; extra < 256 && check.forms.empty(); ++extra)
      add({name, first, {static_cast<std::byte>(extra)}});
}

std::optional<FoundCheck> CheckSearch::resolved(const Candidate& candidate, double tried_log2) const {
  FoundCheck check;
  check.at = candidate.at;
  check.size = candidate.rule->size;
  check.is_big = candidate.is_big;
  check.ranges = candidate.ranges;
  check.compared = windows_.size();
  std::size_t inside = 0;
  for (const auto& [begin, end] : candidate.ranges) inside += varying_in(begin, end);
  const std::size_t begin = frame_begin(check);
  const std::size_t all = varying_in(begin, begin + length_) - varying_in(check.at, check.at + check.size);
  check.share = all == 0 ? 0 : std::min(1.0, static_cast<double>(inside) / static_cast<double>(all));
  if (inside == 0 || (check.share < least_share && inside < many_bytes)) return std::nullopt;
  find_forms(candidate, check);
  if (check.forms.empty()) return std::nullopt;
  std::set<std::uint64_t> values;
  for (const Window& window : windows_) values.insert(number_at(window, check.at, check.size, check.is_big));
  const double bits = 8 * static_cast<double>(check.size);
  const auto distinct = static_cast<double>(std::min(values.size(), check.agreeing));
  check.chance_log2 = tried_log2 - bits * (distinct - 1);
  check.deciding = 1 + static_cast<std::size_t>(std::ceil((tried_log2 - most_chance_log2) / bits));
  if (check.chance_log2 > most_chance_log2) return std::nullopt;
  return check;
}

std::vector<FoundCheck> CheckSearch::chosen(std::vector<FoundCheck> found) const {
  const auto rank = [this](const FoundCheck& check) {
    const bool has_name = !check.forms.front().name.empty() && !check.forms.front().has_constant();
    return std::tuple(!has_name, -std::round(10 * check.share), -static_cast<int>(check.size),
                      check.size - varying_in(check.at, check.at + check.size),
                      -static_cast<std::ptrdiff_t>(check.agreeing), check.at);
  };
  std::ranges::stable_sort(found, {}, rank);
  std::vector<FoundCheck> chosen;
  for (FoundCheck& check : found) {
    FoundCheck* same = nullptr;
    bool overlaps = false;
    for (FoundCheck& other : chosen) {
      if (other.at == check.at && other.size == check.size) same = &other;
      // In the same frame, or in the next one.
      const std::size_t ahead = (check.at + length_ - other.at) % length_;
      overlaps |= ahead < other.size || length_ - ahead < check.size;
    }
    // Another algorithm at the same place is an alternative form, if its range is the same.
    if (same != nullptr && same->is_big == check.is_big && same->ranges.back().second == check.ranges.back().second)
      for (FoundCheck::Form& form : check.forms)
        if (std::ranges::none_of(same->forms, [&](const FoundCheck::Form& one) {
              return one.name == form.name && one.begin == form.begin;
            }))
          same->forms.push_back(std::move(form));
    // Beside a check of the whole frame, a short check must cover the frame's beginning; other short checks are
    // relations of the data.
    const bool is_by_chance =
        check.size == 1 && !chosen.empty() && chosen.front().is_whole() &&
        std::ranges::none_of(check.forms, [&](const FoundCheck::Form& form) {
          return (form.begin + length_ - chosen.front().forms.front().begin % length_) % length_ == 0;
        });
    if (!overlaps && !is_by_chance) chosen.push_back(std::move(check));
  }
  return chosen;
}

std::vector<FoundCheck> CheckSearch::find(Place place, std::size_t first_end) const {
  if (windows_.size() < 4) return {};
  static const std::vector<CheckRule> rules = check_rules();
  const double tried = std::log2(static_cast<double>(rules.size() * 2 * (starts_.size() + 1) * length_));
  std::vector<Candidate> candidates;
  for (std::size_t pair = 0; pair < most_pairs && 2 * pair + 1 < windows_.size(); ++pair) {
    if (place == Place::behind_range)
      before_pair(rules, first_end, pair, candidates);
    else
      after_pair(rules, first_end, pair, candidates);
  }
  const auto key = [](const Candidate& one) { return std::tuple(one.rule, one.at, one.is_big, one.ranges); };
  std::ranges::sort(candidates, {}, key);
  const auto is_same = [&key](const Candidate& one, const Candidate& other) { return key(one) == key(other); };
  candidates.erase(std::unique(candidates.begin(), candidates.end(), is_same), candidates.end());
  std::vector<FoundCheck> found;
  for (const Candidate& candidate : candidates)
    if (holds(candidate))
      if (auto check = resolved(candidate, tried)) found.push_back(std::move(*check));
  return chosen(std::move(found));
}

std::optional<FoundCheck> CheckSearch::adopted(FoundCheck check, std::size_t other_length) const {
  if (check.ranges.size() > 1 || check.forms.front().own || check.at + length_ < other_length) return std::nullopt;
  check.at = check.at + length_ - other_length;
  check.ranges.front() = {0, check.at};
  std::erase_if(check.forms, [&](const FoundCheck::Form& form) {
    check.ranges.front().first = form.begin;
    return form.begin >= check.at || !is_share(agreeing(check, form), windows_.size(), holds_share);
  });
  if (check.forms.empty()) return std::nullopt;
  check.agreeing = agreeing(check, check.forms.front());
  check.compared = windows_.size();
  check.chance_log2 = std::log2(static_cast<double>(check.forms.size())) - 8 * static_cast<double>(check.size);
  check.ranges.front().first = check.forms.front().begin;
  return check;
}

std::vector<FoundCheck> CheckSearch::find_unknown(std::size_t first_end) const {
  constexpr std::size_t fewest = 16;
  if (windows_.size() < fewest) return {};
  const std::size_t size = windows_.front().size();
  std::vector<FoundCheck> found;
  for (std::size_t bytes = 4; bytes > 0; --bytes)
    for (std::size_t end = first_end + 1; end <= size; ++end) {
      const std::size_t begin = end > length_ ? end - length_ : 0, at = end - bytes;
      const std::size_t next = end < size ? end : end - length_;
      if (at <= begin || varies_[next] || varying_in(at, end) != bytes) continue;
      for (const bool refin : {false, true})
        for (const bool refout : {refin, !refin})
          for (const bool is_big : {true, false}) {
            if (bytes == 1 && is_big) continue;
            const auto parameters = find_polynomial(windows_, {{begin, at}, at, bytes, is_big}, refin, refout);
            if (!parameters) continue;
            const CheckRule rule = crc_rule(*parameters);
            std::size_t first = begin;
            while (first < at && !varies_[first]) ++first;
            const Candidate candidate{&rule, {{first, at}}, at, is_big};
            const double tried = 8 * static_cast<double>(bytes) + std::log2(8.0 * static_cast<double>(length_));
            if (first == at || !holds(candidate)) continue;
            if (auto check = resolved(candidate, tried)) found.push_back(std::move(*check));
          }
      if (!found.empty()) return chosen(std::move(found));
    }
  return {};
}

}  // namespace imud
