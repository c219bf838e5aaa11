// RecordSearch: finds the records of a binary stream one by one, and resynchronises after corruption. FrameSearch
// (frame_search.hpp) is its counterpart where a parser may process all that has been received at once.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace imud {

// Holds at most one record. After a rejection the search continues at the next byte, so that a false start never
// hides a good record. Only the constructor allocates. One thread.
class RecordSearch {
 public:
  // A parser is a std::size_t(std::span<const std::byte> held); `held` has at least one byte. The parser returns
  // the length of the record at the begin of `held`, `reject` if no record begins there, or `need_more` if a
  // record may begin there, but bytes are missing.
  static constexpr std::size_t reject = 0;
  static constexpr std::size_t need_more = ~std::size_t{0};

  explicit RecordSearch(std::size_t longest) : held_(longest) {}

  // Sets the next bytes, which must stay valid until next() has returned nothing.
  void feed(std::span<const std::byte> bytes) noexcept { rest_ = bytes; }
  // Returns true if the parser sees all bytes that have been fed.
  bool sees_all() const noexcept { return rest_.empty(); }

  // Returns the next record, valid until the next call. Returns an empty span once for each run of bytes that
  // belong to no record. Returns nullopt when the input is used up.
  template <class Parser>
  std::optional<std::span<const std::byte>> next(Parser&& parse) noexcept {
    for (;;) {
      const auto held = std::span<const std::byte>(held_).subspan(begin_, end_ - begin_);
      const std::size_t length = held.empty() ? need_more : parse(held);
      if (length == need_more && (held.size() < held_.size() || held.empty())) {
        if (rest_.empty()) return std::nullopt;
        refill();
      } else if (length == reject || length == need_more) {
        ++begin_;
        if (!std::exchange(is_lost_, true)) return std::span<const std::byte>();
      } else {
        begin_ += length;
        is_lost_ = false;
        return held.first(length);
      }
    }
  }

  // Ends the input: discards the held bytes, which are at most an incomplete record, and returns their number.
  std::size_t finish() noexcept {
    is_lost_ = false;
    rest_ = {};
    return std::exchange(end_, 0) - std::exchange(begin_, 0);
  }

 private:
  void refill() noexcept {
    const std::size_t kept = end_ - begin_;
    if (begin_ > 0 && kept > 0) std::memmove(held_.data(), held_.data() + begin_, kept);
    const std::size_t taken = std::min(rest_.size(), held_.size() - kept);
    std::memcpy(held_.data() + kept, rest_.data(), taken);
    begin_ = 0;
    end_ = kept + taken;
    rest_ = rest_.subspan(taken);
  }

  std::vector<std::byte> held_;
  std::size_t begin_ = 0, end_ = 0;
  std::span<const std::byte> rest_;
  bool is_lost_ = false;  // the last byte belonged to no record
};

}  // namespace imud
