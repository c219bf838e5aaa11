// SignalPages: the multiplexing of a CAN message. The value of a multiplexor selects a page: the set of other
// signals that are present. A multiplexor may itself be on a page of another multiplexor, and a message may have
// several multiplexors (extended multiplexing, SG_MUL_VAL_ of DBC files).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace imud {

struct CanSignal;

// Values of a multiplexor; both ends are included.
struct PageRange {
  std::uint32_t first = 0, last = 0;
};

// A signal is identified by its index in the table. Only the constructor throws or allocates.
class SignalPages {
 public:
  SignalPages() = default;
  // `is_sent`: for each signal, whether it has a source. The pages with such a signal are sent in ascending order;
  // a multiplexor without such a page keeps its initial value. Throws std::invalid_argument, whose message begins
  // with the signal's name, if the multiplexor of a signal with a source is missing, is no integer, does not have
  // the page, has a source itself, or depends on itself.
  SignalPages(std::span<const CanSignal> signals, const std::vector<bool>& is_sent);

  // Returns true if the signal is a multiplexor with pages that are sent.
  bool selects(std::size_t signal) const noexcept { return entries_[signal].size > 0; }
  // Returns the value of a multiplexor in the message number `count`. A multiplexor that is itself on a page
  // advances to its next value once per cycle of the multiplexor of that page.
  std::uint64_t page(std::size_t multiplexor, std::uint64_t count) const noexcept;
  // Return true if the signal is present in the message number `count`, or in this message.
  bool is_present(std::size_t signal, std::uint64_t count) const noexcept;
  bool is_present(std::size_t signal, std::span<const std::byte> message) const noexcept;
  // Returns true if one message can contain both signals.
  bool may_meet(std::size_t one, std::size_t other) const noexcept;

 private:
  struct Entry {
    std::optional<std::size_t> multiplexor;  // on which the signal depends
    std::vector<PageRange> pages;            // of that multiplexor
    unsigned start = 0, length = 1;
    bool motorola = false;
    std::uint64_t initial = 0;
    std::vector<PageRange> sent;  // of a multiplexor: the values that are sent, ascending, disjoint
    std::uint64_t size = 0;       // number of values in `sent`
  };
  std::uint64_t turn(std::size_t multiplexor, std::uint64_t count) const noexcept;
  void add_sent(std::span<const CanSignal> signals, std::size_t signal);

  std::vector<Entry> entries_;  // as the signals
};

}  // namespace imud
