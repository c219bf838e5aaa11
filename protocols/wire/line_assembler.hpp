// LineAssembler: assembles whole lines from pieces of text.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

namespace imud {

// The lines do not depend on how the text is cut into pieces. Stores at most `Max` characters of one unfinished line;
// allocates nothing. One thread.
//
// feed() and next() are for text that arrives in pieces; append(), erase_last() and finish_line() for a device that
// echoes and corrects each character as a person types it.
template <std::size_t Max>
class LineAssembler {
 public:
  struct Line {
    std::string_view text;  // without its end; only the first `Max` characters of a line that is too long
    std::size_t size = 0;   // of the whole line, without its end

    bool is_too_long() const noexcept { return size > Max; }
  };

  // Each character of `ends` ends a line; `ends` must outlive this object. If CR and LF are both in `ends`, CR LF
  // ends one line and then a second, empty line.
  explicit LineAssembler(std::string_view ends = "\n") : ends_(ends) {}

  // Sets the next piece, which must stay valid until next() has returned nothing.
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

  // Returns the size of the unfinished line.
  std::size_t size() const noexcept { return size_; }
  // Ends the unfinished line, for example at the end of a datagram, and returns the line. The line is valid until
  // the next call.
  Line finish_line() noexcept {
    const std::size_t size = std::exchange(size_, 0);
    return {{held_.data(), std::min(size, Max)}, size};
  }
  // Drops the unfinished line and returns its size.
  std::size_t drop_line() noexcept { return std::exchange(size_, 0); }

  // Appends one character to the unfinished line, even a character of `ends`. Returns false if there is no room; the
  // line is then too long.
  bool append(char c) noexcept {
    hold({&c, 1});
    return size_ <= Max;
  }
  // Removes the last character of the unfinished line. Returns false if the line is empty or too long.
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
  std::size_t size_ = 0;  // of the unfinished line, including characters beyond `Max`
};

}  // namespace imud
