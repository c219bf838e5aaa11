// ISO 11898-1:2015, 10.4 (fields), 10.5 (bit stuffing). The fixed stuff bits of CAN FD are from secondary sources,
// and not verified on a bus.
#include "transports/can/can_bits.hpp"

#include <array>

#include "transports/can/can_dlc.hpp"

namespace imud {
namespace {

// CRC delimiter, acknowledgement and its delimiter, end of frame, interframe space: no stuff bits.
constexpr int tail = 1 + 2 + 7 + 3;
constexpr int classic_crc = 15;
// CRC field of CAN FD: a stuff count of 4 bits, the CRC, and fixed stuff bits: one first, and one after every 4 bits.
int fd_crc(std::size_t bytes) noexcept {
  constexpr std::size_t most_with_short_crc = 16;
  return bytes <= most_with_short_crc ? 4 + 17 + 6 : 4 + 21 + 7;
}

// Bits from start of frame to the bit before the data length code (classic), or to the bit rate switch (FD).
int arbitration(const CanHeader& header) noexcept { return (header.fd ? 17 : 15) + (header.extended ? 20 : 0); }

// Bits after the bits of arbitration(), up to the end of the data. A remote frame has a data length code, but no
// data.
int control_and_data(const CanHeader& header, std::size_t bytes) noexcept {
  return (header.fd ? 5 : 4) + (header.remote ? 0 : 8 * static_cast<int>(bytes));
}

// A sender inserts a stuff bit after five equal bits, and counts it as the first bit of the next sequence.
// Computes the expected number of stuff bits in a sequence of bits, some of which are random.
class Stuffing {
 public:
  double expected() const noexcept { return expected_; }
  // Adds the CRC of a classic frame. Requires that no bit added before was random.
  void add_crc() noexcept { add(crc_, classic_crc); }

  void add(bool bit) noexcept {
    const bool feedback = bit != ((crc_ & 0x4000U) != 0);
    crc_ = (crc_ << 1U) & 0x7FFFU;
    if (feedback) crc_ ^= 0x4599U;
    Chances next{};
    for (std::size_t value = 0; value < 2; ++value)
      for (std::size_t run = 1; run < five; ++run) advance(next, value, run, bit ? 1 : 0, chances_[value][run]);
    chances_ = next;
  }
  // The bits of `value` from the highest of `bits` on.
  void add(unsigned value, int bits) noexcept {
    for (int i = bits - 1; i >= 0; --i) add(((value >> static_cast<unsigned>(i)) & 1U) != 0);
  }
  void add_random(int bits) noexcept {
    for (; bits > 0; --bits) {
      Chances next{};
      for (std::size_t value = 0; value < 2; ++value)
        for (std::size_t run = 1; run < five; ++run)
          for (std::size_t bit = 0; bit < 2; ++bit) advance(next, value, run, bit, chances_[value][run] / 2);
      chances_ = next;
    }
  }

 private:
  static constexpr std::size_t five = 5;
  using Chances = std::array<std::array<double, five>, 2>;  // by the last bit, and how often it was repeated

  void advance(Chances& next, std::size_t value, std::size_t run, std::size_t bit, double chance) noexcept {
    const std::size_t length = bit == value ? run + 1 : 1;
    if (length < five) {
      next[bit][length] += chance;
      return;
    }
    expected_ += chance;
    next[1 - bit][1] += chance;
  }

  Chances chances_ = {{{0, 1, 0, 0, 0}, {}}};  // after the start of frame, which is dominant (0)
  double expected_ = 0;
  unsigned crc_ = 0;  // of the bits so far; the start of frame does not change the CRC
};

// All bits from the identifier to the one before the data length code, or to the bit rate switch.
void add_arbitration(Stuffing& stuffing, const CanHeader& header) noexcept {
  constexpr int base = 11, extension = 18;
  if (header.extended) {
    stuffing.add(header.id >> static_cast<unsigned>(extension), base);
    stuffing.add(0b11, 2);  // substitute remote request, identifier extension
    stuffing.add(header.id, extension);
    stuffing.add(header.remote);
    if (!header.fd) stuffing.add(0b00, 2);  // reserved
  } else {
    stuffing.add(header.id, base);
    stuffing.add(header.remote);
    stuffing.add(false);                  // identifier extension
    if (!header.fd) stuffing.add(false);  // reserved
  }
  if (!header.fd) return;
  stuffing.add(0b10, 2);  // FD format, reserved
  stuffing.add(header.bit_rate_switch);
}

CanBits at_their_rates(const CanHeader& header, double nominal, double data) noexcept {
  return header.fd && header.bit_rate_switch ? CanBits{nominal, data} : CanBits{nominal + data, 0.0};
}

}  // namespace

// At worst every fourth bit after the first is followed by a stuff bit (Tindell's bound).
CanBits most_can_bits(const CanHeader& header, std::size_t bytes) noexcept {
  const int first = arbitration(header), rest = control_and_data(header, bytes);
  const int crc = header.fd ? fd_crc(bytes) : classic_crc;
  const int stuffed = first + rest + (header.fd ? 0 : crc);
  const int in_first = (first - 1) / 4, in_all = (stuffed - 1) / 4;
  return at_their_rates(header, first + in_first + tail, rest + crc + in_all - in_first);
}

namespace {

// `add_data` and `add_crc` add these fields to a Stuffing.
template <class AddData, class AddCrc>
CanBits stuffed_bits(const CanHeader& header, std::size_t bytes, AddData add_data, AddCrc add_crc) noexcept {
  Stuffing stuffing;
  add_arbitration(stuffing, header);
  const double in_first = stuffing.expected();
  if (header.fd) stuffing.add(false);  // error state: active
  stuffing.add(dlc_of(bytes), 4);
  if (!header.remote) add_data(stuffing);
  if (!header.fd) add_crc(stuffing);
  return at_their_rates(
      header, arbitration(header) + in_first + tail,
      control_and_data(header, bytes) + (header.fd ? fd_crc(bytes) : classic_crc) + stuffing.expected() - in_first);
}

}  // namespace

CanBits average_can_bits(const CanHeader& header, std::size_t bytes) noexcept {
  return stuffed_bits(
      header, bytes, [bytes](Stuffing& stuffing) { stuffing.add_random(8 * static_cast<int>(bytes)); },
      [](Stuffing& stuffing) { stuffing.add_random(classic_crc); });
}

CanBits can_bits(const Frame& frame) noexcept {
  const auto add_data = [&frame](Stuffing& stuffing) {
    for (const std::byte byte : frame.bytes) stuffing.add(std::to_integer<unsigned>(byte), 8);
  };
  return stuffed_bits(frame.can, frame.bytes.size(), add_data, [](Stuffing& stuffing) { stuffing.add_crc(); });
}

}  // namespace imud
