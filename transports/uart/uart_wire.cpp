#include "transports/uart/uart_wire.hpp"

#include <algorithm>
#include <bit>

namespace imud {
namespace {

// The levels of characters that are sent back to back; the line is idle before and after them.
class Waveform {
 public:
  Waveform(std::span<const std::byte> characters, const UartSettings& line) noexcept
      : characters_(characters), line_(line), per_character_(line.bits_per_character()) {}

  std::int64_t bits() const noexcept { return static_cast<std::int64_t>(characters_.size()) * per_character_; }

  bool level(std::int64_t bit) const noexcept {
    if (bit < 0 || bit >= bits()) return true;
    const auto value = std::to_integer<unsigned>(characters_[static_cast<std::size_t>(bit / per_character_)]);
    const auto at = static_cast<unsigned>(bit % per_character_);
    if (at == 0) return false;
    if (at <= 8) return (value >> (at - 1) & 1U) != 0;
    if (at > 9 || line_.parity == Parity::none) return true;
    return (std::popcount(value) % 2 != 0) == (line_.parity == Parity::even);
  }
  bool falls(std::int64_t bit) const noexcept { return level(bit - 1) && !level(bit); }

 private:
  std::span<const std::byte> characters_;
  UartSettings line_;
  std::int64_t per_character_;
};

}  // namespace

void UartWire::set(const UartSettings& sender, unsigned receiver_baud) noexcept {
  if (sender == sender_ && receiver_baud == receiver_baud_) return;
  sender_ = sender;
  receiver_baud_ = receiver_baud;
  next_ = bit_ = 0;
}

std::size_t UartWire::carry(std::span<const std::byte> sent, std::span<std::byte> received) noexcept {
  const Waveform wave(sent, sender_);
  const std::int64_t sender_bit = 2 * std::int64_t{receiver_baud_}, receiver_bit = 2 * std::int64_t{sender_.baud};
  const std::int64_t end = wave.bits() * sender_bit;
  const unsigned stop_bit = sender_.parity == Parity::none ? 10 : 11;
  std::size_t count = 0;
  while (true) {
    if (bit_ == 0) {
      std::int64_t edge = (next_ + sender_bit - 1) / sender_bit;
      while (edge < wave.bits() && !wave.falls(edge)) ++edge;
      next_ = edge * sender_bit;
      if (next_ >= end) break;
      next_ += receiver_bit / 2;
      bit_ = 1;
      data_ = 0;
    }
    if (next_ >= end) break;
    const bool level = wave.level(next_ / sender_bit);
    if (bit_ == stop_bit) {
      if (count < received.size()) received[count++] = static_cast<std::byte>(data_);
      bit_ = 0;
    } else if (bit_ == 1 && level) {
      bit_ = 0;
    } else {
      if (bit_ >= 2 && bit_ <= 9 && level) data_ |= 1U << (bit_ - 2);
      ++bit_;
      next_ += receiver_bit;
    }
  }
  next_ = std::max<std::int64_t>(next_ - end, 0);
  return count;
}

std::optional<std::byte> UartWire::idle() noexcept {
  const unsigned bit = bit_;
  next_ = bit_ = 0;
  if (bit <= 1) return std::nullopt;  // no character: the start bit ended before its middle
  unsigned data = data_;
  for (unsigned rest = bit; rest <= 9; ++rest) data |= 1U << (rest - 2);
  return static_cast<std::byte>(data);
}

}  // namespace imud
