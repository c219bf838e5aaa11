// FrameSearch: finds frames in a byte stream and finds its way back after any corruption.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace imud {

// Holds the bytes of at most one frame of up to `MaxFrame` bytes, and asks a parser how they begin. After a rejection
// it searches again from the very next byte, so that no good frame that follows is lost, wherever a false start was
// seen. It owns no policy: the parser knows what a frame is. It allocates nothing. One thread.
template <std::size_t MaxFrame>
class FrameSearch {
 public:
  // A parser is a std::size_t(std::span<const std::byte> held). It is given the bytes held, at least one, and returns
  // the length of the frame that they begin with, once it has dealt with that frame; `reject` if no frame begins with
  // the first of them; `need_more` if one may, but bytes are missing (never for MaxFrame bytes).
  static constexpr std::size_t reject = 0;
  static constexpr std::size_t need_more = ~std::size_t{0};

  // Returns how many bytes belonged to no frame.
  template <class Parser>
  std::uint64_t feed(std::span<const std::byte> bytes, Parser&& parse) {
    std::uint64_t skipped = 0;
    while (!bytes.empty()) {
      const std::size_t taken = std::min(bytes.size(), MaxFrame - count_);
      std::memcpy(held_.data() + count_, bytes.data(), taken);
      count_ += taken;
      bytes = bytes.subspan(taken);
      skipped += search(parse);
    }
    return skipped;
  }

  bool is_empty() const noexcept { return count_ == 0; }

  // The frame that the held bytes begin was not completed in time: discards its first byte and searches on. Returns
  // as feed() does.
  template <class Parser>
  std::uint64_t resync(Parser&& parse) {
    return is_empty() ? 0 : search(parse, 1);
  }

  // No more bytes will come: discards the bytes held, which are part of a frame at most. Returns how many they were.
  std::uint64_t finish() noexcept {
    const std::uint64_t skipped = count_;
    count_ = 0;
    return skipped;
  }

 private:
  template <class Parser>
  std::uint64_t search(Parser& parse, std::size_t begin = 0) {
    std::uint64_t skipped = begin;
    while (begin < count_) {
      const std::size_t length = parse(std::span<const std::byte>(held_.data() + begin, count_ - begin));
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
