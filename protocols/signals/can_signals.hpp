// CanSignals: encodes and decodes CAN messages whose signals a table describes, as in a DBC file. Encoder and
// decoder use the same table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/frame.hpp"
#include "protocols/measurements/measured_quantities.hpp"
#include "protocols/signals/signal_pages.hpp"
#include "protocols/signals/signal_source.hpp"
#include "protocols/wire/message_checksum.hpp"

namespace imud {

// How the bits of a signal represent a number. `@1+`, `@1-`, `@0+` and `@0-` are the notation of DBC files.
enum class SignalFormat : std::uint8_t { unsigned_integer, signed_integer, float32, float64 };
struct SignalEncoding {
  bool motorola = false;
  SignalFormat format = SignalFormat::unsigned_integer;
};
inline constexpr SignalEncoding intel_unsigned = {false, SignalFormat::unsigned_integer};    // @1+
inline constexpr SignalEncoding intel_signed = {false, SignalFormat::signed_integer};        // @1-
inline constexpr SignalEncoding motorola_unsigned = {true, SignalFormat::unsigned_integer};  // @0+
inline constexpr SignalEncoding motorola_signed = {true, SignalFormat::signed_integer};      // @0-

// A signal of a message. Bit b of byte n has the number 8 n + b; `start` is the signal's lowest bit if its encoding
// is Intel, its highest if Motorola. Physical value = scale * number + offset, in the unit of the source.
struct CanSignal {
  std::string_view name;
  unsigned start = 0;
  unsigned length = 1;  // 1 to 64
  SignalEncoding encoding = {};
  double scale = 1;  // not 0
  double offset = 0;
  // The source of the values: a text of signal_source.hpp; `alive_counter`, the number of the message; `checksum`; or
  // `data_id_nibble`, bits 8 to 11 of the checksum's data id. Empty: the signal has the value `initial`, or selects
  // the page of other signals.
  std::string_view source = "";
  const MeasuredQuantity* quantity = nullptr;  // in place of `source`: a quantity that only this product has, in SI
  std::uint64_t initial = 0;                   // the raw number
  double minimum = 0, maximum = 0;  // physical values at which the signal saturates; if equal: the limits of its bits
  // The signal is present only while the signal `multiplexor` has one of these values; empty: always.
  std::span<const PageRange> pages = {};
  std::string_view multiplexor = "";
};

inline constexpr std::string_view alive_counter_source = "alive_counter";
inline constexpr std::string_view checksum_source = "checksum";
inline constexpr std::string_view data_id_nibble_source = "data_id_nibble";

// Read and write the bits of a field, numbered as in CanSignal. Both require a field within `bytes`.
std::uint64_t read_bits(std::span<const std::byte> bytes, unsigned start, unsigned length, bool motorola) noexcept;
void write_bits(std::span<std::byte> bytes, unsigned start, unsigned length, bool motorola,
                std::uint64_t number) noexcept;

// Packs the signals of one message and unpacks them. Values saturate and are rounded to nearest, halves away from
// zero; of clocks, counters and status the low bits are sent. Only the constructor throws or allocates.
class CanSignalCodec {
 public:
  // Throws std::invalid_argument, whose message begins with the signal's name, if a signal exceeds the message of
  // `size` bytes, two that have a source overlap, or a source or multiplexor does not exist or does not suit.
  // `checksum` is the kind of the signal `checksum`.
  CanSignalCodec(std::size_t size, std::span<const CanSignal> signals, const MessageChecksum& checksum = {});

  std::size_t size() const noexcept { return size_; }
  // Returns true if some messages lack some of the quantities.
  bool is_multiplexed() const noexcept { return is_multiplexed_; }
  // Returns true if the message depends on the increments of the Reading.
  bool has_increments() const noexcept;
  // The components that the message carries, as in ReadBack.
  std::uint32_t components() const noexcept;

  // Writes the message number `count`; the number determines alive counter and multiplexors. The alive counter is
  // `ahead` of the number, modulo 2^64. Requires size() elements in `bytes`. Returns the number of signals whose
  // saturation changed the value by more than half an LSB.
  unsigned encode(const Reading& reading, std::uint64_t count, std::span<std::byte> bytes,
                  std::uint64_t ahead = 0) const noexcept;

  // The low bits of the clock or the counter in a decoded message.
  struct LowBits {
    std::uint64_t value = 0;
    unsigned bits = 0;  // 0: the message has none
  };
  struct Decoded {
    LowBits time, counter;
    std::int64_t time_lsb_ns = 1;
  };
  bool has_checksum() const noexcept { return sum_.has_value(); }
  // Writes the checksum of a message of size() bytes, if it has one.
  void write_checksum(std::span<std::byte> bytes) const noexcept;
  bool has_good_checksum(std::span<const std::byte> bytes) const noexcept;
  // Reads the quantities of a message of size() bytes into `read`. Returns nullopt if a number is not finite.
  std::optional<Decoded> decode(std::span<const std::byte> bytes, ReadBack& read) const noexcept;

 private:
  enum class Source : std::uint8_t { constant, fixed, quantity, alive_counter, multiplexor, checksum };
  struct Field {
    std::size_t signal = 0;  // its index in the table
    unsigned start = 0, length = 1;
    bool motorola = false;
    SignalFormat format = SignalFormat::unsigned_integer;
    Source source = Source::constant;
    const MeasuredQuantity* quantity = nullptr;
    double lsb = 1;                  // SI = (number - whole - fraction) * lsb
    double whole = 0, fraction = 0;  // parts of the number for zero, stored apart so that no digits are lost
    double lowest = 0, highest = 0;  // of the number
    std::int64_t time_lsb_ns = 0;
    std::uint64_t initial = 0;
    // Other forms than a plain quantity: number = (transformed value in `in`'s unit - offset) / scale.
    SignalSource form = {};
    double scale = 1, offset = 0;
    bool is_read_back = true;              // the quantity follows from the message
    std::optional<std::size_t> sign_bits;  // of a magnitude: the index of the signal with the sign
  };
  Field compiled(const CanSignal& signal) const;
  void check_overlaps(std::span<const CanSignal> signals) const;
  void check_checksum(std::span<const CanSignal> signals);
  void join_signs();
  void set_range(Field& field, const CanSignal& signal) const;
  void set_constant(Field& field, const CanSignal& signal, double value) const;
  // Returns the number of the quantity. Adds 1 to `saturated` if the number has saturated.
  std::uint64_t number_of(const Field& field, const Reading& reading, unsigned& saturated) const noexcept;
  std::uint64_t bits_of(const Field& field, std::span<const std::byte> bytes) const noexcept {
    return read_bits(bytes, field.start, field.length, field.motorola);
  }

  std::size_t size_;
  std::vector<Field> fields_;
  SignalPages pages_;
  bool is_multiplexed_ = false;
  std::optional<Field> counter_, sum_;
  MessageChecksum checksum_;
};

}  // namespace imud
