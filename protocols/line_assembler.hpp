// LineAssembler: pieces of text in, whole lines out.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

namespace imud {

// Any cutting of a text into pieces gives the same lines. A line is whole when its end is there. Holds at most `Max`
// characters of one unfinished line, in memory of its own; allocates nothing. One thread.
//
// feed() and next() are for text that arrives in pieces; append(), erase_last() and finish_line() for a device that
// echoes and corrects each character as a person types it.
template <std::size_t Max>
class LineAssembler {
 public:
  struct Line {
    std::string_view text;  // without its end; of a line that is too long, its first `Max` characters
    std::size_t size = 0;   // of the whole line, without its end

    bool is_too_long() const noexcept { return size > Max; }
  };

  // Each of `ends`, a text that outlives this, ends a line; where CR and LF both do, CR LF ends a line and an empty
  // one.
  explicit LineAssembler(std::string_view ends = "\n") : ends_(ends) {}

  // Sets the next piece, which has to stay valid until next() has returned nothing.
  void feed(std::string_view piece) noexcept { piece_ = piece; }

  // Returns the next whole line, valid until the next call; nothing when the piece is used up.
  std::optional<Line> next() noexcept {
    const std::size_t end = ends_.size() == 1 ? piece_.find(ends_.front()) : piece_.find_first_of(ends_);
    const std::string_view part = piece_.substr(0, end);
    if (end == std::string_view::npos) {
      hold(part);
      piece_ = {};
      return std::nullopt;
    }
    piece_.remove_prefix(end + 1);
    if (size_ == 0) return Line{part.substr(0, Max), part.size()};
    hold(part);
    return finish_line();
  }

  // The size of the line that has no end yet.
  std::size_t size() const noexcept { return size_; }
  // Ends that line here, as the end of a datagram does. The line is valid until the next call.
  Line finish_line() noexcept {
    const std::size_t size = std::exchange(size_, 0);
    return {{held_.data(), std::min(size, Max)}, size};
  }
  // Drops that line. Returns its size.
  std::size_t drop_line() noexcept { return std::exchange(size_, 0); }

  // Adds one character to that line, an end being no exception. Returns false if there is no room: the line is too
  // long from then on.
  bool append(char c) noexcept {
    hold({&c, 1});
    return size_ <= Max;
  }
  // Takes its last character back. Returns false if it is empty, or too long.
  bool erase_last() noexcept {
    if (size_ == 0 || size_ > Max) return false;
    --size_;
    return true;
  }

 private:
  void hold(std::string_view part) noexcept {
    if (size_ < Max && !part.empty())
      std::memcpy(held_.data() + size_, part.data(), std::min(part.size(), Max - size_));
    size_ += part.size();
  }

  std::string_view ends_;
  std::string_view piece_;
  std::array<char, Max> held_;
  std::size_t size_ = 0;  // of the line so far, even where it exceeds the room for it
};

}  // namespace imud
