// FrameSearch: finds frames in a byte stream and finds its way back after any corruption.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace imud {

// Holds the bytes of at most one frame of up to `MaxFrame` bytes, and asks a judge what they begin with. After a
// rejection it searches again from the very next byte, so that no good frame that follows is lost, wherever a false
// start was seen. Owns no policy: the judge knows what a frame is.
template <std::size_t MaxFrame>
class FrameSearch {
 public:
  // What a judge says of the bytes held, never none: no frame begins with the first of them; they may be one, but
  // more bytes are needed (never said of MaxFrame bytes); or a frame's length, done with.
  static constexpr std::size_t reject = 0;
  static constexpr std::size_t need_more = ~std::size_t{0};

  // Returns how many bytes belonged to no frame. `judge`: std::size_t(std::span<const std::byte> held).
  template <class Judge>
  std::uint64_t feed(std::span<const std::byte> bytes, Judge&& judge) {
    std::uint64_t skipped = 0;
    while (!bytes.empty()) {
      const std::size_t taken = std::min(bytes.size(), MaxFrame - count_);
      std::memcpy(held_.data() + count_, bytes.data(), taken);
      count_ += taken;
      bytes = bytes.subspan(taken);
      skipped += settle(judge);
    }
    return skipped;
  }

  bool is_empty() const noexcept { return count_ == 0; }

  // The rest of what is held did not come in time: gives up its first byte and searches on. Returns as feed() does.
  template <class Judge>
  std::uint64_t give_up(Judge&& judge) {
    return is_empty() ? 0 : settle(judge, 1);
  }

  // No more bytes will come: what is held is part of a frame at most. Returns how many bytes it was.
  std::uint64_t finish() noexcept {
    const std::uint64_t skipped = count_;
    count_ = 0;
    return skipped;
  }

 private:
  template <class Judge>
  std::uint64_t settle(Judge& judge, std::size_t begin = 0) {
    std::uint64_t skipped = begin;
    while (begin < count_) {
      const std::size_t length = judge(std::span<const std::byte>(held_.data() + begin, count_ - begin));
      if (length == need_more) break;
      begin += std::max<std::size_t>(length, 1);
      if (length == reject) ++skipped;
    }
    count_ -= begin;
    if (begin > 0 && count_ > 0) std::memmove(held_.data(), held_.data() + begin, count_);
    return skipped;
  }

  std::array<std::byte, MaxFrame> held_;
  std::size_t count_ = 0;
};

}  // namespace imud
