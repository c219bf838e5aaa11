// FrameWriter and FieldReader: write and read numbers one after another, in one byte order.
#pragma once

#include <algorithm>
#include <bit>
#include <boost/endian/conversion.hpp>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>

#include "core/frame.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {

// Writes one frame of at most `longest` bytes into a FrameBuffer; a number that does not fit is omitted. An
// integer takes sizeof(its type) bytes. Allocates nothing.
template <boost::endian::order Order>
class FrameWriter {
 public:
  FrameWriter(FrameBuffer& out, std::size_t longest) noexcept : out_(out), room_(out.room(longest)) {}

  template <class Number>
  void put(Number number) noexcept {
    if constexpr (std::is_same_v<Number, float>) {
      put(std::bit_cast<std::uint32_t>(number));
    } else if constexpr (std::is_same_v<Number, double>) {
      put(std::bit_cast<std::uint64_t>(number));
    } else {
      const Number ordered = boost::endian::conditional_reverse<boost::endian::order::native, Order>(number);
      put_bytes(&ordered, sizeof ordered);
    }
  }
  void put_float(double number) noexcept { put(to_float(number)); }
  void put_floats(const Vector3& vector) noexcept {
    for (int i = 0; i < 3; ++i) put_float(vector[i]);
  }
  void put_doubles(const Vector3& vector) noexcept {
    for (int i = 0; i < 3; ++i) put(vector[i]);
  }
  void put_text(std::string_view text) noexcept { put_bytes(text.data(), text.size()); }
  // Writes the lowest `bytes` bytes, 1 to 8, big-endian.
  void put_low_bytes(std::uint64_t number, unsigned bytes) noexcept {
    static_assert(Order == boost::endian::order::big);
    const std::uint64_t ordered = boost::endian::native_to_big(number << (64 - 8 * bytes));
    put_bytes(&ordered, bytes);
  }
  // Writes `number` in two's complement of `bytes` bytes, rounded to the nearest integer and saturated.
  void put_rounded(double number, unsigned bytes) noexcept {
    const auto end = static_cast<double>(std::uint64_t{1} << (8 * bytes - 1));
    put_low_bytes(static_cast<std::uint64_t>(to_integer(std::clamp(number, -end, end - 1))), bytes);
  }
  void fill(std::size_t size) noexcept {  // appends zeros up to `size` bytes
    while (size_ < std::min(size, room_.size())) put(std::uint8_t{0});
  }
  void set_byte(std::size_t at, std::size_t byte) noexcept {
    if (at < size_) room_[at] = static_cast<std::byte>(byte);
  }

  std::size_t size() const noexcept { return size_; }
  std::span<const std::byte> written() const noexcept { return room_.first(size_); }
  // Appends the frame to the FrameBuffer, unless the frame is empty. `uart`: Frame::uart.
  void push(std::uint8_t uart = 0) noexcept {
    if (size_ > 0) out_.push(size_, {}, uart);
  }

 private:
  void put_bytes(const void* bytes, std::size_t size) noexcept {
    if (room_.size() < size_ + size) return;
    std::memcpy(room_.data() + size_, bytes, size);
    size_ += size;
  }

  FrameBuffer& out_;
  std::span<std::byte> room_;
  std::size_t size_ = 0;
};

// Reads numbers from bytes; returns 0 when too few bytes are left.
template <boost::endian::order Order>
class FieldReader {
 public:
  explicit FieldReader(std::span<const std::byte> bytes) noexcept : rest_(bytes) {}

  template <class Number>
  Number take() noexcept {
    if constexpr (std::is_same_v<Number, float>) {
      return std::bit_cast<float>(take<std::uint32_t>());
    } else if constexpr (std::is_same_v<Number, double>) {
      return std::bit_cast<double>(take<std::uint64_t>());
    } else {
      Number number = 0;
      is_whole_ = is_whole_ && rest_.size() >= sizeof number;
      if (!is_whole_) return 0;
      std::memcpy(&number, rest_.data(), sizeof number);
      rest_ = rest_.subspan(sizeof number);
      return boost::endian::conditional_reverse<Order, boost::endian::order::native>(number);
    }
  }
  Vector3 take_floats() noexcept {
    Vector3 vector;
    for (int i = 0; i < 3; ++i) vector[i] = static_cast<double>(take<float>());
    return vector;
  }
  bool is_whole() const noexcept { return is_whole_; }                  // no read lacked bytes
  bool is_done() const noexcept { return is_whole_ && rest_.empty(); }  // is_whole(), and all bytes are read

 private:
  std::span<const std::byte> rest_;
  bool is_whole_ = true;
};

}  // namespace imud
