#include "protocols/signals/can_signals.hpp"

#include <algorithm>
#include <bit>
#include <cfloat>
#include <cmath>
#include <stdexcept>
#include <string>

#include "protocols/wire/bits.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {
namespace {

[[noreturn]] void refuse(const CanSignal& signal, const std::string& fault) {
  throw std::invalid_argument(std::string(signal.name) + ": " + fault);
}

// Calls act(byte, lowest bit in this byte, number of bits, lowest bit in the number) for each byte of a field.
template <class Act>
void each_byte(unsigned start, unsigned length, bool motorola, Act act) noexcept {
  if (motorola) {
    unsigned byte = start / 8, highest = start % 8;
    for (unsigned left = length; left > 0; ++byte, highest = 7) {
      const unsigned bits = std::min(left, highest + 1);
      left -= bits;
      act(byte, highest + 1 - bits, bits, left);
    }
  } else {
    for (unsigned done = 0; done < length;) {
      const unsigned bit = start + done, bits = std::min(length - done, 8 - bit % 8);
      act(bit / 8, bit % 8, bits, done);
      done += bits;
    }
  }
}

bool is_float(SignalFormat format) noexcept {
  return format == SignalFormat::float32 || format == SignalFormat::float64;
}

}  // namespace

std::uint64_t read_bits(std::span<const std::byte> bytes, unsigned start, unsigned length, bool motorola) noexcept {
  std::uint64_t number = 0;
  each_byte(start, length, motorola, [&](unsigned byte, unsigned low, unsigned bits, unsigned at) {
    number |= (std::to_integer<std::uint64_t>(bytes[byte]) >> low & low_bits(bits)) << at;
  });
  return number;
}

void write_bits(std::span<std::byte> bytes, unsigned start, unsigned length, bool motorola,
                std::uint64_t number) noexcept {
  each_byte(start, length, motorola, [&](unsigned byte, unsigned low, unsigned bits, unsigned at) {
    const auto kept = std::to_integer<std::uint64_t>(bytes[byte]) & ~(low_bits(bits) << low);
    bytes[byte] = static_cast<std::byte>(kept | (number >> at & low_bits(bits)) << low);
  });
}

CanSignalCodec::Field CanSignalCodec::compiled(const CanSignal& signal) const {
  Field field;
  field.start = signal.start;
  field.length = signal.length;
  field.motorola = signal.encoding.motorola;
  field.format = signal.encoding.format;
  field.initial = signal.initial;
  if (signal.length < 1 || signal.length > 64) refuse(signal, "must have 1 to 64 bits");
  if (is_float(field.format) && signal.length != (field.format == SignalFormat::float32 ? 32 : 64))
    refuse(signal, "a float has 32 bits, a double 64");
  unsigned last = signal.start / 8;  // byte
  if (signal.start < 8 * size_)
    each_byte(signal.start, signal.length, field.motorola,
              [&](unsigned byte, unsigned, unsigned, unsigned) { last = std::max(last, byte); });
  if (last >= size_) refuse(signal, "exceeds the " + std::to_string(size_) + " bytes of its message");

  MeasuredIn in;
  in.quantity = signal.quantity;
  if (signal.quantity == nullptr) {
    if (signal.source.empty()) return field;
    if (signal.source == alive_counter_source) {
      field.source = Source::alive_counter;
    } else if (signal.source == checksum_source) {
      field.source = Source::checksum;
    } else if (signal.source == data_id_nibble_source) {
      field.initial = checksum_.data_id >> 8 & 0xFU;
      return field;
    }
    if (field.source != Source::constant) {
      if (is_float(field.format)) refuse(signal, "a " + std::string(signal.source) + " must be an integer");
      return field;
    }
    const auto found = parse_signal_source(signal.source);
    if (!found)
      refuse(signal, "unknown quantity \"" + std::string(signal.source) + "\"; the quantities are " +
                         measured_names() + ", " + std::string(alive_counter_source) +
                         "; other units of the same kind are possible; " + std::string(signal_source_syntax));
    field.form = *found;
    in = found->in;
  }
  field.scale = signal.scale;
  field.offset = signal.offset;
  if (field.form.form == SignalSource::Form::constant) {
    set_constant(field, signal, field.form.constant);
    return field;
  }
  field.source = Source::quantity;
  field.quantity = in.quantity;
  if (signal.scale == 0 || !std::isfinite(signal.scale) || !std::isfinite(signal.offset))
    refuse(signal, "the scale must be finite and not 0, the offset finite");
  field.lsb = in.factor * signal.scale;
  // SI = factor * (scale * number + offset) + the unit's offset. If the zero differs from an integer only by the
  // rounding of its decimal factors, it is set to this integer, so that values of both signs are rounded alike.
  const double zero = -(signal.offset + in.offset / in.factor) / signal.scale;
  if (!std::isfinite(field.lsb) || field.lsb == 0 || !std::isfinite(zero) || std::abs(zero) > 0x1p62)
    refuse(signal, "scale or offset is out of range");
  field.whole = std::round(zero);
  field.fraction = std::abs(zero - field.whole) < 1e-9 ? 0 : zero - field.whole;
  if (in.quantity->kind != MeasuredQuantity::Kind::number) {
    if (is_float(field.format)) refuse(signal, std::string(in.quantity->name) + " must be an integer");
    const double lsb_ns = std::round(field.lsb * 1e9);
    if (in.quantity->kind == MeasuredQuantity::Kind::time) {
      if (lsb_ns < 1 || lsb_ns > 1e15 || std::abs(lsb_ns - field.lsb * 1e9) > 1e-6 || signal.offset != 0)
        refuse(signal, "a clock needs a resolution of whole nanoseconds and the offset 0");
      field.time_lsb_ns = static_cast<std::int64_t>(lsb_ns);
      field.is_read_back = in.quantity->is_clock();
    } else if (signal.scale != 1 || signal.offset != 0) {
      refuse(signal, "a counter or status needs the scale 1 and the offset 0");
    }
    return field;
  }
  set_range(field, signal);
  using enum SignalSource::Form;
  field.is_read_back = field.form.form == plain;
  if (field.form.form == sign && is_float(field.format)) refuse(signal, "a sign must be an integer");
  if (field.form.form == remainder && !(field.form.modulus > std::abs(signal.scale)))
    refuse(signal, "the modulus must be more than the scale of the signal");
  return field;
}

void CanSignalCodec::set_constant(Field& field, const CanSignal& signal, double value) const {
  if (signal.scale == 0 || !std::isfinite(signal.scale) || !std::isfinite(signal.offset))
    refuse(signal, "the scale must be finite and not 0, the offset finite");
  field.source = Source::fixed;
  set_range(field, signal);
  const double number = (value - signal.offset) / signal.scale;
  if (field.format == SignalFormat::float32) {
    field.initial = std::bit_cast<std::uint32_t>(to_float(number));
  } else if (field.format == SignalFormat::float64) {
    field.initial = std::bit_cast<std::uint64_t>(number);
  } else if (!(std::abs(number - std::round(number)) < 1e-6) || number < field.lowest - 0.5 ||
             number > field.highest + 0.5) {
    refuse(signal, std::string(signal.source) + " is not a value of the signal");
  } else {
    field.initial = to_integer_bits(std::round(number));
  }
}

void CanSignalCodec::set_range(Field& field, const CanSignal& signal) const {
  const bool is_real = is_float(field.format);
  if (is_real) {
    field.highest = field.format == SignalFormat::float32 ? double{FLT_MAX} : DBL_MAX;
    field.lowest = -field.highest;
  } else {
    const bool is_signed = field.format == SignalFormat::signed_integer;
    field.lowest = is_signed ? -std::ldexp(1.0, static_cast<int>(field.length) - 1) : 0;
    field.highest = below_power(field.length - (is_signed ? 1 : 0));
  }
  if (signal.minimum < signal.maximum) {
    double ends[] = {(signal.minimum - signal.offset) / signal.scale,
                     (signal.maximum - signal.offset) / signal.scale};
    std::sort(std::begin(ends), std::end(ends));
    // Files have limits as rounded decimals: -8 for the number -479.999 is -480.
    constexpr double decimal = 0.01;
    const double lowest = std::max(field.lowest, is_real ? ends[0] : std::ceil(ends[0] - decimal));
    const double highest = std::min(field.highest, is_real ? ends[1] : std::floor(ends[1] + decimal));
    if (lowest < highest) {  // otherwise the limits are no such for this field
      field.lowest = lowest;
      field.highest = highest;
    }
  }
}

CanSignalCodec::CanSignalCodec(std::size_t size, std::span<const CanSignal> signals, const MessageChecksum& checksum)
    : size_(size), checksum_(checksum) {
  std::vector<bool> is_sent;
  for (const CanSignal& signal : signals) {
    Field field = compiled(signal);
    field.signal = fields_.size();
    fields_.push_back(field);
    is_sent.push_back(field.source != Source::constant);
    is_multiplexed_ |= field.source == Source::quantity && !signal.pages.empty();
    if (field.source == Source::checksum) {
      if (sum_) refuse(signal, "the message has two checksums");
      sum_ = field;
    }
    if (field.source == Source::alive_counter ||
        (field.quantity != nullptr && field.quantity->kind == MeasuredQuantity::Kind::counter)) {
      if (counter_) refuse(signal, "the message has two counters");
      counter_ = field;
    }
  }
  join_signs();
  pages_ = SignalPages(signals, is_sent);
  for (Field& field : fields_)
    if (pages_.selects(field.signal)) field.source = Source::multiplexor;
  check_overlaps(signals);
  check_checksum(signals);
  // Constants are written first, because another signal may have the same bits.
  std::stable_partition(fields_.begin(), fields_.end(),
                        [](const Field& field) { return field.source == Source::constant; });
}

// Joins the magnitude and the sign of a quantity in one message, which are read back together.
void CanSignalCodec::join_signs() {
  using enum SignalSource::Form;
  for (Field& field : fields_) {
    if (field.form.form != magnitude || field.source != Source::quantity) continue;
    for (const Field& other : fields_)
      if (other.form.form == sign && other.source == Source::quantity && other.quantity == field.quantity &&
          (other.form.in.factor > 0) == (field.form.in.factor > 0))
        field.sign_bits = other.signal;
    field.is_read_back = field.sign_bits.has_value();
  }
}

void CanSignalCodec::check_overlaps(std::span<const CanSignal> signals) const {
  std::vector<std::vector<std::byte>> all;  // the bits of each field that has a source
  for (const Field& field : fields_) {
    std::vector<std::byte> bits(size_);
    if (field.source != Source::constant)
      write_bits(bits, field.start, field.length, field.motorola, ~std::uint64_t{0});
    for (std::size_t other = 0; other < all.size(); ++other)
      for (std::size_t k = 0; k < size_; ++k)
        if ((all[other][k] & bits[k]) != std::byte{0} && pages_.may_meet(field.signal, other))
          refuse(signals[field.signal], "overlaps another signal");
    all.push_back(std::move(bits));
  }
}

void CanSignalCodec::check_checksum(std::span<const CanSignal> signals) {
  if (!sum_) {
    if (checksum_.profile != ChecksumProfile::none)
      throw std::invalid_argument("the message has no signal for its checksum");
    return;
  }
  const CanSignal& signal = signals[sum_->signal];
  if (checksum_.profile == ChecksumProfile::none) refuse(signal, "the kind of the checksum is not given");
  const unsigned first = sum_->motorola ? 7 : 0, half = sum_->motorola ? 3 : 4, at = sum_->start % 8;
  const bool is_nibble = checksum_.bits() == 4, is_long = checksum_.bits() > 8;
  if (sum_->length != checksum_.bits() || (at != first && !(is_nibble && at == half)) || (is_long && sum_->motorola))
    refuse(signal, is_long     ? "must be two whole bytes, Intel"
                   : is_nibble ? "must be the upper or the lower half of a byte"
                               : "must be a whole byte");
  checksum_.is_upper_half = is_nibble && at == (sum_->motorola ? first : half);
  if (!signal.pages.empty()) refuse(signal, "must not depend on a multiplexor");
  const unsigned values = checksum_.counter_values();
  if (values == 0) return;
  if (!counter_) refuse(signal, "its profile needs a signal that is " + std::string(alive_counter_source));
  if (!signals[counter_->signal].pages.empty()) refuse(signal, "its counter must not depend on a multiplexor");
  if (low_bits(counter_->length) < values - 1 ||
      (counter_->source == Source::quantity && low_bits(counter_->length) != values - 1))
    refuse(signal, "its profile needs a counter from 0 to " + std::to_string(values - 1));
}

bool CanSignalCodec::has_increments() const noexcept {
  return std::ranges::any_of(
      fields_, [](const Field& field) { return field.quantity != nullptr && field.quantity->is_increment; });
}

std::uint32_t CanSignalCodec::components() const noexcept {
  ReadBack read;
  for (const Field& field : fields_)
    if (field.quantity != nullptr && field.quantity->set != nullptr && field.is_read_back)
      field.quantity->set(0, read);
  return read.components;
}

std::uint64_t CanSignalCodec::number_of(const Field& field, const Reading& reading,
                                        unsigned& saturated) const noexcept {
  switch (field.quantity->kind) {
    case MeasuredQuantity::Kind::time: {
      const std::int64_t ns = field.quantity->time_of(reading.sample).ns, rest = ns % field.time_lsb_ns;
      const bool is_up = rest >= field.time_lsb_ns - rest, is_down = -rest > field.time_lsb_ns + rest;
      return static_cast<std::uint64_t>(ns / field.time_lsb_ns + (is_up ? 1 : is_down ? -1 : 0));
    }
    case MeasuredQuantity::Kind::counter:
      return reading.sample.counter;
    case MeasuredQuantity::Kind::status:
      return reading.sample.status;
    case MeasuredQuantity::Kind::number:
      break;
  }
  using enum SignalSource::Form;
  double x = field.quantity->get(reading) / field.lsb + field.fraction;
  if (field.form.form != plain) {
    double value = (field.quantity->get(reading) - field.form.in.offset) / field.form.in.factor;
    if (field.form.form == sign) return value < 0 ? 1 : 0;
    if (field.form.form == magnitude) value = std::abs(value);
    if (field.form.form == remainder) {
      const double half = is_float(field.format) ? 0 : 0.5 * std::abs(field.scale);  // the modulus rounds to 0
      value -= field.form.modulus * std::floor((value + half) / field.form.modulus);
    }
    x = (value - field.offset) / field.scale - field.whole;
  }
  const double lowest = field.lowest - field.whole, highest = field.highest - field.whole;
  const double limited = x > lowest ? std::min(x, highest) : lowest;  // a NaN is the lowest
  const double margin = is_float(field.format) ? 0 : 0.5;
  if (!(x >= lowest - margin && x <= highest + margin)) ++saturated;
  if (field.format == SignalFormat::float32) return std::bit_cast<std::uint32_t>(to_float(limited + field.whole));
  if (field.format == SignalFormat::float64) return std::bit_cast<std::uint64_t>(limited + field.whole);
  return to_integer_bits(limited) + static_cast<std::uint64_t>(static_cast<std::int64_t>(field.whole));
}

unsigned CanSignalCodec::encode(const Reading& reading, std::uint64_t count, std::span<std::byte> bytes,
                                std::uint64_t ahead) const noexcept {
  unsigned saturated = 0;
  std::ranges::fill(bytes, std::byte{0});
  for (const Field& field : fields_) {
    if (!pages_.is_present(field.signal, count)) continue;
    std::uint64_t number = field.initial;
    switch (field.source) {
      case Source::constant:
      case Source::fixed:
        break;
      case Source::quantity:
        number = number_of(field, reading, saturated);
        break;
      case Source::alive_counter: {
        const unsigned values = checksum_.counter_values();
        number = count + ahead;
        if (values != 0) number %= values;
        break;
      }
      case Source::multiplexor:
        number = pages_.page(field.signal, count);
        break;
      case Source::checksum:
        continue;
    }
    write_bits(bytes, field.start, field.length, field.motorola, number);
  }
  write_checksum(bytes);
  return saturated;
}

void CanSignalCodec::write_checksum(std::span<std::byte> bytes) const noexcept {
  if (!sum_) return;
  const auto counter = counter_ ? static_cast<unsigned>(bits_of(*counter_, bytes)) : 0U;
  write_bits(bytes, sum_->start, sum_->length, sum_->motorola, checksum_.of(bytes, sum_->start / 8, counter));
}

bool CanSignalCodec::has_good_checksum(std::span<const std::byte> bytes) const noexcept {
  if (!sum_) return true;
  const auto counter = counter_ ? static_cast<unsigned>(bits_of(*counter_, bytes)) : 0U;
  if (const unsigned values = checksum_.counter_values(); values != 0 && counter >= values) return false;
  return bits_of(*sum_, bytes) == checksum_.of(bytes, sum_->start / 8, counter);
}

std::optional<CanSignalCodec::Decoded> CanSignalCodec::decode(std::span<const std::byte> bytes,
                                                              ReadBack& read) const noexcept {
  Decoded decoded;
  Measurement& measurement = read.measurement;
  for (const Field& field : fields_) {
    if (field.source != Source::quantity || !field.is_read_back || !pages_.is_present(field.signal, bytes)) continue;
    const std::uint64_t number = bits_of(field, bytes);
    switch (field.quantity->kind) {
      case MeasuredQuantity::Kind::time:
        decoded.time = {number, field.length};
        decoded.time_lsb_ns = field.time_lsb_ns;
        continue;
      case MeasuredQuantity::Kind::counter:
        decoded.counter = {number, field.length};
        continue;
      case MeasuredQuantity::Kind::status:
        measurement.sample.status = static_cast<std::uint32_t>(number);
        measurement.fields |= Measurement::status;
        continue;
      case MeasuredQuantity::Kind::number:
        break;
    }
    double value = 0;
    switch (field.format) {
      case SignalFormat::unsigned_integer:
        value = static_cast<double>(number);
        break;
      case SignalFormat::signed_integer:
        value = static_cast<double>(static_cast<std::int64_t>(number << (64 - field.length)) >> (64 - field.length));
        break;
      case SignalFormat::float32:
        value = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(number)));
        break;
      case SignalFormat::float64:
        value = std::bit_cast<double>(number);
        break;
    }
    value = (value - field.whole - field.fraction) * field.lsb + 0.0;  // never -0
    if (field.sign_bits) {
      const auto sign = std::ranges::find(fields_, *field.sign_bits, &Field::signal);
      if (bits_of(*sign, bytes) != 0) value = -value;
    }
    if (!std::isfinite(value)) return std::nullopt;
    if (field.quantity->set != nullptr) field.quantity->set(value, read);
  }
  return decoded;
}

}  // namespace imud
