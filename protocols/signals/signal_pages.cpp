#include "protocols/signals/signal_pages.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "protocols/signals/can_signals.hpp"
#include "protocols/wire/bits.hpp"

namespace imud {
namespace {

[[noreturn]] void refuse_pages(const CanSignal& signal, const std::string& fault) {
  throw std::invalid_argument(std::string(signal.name) + ": " + fault);
}

bool contains(std::span<const PageRange> ranges, std::uint64_t value) noexcept {
  return std::ranges::any_of(ranges,
                             [&](const PageRange& range) { return value >= range.first && value <= range.last; });
}

bool intersect(std::span<const PageRange> some, std::span<const PageRange> others) noexcept {
  return std::ranges::any_of(some, [&](const PageRange& one) {
    return std::ranges::any_of(
        others, [&](const PageRange& other) { return one.first <= other.last && other.first <= one.last; });
  });
}

// Sorts the ranges, and joins overlapping ranges.
void join(std::vector<PageRange>& ranges) {
  std::ranges::sort(ranges, {}, &PageRange::first);
  std::vector<PageRange> joined;
  for (const PageRange& range : ranges) {
    if (!joined.empty() && range.first <= joined.back().last)
      joined.back().last = std::max(joined.back().last, range.last);
    else
      joined.push_back(range);
  }
  ranges = std::move(joined);
}

}  // namespace

SignalPages::SignalPages(std::span<const CanSignal> signals, const std::vector<bool>& is_sent) {
  for (const CanSignal& signal : signals) {
    Entry entry;
    entry.pages.assign(signal.pages.begin(), signal.pages.end());
    entry.start = signal.start;
    entry.length = signal.length;
    entry.motorola = signal.encoding.motorola;
    entry.initial = signal.initial & low_bits(signal.length);
    if (!entry.pages.empty()) {
      const auto found = std::ranges::find(signals, signal.multiplexor, &CanSignal::name);
      if (found != signals.end()) entry.multiplexor = static_cast<std::size_t>(found - signals.begin());
    }
    entries_.push_back(std::move(entry));
  }
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    std::size_t depth = 0;
    for (auto at = entries_[i].multiplexor; at; at = entries_[*at].multiplexor)
      if (++depth > entries_.size()) refuse_pages(signals[i], "its multiplexor depends on itself");
  }
  for (std::size_t i = 0; i < entries_.size(); ++i)
    if (is_sent[i]) add_sent(signals, i);
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    Entry& entry = entries_[i];
    if (entry.sent.empty()) continue;
    if (is_sent[i]) refuse_pages(signals[i], "selects the page, and so has no value of its own");
    join(entry.sent);
    for (const PageRange& range : entry.sent) entry.size += std::uint64_t{range.last} - range.first + 1;
  }
}

// Adds the pages of a signal to the sent pages, with the pages of the multiplexors on which the signal depends.
void SignalPages::add_sent(std::span<const CanSignal> signals, std::size_t signal) {
  for (std::size_t at = signal; !entries_[at].pages.empty(); at = *entries_[at].multiplexor) {
    const Entry& entry = entries_[at];
    if (!entry.multiplexor) refuse_pages(signals[at], "its message has no multiplexor");
    Entry& multiplexor = entries_[*entry.multiplexor];
    const SignalFormat format = signals[*entry.multiplexor].encoding.format;
    if (format == SignalFormat::float32 || format == SignalFormat::float64)
      refuse_pages(signals[*entry.multiplexor], "a multiplexor must be an integer");
    for (const PageRange& range : entry.pages) {
      if (range.first > range.last || (multiplexor.length < 32 && range.last >> multiplexor.length != 0))
        refuse_pages(signals[at], "its multiplexor does not have the value " + std::to_string(range.last));
      multiplexor.sent.push_back(range);
    }
  }
}

std::uint64_t SignalPages::turn(std::size_t multiplexor, std::uint64_t count) const noexcept {
  const auto parent = entries_[multiplexor].multiplexor;
  return parent ? turn(*parent, count) / std::max<std::uint64_t>(entries_[*parent].size, 1) : count;
}

std::uint64_t SignalPages::page(std::size_t multiplexor, std::uint64_t count) const noexcept {
  const Entry& entry = entries_[multiplexor];
  if (entry.size == 0) return entry.initial;
  std::uint64_t rest = turn(multiplexor, count) % entry.size;
  for (const PageRange& range : entry.sent) {
    const std::uint64_t size = std::uint64_t{range.last} - range.first + 1;
    if (rest < size) return range.first + rest;
    rest -= size;
  }
  return entry.initial;  // not reached
}

bool SignalPages::is_present(std::size_t signal, std::uint64_t count) const noexcept {
  const Entry& entry = entries_[signal];
  if (entry.pages.empty()) return true;
  return entry.multiplexor && is_present(*entry.multiplexor, count) &&
         contains(entry.pages, page(*entry.multiplexor, count));
}

bool SignalPages::is_present(std::size_t signal, std::span<const std::byte> message) const noexcept {
  const Entry& entry = entries_[signal];
  if (entry.pages.empty()) return true;
  if (!entry.multiplexor || !is_present(*entry.multiplexor, message)) return false;
  const Entry& multiplexor = entries_[*entry.multiplexor];
  return contains(entry.pages, read_bits(message, multiplexor.start, multiplexor.length, multiplexor.motorola));
}

bool SignalPages::may_meet(std::size_t one, std::size_t other) const noexcept {
  for (std::optional<std::size_t> a = one; a; a = entries_[*a].multiplexor)
    for (std::optional<std::size_t> b = other; b; b = entries_[*b].multiplexor) {
      const Entry &some = entries_[*a], &others = entries_[*b];
      if (some.multiplexor && some.multiplexor == others.multiplexor && !intersect(some.pages, others.pages))
        return false;
    }
  return true;
}

}  // namespace imud
