// FrameSearch: finds frames in a byte stream, and resynchronises after any corruption.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "protocols/protocol.hpp"

namespace imud {

// Holds the bytes of at most one frame of up to `MaxFrame` bytes, and calls a parser, which defines the frame.
// After a rejection the search continues at the very next byte, so that a false start never hides a good frame.
// Allocates nothing. One thread.
template <std::size_t MaxFrame>
class FrameSearch {
 public:
  // A parser is a std::size_t(std::span<const std::byte> held); `held` has at least one byte. If `held` begins with a
  // whole frame, the parser processes it and returns its length. It returns `reject` if no frame begins at the first
  // byte, and `need_more` if one may begin there, but bytes are missing (never for MaxFrame bytes).
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
  std::size_t size() const noexcept { return count_; }  // of the held bytes

  // Discards the first of the held bytes and searches the rest: for a frame that was not completed in time. Returns
  // how many bytes belonged to no frame.
  template <class Parser>
  std::uint64_t resync(Parser&& parse) {
    return is_empty() ? 0 : search(parse, 1);
  }

  // Ends the input: discards the held bytes, which are an incomplete frame at most, and returns their number.
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

// The base class of a decoder of frames of up to `MaxFrame` bytes.
template <std::size_t MaxFrame>
class FrameDecoder : public Decoder {
 public:
  void feed(const Frame& frame, MeasurementSink& sink) final {
    errors_.skipped_bytes +=
        search_.feed(frame.bytes, [&](std::span<const std::byte> held) { return parse(held, sink); });
  }
  void finish(MeasurementSink&) final { errors_.skipped_bytes += search_.finish(); }

 protected:
  using Search = FrameSearch<MaxFrame>;

 private:
  // The parser of the search.
  virtual std::size_t parse(std::span<const std::byte> held, MeasurementSink& sink) = 0;

  Search search_;
};

}  // namespace imud
