// Frames that carry their number and a checksum, and a reader that checks whether a stream consists of such frames.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/frame.hpp"

namespace imud {

// Makes frames 0, 1, 2, ... of different lengths: mark, length, number, filling, sum.
class NumberedFrames {
 public:
  static constexpr std::size_t head = 8;
  static constexpr std::uint8_t mark = 0xA5;

  // Returns the next `count` frames, valid until the next call.
  std::span<const Frame> next(std::size_t count) {
    buffer_.clear();
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t number = made_++;
      const auto filling = static_cast<std::uint16_t>(number * 37 % 211);
      const auto frame = buffer_.room(head + filling + 1);
      frame[0] = frame[1] = std::byte{mark};
      std::memcpy(&frame[2], &filling, sizeof filling);
      std::memcpy(&frame[4], &number, sizeof number);
      for (std::size_t k = 0; k < filling; ++k) frame[head + k] = static_cast<std::byte>(number + k);
      frame[head + filling] = sum(frame.first(head + filling));
      buffer_.push(frame.size());
    }
    return buffer_.frames();
  }
  std::uint32_t made() const { return made_; }

  static std::byte sum(std::span<const std::byte> bytes) {
    std::byte result{0x5C};
    for (const std::byte byte : bytes)
      result = std::byte(std::to_integer<unsigned>(result) * 31U + std::to_integer<unsigned>(byte));
    return result;
  }

 private:
  FrameBuffer buffer_;
  std::uint32_t made_ = 0;
};

// Reads a stream in pieces of any length.
class NumberedReader {
 public:
  void feed(std::span<const std::byte> bytes) {
    stream_.insert(stream_.end(), bytes.begin(), bytes.end());
    std::size_t at = 0;
    while (stream_.size() - at >= NumberedFrames::head) {
      const std::span<const std::byte> rest = std::span(stream_).subspan(at);
      std::uint16_t filling = 0;
      std::uint32_t number = 0;
      std::memcpy(&filling, &rest[2], sizeof filling);
      std::memcpy(&number, &rest[4], sizeof number);
      const std::size_t size = NumberedFrames::head + filling;
      const bool marked = rest[0] == std::byte{NumberedFrames::mark} && rest[1] == rest[0];
      if (marked && rest.size() <= size) break;
      if (!marked || rest[size] != NumberedFrames::sum(rest.first(size)) ||
          (!numbers.empty() && number <= numbers.back())) {
        ++broken;
        ++at;
        continue;
      }
      numbers.push_back(number);
      at += size + 1;
    }
    stream_.erase(stream_.begin(), stream_.begin() + static_cast<std::ptrdiff_t>(at));
  }
  // Returns the number of bytes of an incomplete frame.
  std::size_t unfinished() const { return stream_.size(); }

  std::vector<std::uint32_t> numbers;  // of the whole frames, in order
  std::size_t broken = 0;              // bytes that belong to no frame, or to a frame out of order

 private:
  std::vector<std::byte> stream_;
};

}  // namespace imud
