#include "protocols/frames/layout/frame_layout.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <iterator>

#include "protocols/wire/shortest_text.hpp"
#include "protocols/wire/wire.hpp"

namespace imud {
namespace {

using Format = FrameNumber::Format;

// A number that is at most so much below an integer, in LSBs, counts as this integer: its factors are not exact.
constexpr double floor_margin = 1e-6;

// Returns the number with the shortest decimal text that is this float: 0.1 for 0.1f.
double shortest_decimal(float number) noexcept {
  char text[24];
  const auto end = std::to_chars(text, std::end(text), number).ptr;
  double decimal = number;
  std::from_chars(text, end, decimal);
  return decimal;
}

std::uint64_t repeated(std::byte byte) noexcept { return std::to_integer<std::uint64_t>(byte) * 0x0101010101010101U; }

}  // namespace

bool is_set(std::uint32_t bits, const Reading& reading, const MessageLayout::State& state) noexcept {
  return (((reading.sample.status & ~FrameSource::starting) | (state.is_starting ? FrameSource::starting : 0U)) &
          bits) != 0;
}

std::uint64_t FrameLayout::rounded_time(const Field& field, std::int64_t ns) const noexcept {
  const std::int64_t lsb = field.time_lsb_ns, rest = ns % lsb;
  const bool is_up = !field.is_floor && rest >= lsb - rest, is_down = field.is_floor ? rest < 0 : -rest > lsb + rest;
  const std::int64_t ticks = ns / lsb + (is_up ? 1 : is_down ? -1 : 0);
  if (field.modulus == 0) return static_cast<std::uint64_t>(ticks);
  const auto period = static_cast<std::int64_t>(field.period);
  const std::int64_t remainder = ticks % period;
  return static_cast<std::uint64_t>(remainder < 0 ? remainder + period : remainder);
}

std::uint64_t FrameLayout::number_of(const Field& field, const Reading& reading, const State& state,
                                     const FrameTestValues* given, std::span<double> carried,
                                     unsigned& saturated) const noexcept {
  const auto counted = [&field](std::uint64_t value) { return field.modulus != 0 ? value % field.period : value; };
  switch (field.source) {
    case Source::constant:
      return 0;
    case Source::alive_counter:
      return counted(state.count);
    case Source::frame_counter:
      return counted(state.frames);
    case Source::status:
      return is_set(field.status_bits, reading, state) != field.is_inverse ? 1 : 0;
    case Source::flag: {
      const double si = imud::number_of(*field.quantity, field.otherwise, reading, given);
      const double value = (si - field.zero) / field.factor;
      const bool is_one = field.limit ? value < *field.limit : value > 0;
      return is_one != field.is_inverse ? 1 : 0;
    }
    case Source::quantity:
      break;
  }
  double si = 0;
  switch (field.quantity->kind) {
    case MeasuredQuantity::Kind::counter:
      return counted(reading.sample.counter);
    case MeasuredQuantity::Kind::status:
      return counted(reading.sample.status);
    case MeasuredQuantity::Kind::time:
      if (field.time_lsb_ns != 0) return rounded_time(field, field.quantity->time_of(reading.sample).ns);
      si = 1e-9 * static_cast<double>(field.quantity->time_of(reading.sample).ns);
      break;
    case MeasuredQuantity::Kind::number:
      si = imud::number_of(*field.quantity, field.otherwise, reading, given);
      break;
  }
  double x = si / field.lsb + field.fraction;
  if (field.modulus != 0) {
    // A value that rounds to the modulus becomes 0.
    const double half = (field.number.is_float() ? 0 : field.is_floor ? floor_margin : 0.5) * std::abs(field.scale);
    double value = (si - field.zero) / field.factor;
    value -= field.modulus * std::floor((value + half) / field.modulus);
    x = (value - field.bias) / field.scale - field.whole;
  }
  if (field.carry) x += carried[*field.carry];
  const double lowest = field.lowest - field.whole, highest = field.highest - field.whole;
  const double limited = x > lowest ? std::min(x, highest) : lowest;  // a NaN is the lowest
  const double margin = field.number.is_float() ? 0 : 0.5;
  if (!(x >= lowest - margin && x <= highest + margin)) ++saturated;
  if (field.number.format == Format::float32) return std::bit_cast<std::uint32_t>(to_float(limited + field.whole));
  if (field.number.format == Format::float64) return std::bit_cast<std::uint64_t>(limited + field.whole);
  const std::uint64_t number = to_integer_bits(field.is_floor ? std::floor(limited + floor_margin) : limited);
  if (field.carry) {
    const double sent = limited >= 0x1p63 ? limited : static_cast<double>(static_cast<std::int64_t>(number));
    carried[*field.carry] = limited - sent;
  }
  return number + static_cast<std::uint64_t>(static_cast<std::int64_t>(field.whole));
}

unsigned FrameLayout::write(const Reading& reading, const State& state, const FrameTestValues* given,
                            std::span<double> carried, std::span<std::byte> frame) const noexcept {
  std::memcpy(frame.data(), template_.data(), template_.size());
  unsigned saturated = 0;
  for (const Field& field : fields_) {
    const bool has_pattern = state.is_starting && field.is_inertial && pattern_ != std::byte{0};
    std::uint64_t bits =
        has_pattern ? repeated(pattern_) : number_of(field, reading, state, given, carried, saturated);
    std::byte* const to = frame.data() + field.offset;
    if (field.width != 8 * field.number.bytes)
      bits = load_number(field.number, to) | (bits & low_bits(field.width)) << field.low;
    store_number(bits, field.number, to);
  }
  write_checks(frame);
  return saturated;
}

void FrameLayout::write_checks(std::span<std::byte> frame) const noexcept {
  for (const Check& one : checks_) write_check(one, frame);
}

void FrameLayout::write_check(const Check& one, std::span<std::byte> frame) noexcept {
  store_number(one.check.of(frame, one.ranges, one.extra, one.is_big),
               {Format::unsigned_integer, one.check.size(), one.is_big}, frame.data() + one.offset);
}

bool FrameLayout::may_coincide(const FrameLayout& other) const noexcept {
  for (std::size_t i = 0; i < std::min(fixed(), other.fixed()); ++i)
    if (((template_[i] ^ other.template_[i]) & constant_[i] & other.constant_[i]) != std::byte{0}) return false;
  return true;
}

bool FrameLayout::has_constants(std::span<const std::byte> held) const noexcept {
  for (std::size_t i = 0; i < held.size(); ++i)
    if (((held[i] ^ template_[i]) & constant_[i]) != std::byte{0}) return false;
  return true;
}

bool FrameLayout::reseal(std::span<std::byte> frame) const noexcept {
  if (!conditions_.empty()) return reseal_any(frame);
  if (checks_.empty() || frame.size() != size() || !has_constants(frame)) return false;
  write_checks(frame);
  return true;
}

FrameLayout::Found FrameLayout::match(std::span<const std::byte> held) const noexcept {
  if (variable_) return match_variable(held);
  const std::size_t known = std::min(held.size(), size());
  if (!has_constants(held.first(known))) return {Match::no, 0};
  if (known < size()) return {Match::unfinished, 0};
  for (const Check& one : checks_) {
    const FrameNumber type{Format::unsigned_integer, one.check.size(), one.is_big};
    const std::uint64_t right = one.check.of(held, one.ranges, one.extra, one.is_big);
    if (((load_number(type, held.data() + one.offset) ^ right) & low_bits(static_cast<unsigned>(8 * type.bytes))) !=
        0)
      return {Match::wrong_check, 0};
  }
  return {Match::yes, size()};
}

double FrameLayout::value_of(const Field& field, std::uint64_t bits) noexcept {
  double number = 0;
  switch (field.number.format) {
    case Format::unsigned_integer:
      number = static_cast<double>(bits);
      break;
    case Format::signed_integer:
      number = static_cast<double>(static_cast<std::int64_t>(bits << (64 - field.width)) >> (64 - field.width));
      break;
    case Format::float32:
      number = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
      break;
    case Format::float64:
      number = std::bit_cast<double>(bits);
      break;
  }
  return (number - field.whole - field.fraction) * field.lsb + 0.0;  // never -0
}

FrameLayout::Decoded FrameLayout::wrapping() const noexcept {
  const auto of = [this](const std::optional<std::size_t>& field) {
    return field ? std::optional(Wrapping{0, fields_[*field].period}) : std::nullopt;
  };
  return {of(clock_), of(counter_), of(alive_counter_), of(frame_counter_)};
}

std::optional<FrameLayout::Decoded> FrameLayout::decode(std::span<const std::byte> frame,
                                                        ReadBack& read) const noexcept {
  Decoded decoded;
  Measurement& measurement = read.measurement;
  bool has_pattern = false;  // in place of the inertial quantities
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const Field& field = fields_[i];
    const std::uint64_t bits =
        load_number(field.number, frame.data() + field.offset) >> field.low & low_bits(field.width);
    if (field.source == Source::alive_counter) {
      if (i == alive_counter_) decoded.alive_counter = {bits, field.period};
      continue;
    }
    if (field.source == Source::frame_counter) {
      if (i == frame_counter_) decoded.frame_counter = {bits, field.period};
      continue;
    }
    if (field.source == Source::status) {
      if (field.status_bits == FrameSource::starting && pattern_ != std::byte{0})
        has_pattern |= (bits != 0) != field.is_inverse;
      // A field that stands for several bits of the status is not read back.
      const std::uint32_t status_bits = field.status_bits & ~FrameSource::starting;
      if (!std::has_single_bit(status_bits)) continue;
      if ((bits != 0) != field.is_inverse)
        measurement.sample.status |= status_bits;
      else
        measurement.sample.status &= ~status_bits;
      measurement.fields |= Measurement::status;
      continue;
    }
    if (field.source == Source::flag) continue;
    switch (field.quantity->kind) {
      case MeasuredQuantity::Kind::counter:
        if (i == counter_) decoded.counter = {bits, field.period};
        continue;
      case MeasuredQuantity::Kind::status:
        measurement.sample.status = static_cast<std::uint32_t>(bits);
        measurement.fields |= Measurement::status;
        continue;
      case MeasuredQuantity::Kind::time:
        if (field.time_lsb_ns != 0) {
          if (i == clock_) decoded.time = {bits, field.period};
          continue;
        }
        break;
      case MeasuredQuantity::Kind::number:
        break;
    }
    const double value = value_of(field, bits);
    if (!std::isfinite(value)) return std::nullopt;
    if (field.quantity->is_clock()) {
      measurement.sample.time.ns = std::llround(std::clamp(1e9 * value, -0x1p62, 0x1p62));
      measurement.fields |= Measurement::time;
    } else if (field.quantity->set != nullptr && field.modulus == 0) {
      field.quantity->set(value, read);
    }
  }
  if (has_pattern) {
    measurement.sample.status |= status::not_valid;
    measurement.fields |= Measurement::status;
  }
  return decoded;
}

FieldValue integer_field(std::uint64_t magnitude, bool is_negative) noexcept {
  return {FieldValue::Kind::integer, is_negative && magnitude != 0, magnitude};
}

FieldValue real_field(double value, bool is_negated, double modulus, int digits) noexcept {
  if (is_negated) value = -value;
  if (modulus != 0 && value < 0) value += modulus;
  return {FieldValue::Kind::real, false, 0, value + 0.0, digits};  // never -0
}

FieldValue FrameLayout::field_value(const Field& field, std::uint64_t bits) noexcept {
  if (field.source == Source::status || field.source == Source::flag)
    return integer_field((bits != 0) != field.is_inverse);
  if (field.source != Source::quantity || field.quantity->kind == MeasuredQuantity::Kind::counter ||
      field.quantity->kind == MeasuredQuantity::Kind::status)
    return integer_field(bits);
  const bool is_negated = field.factor < 0, is_plain = field.scale == 1 && field.bias == 0;
  const auto real = [&](double number, int digits) {
    return real_field(number * field.scale + field.bias, is_negated, field.modulus,
                      is_plain ? digits : certain_digits);
  };
  switch (field.number.format) {
    case Format::float32:
      return real(shortest_decimal(std::bit_cast<float>(static_cast<std::uint32_t>(bits))), certain_digits);
    case Format::float64:
      return real(std::bit_cast<double>(bits), all_digits);
    case Format::signed_integer: {
      const unsigned unused = 64 - field.width;
      const auto number = static_cast<std::int64_t>(bits << unused) >> unused;
      if (!is_plain || field.modulus != 0) return real(static_cast<double>(number), certain_digits);
      const auto whole = static_cast<std::uint64_t>(number);
      return integer_field(number < 0 ? 0 - whole : whole, (number < 0) != is_negated);
    }
    case Format::unsigned_integer:
      break;
  }
  if (!is_plain || (is_negated && field.modulus != 0)) return real(static_cast<double>(bits), certain_digits);
  return integer_field(bits, is_negated);
}

void FrameLayout::read_fields(std::span<const std::byte> frame, std::span<FieldValue> values) const noexcept {
  if (!conditions_.empty()) std::ranges::fill(values, FieldValue());
  for (const Field& field : fields_) {
    const std::uint64_t bits = load_number(field.number, frame.data() + field.offset) >> field.low;
    values[field.name] = field_value(field, bits & low_bits(field.width));
  }
}

}  // namespace imud
