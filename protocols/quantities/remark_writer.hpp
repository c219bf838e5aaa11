// RemarkWriter: writes text for people without allocation.
#pragma once

#include <algorithm>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <cstring>
#include <span>
#include <string_view>

namespace imud {

// Appends to a buffer of fixed size. A text that is too long for the buffer ends in "...". Allocates nothing. One
// thread.
class RemarkWriter {
 public:
  explicit RemarkWriter(std::span<char> room) noexcept : room_(room) {}

  RemarkWriter& operator<<(std::string_view text) noexcept {
    const std::size_t left = room_.size() - size_;
    if (!text.empty()) std::memcpy(room_.data() + size_, text.data(), std::min(text.size(), left));
    size_ += std::min(text.size(), left);
    if (text.size() > left) std::fill(room_.end() - std::min<std::ptrdiff_t>(std::ssize(room_), 3), room_.end(), '.');
    return *this;
  }
  template <class Number>
  requires std::integral<Number> || std::floating_point<Number> RemarkWriter& operator<<(Number number) noexcept {
    char text[32];
    return *this << std::string_view(text, std::to_chars(text, std::end(text), number).ptr);
  }
  // Appends the first `most` characters of `text`, which may come from outside imud, in quotes. A byte that is no
  // printable ASCII character becomes '?'.
  RemarkWriter& quote(std::string_view text, std::size_t most = 120) noexcept {
    *this << "\"";
    for (const char c : text.substr(0, most)) *this << (c >= ' ' && c <= '~' ? std::string_view(&c, 1) : "?");
    return *this << (text.size() > most ? "...\"" : "\"");
  }

  std::size_t size() const noexcept { return size_; }

 private:
  std::span<char> room_;
  std::size_t size_ = 0;
};

}  // namespace imud
