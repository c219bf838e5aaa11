#include "protocols/frames/text/text_layout.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/units.hpp"

namespace imud {
namespace {

using Kind = TextPiece::Kind;
using Source = FrameSource::Kind;

constexpr std::size_t unfinished = ~std::size_t{0}, wrong = unfinished - 1;  // ends of fields

std::string_view text_of(std::span<const std::byte> bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool is_status_word(const TextPiece& piece) noexcept {
  return piece.source.kind == Source::quantity && piece.source.in.quantity->kind == MeasuredQuantity::Kind::status;
}

// Returns the counter or status of a field; nullopt if the field is no integer.
std::optional<std::uint64_t> integer_of(const TextPiece& piece, const Reading& reading,
                                        const MessageLayout::State& state) noexcept {
  const FrameSource& source = piece.source;
  std::uint64_t value = 0;
  if (source.kind == Source::alive_counter)
    value = state.count;
  else if (source.kind == Source::frame_counter)
    value = state.frames;
  else if (source.kind == Source::quantity && source.in.quantity->kind == MeasuredQuantity::Kind::counter)
    value = reading.sample.counter;
  else if (is_status_word(piece))
    value = reading.sample.status;
  else
    return std::nullopt;
  return source.modulus == 0 ? value : value % static_cast<std::uint64_t>(source.modulus);
}

// Returns the number of a field in its unit and LSB.
double number_of(const TextPiece& piece, const Reading& reading, const MessageLayout::State& state,
                 const FrameTestValues* given) noexcept {
  const FrameSource& source = piece.source;
  if (source.kind == Source::status) return is_set(source.bits, reading, state) != source.is_inverse ? 1 : 0;
  const MeasuredIn& in = source.in;
  const double si = in.quantity->kind == MeasuredQuantity::Kind::time
                        ? 1e-9 * static_cast<double>(in.quantity->time_of(reading.sample).ns)
                        : imud::number_of(*in.quantity, source.otherwise, reading, given);
  if (piece.format.value() == TextFormat::Value::seconds) return si;
  if (piece.format.value() == TextFormat::Value::degrees) return si / units::degree;
  double value = (si - in.offset) / in.factor;
  if (source.modulus != 0) {  // A value that rounds to the modulus becomes 0.
    const double half = 0.5 * piece.format.step() * std::abs(piece.lsb);
    value = std::max(value - source.modulus * std::floor((value + half) / source.modulus), 0.0);
  }
  return (value - piece.offset) / piece.lsb;
}

bool is_left_out(const TextPiece& piece, const Reading& reading, const FrameTestValues* given) noexcept {
  if (!piece.format.may_be_empty()) return false;
  const MeasuredQuantity* quantity = piece.source.in.quantity;
  if (given != nullptr)
    return quantity != nullptr && quantity->kind == MeasuredQuantity::Kind::number && !given->has(*quantity);
  if ((reading.sample.status & status::not_valid) != 0) return true;
  return quantity != nullptr && !quantity->is_known(reading.sample);
}

}  // namespace

std::size_t TextLayout::write_field(const TextPiece& piece, const Reading& reading, const State& state,
                                    const FrameTestValues* given, char* out, unsigned& saturated) const noexcept {
  if (is_left_out(piece, reading, given)) return 0;
  if (const auto integer = integer_of(piece, reading, state)) return piece.format.write(*integer, out);
  bool is_saturated = false;
  const std::size_t size = piece.format.write(number_of(piece, reading, state, given), out, is_saturated);
  saturated += is_saturated;
  return size;
}

std::size_t TextLayout::write_check(const TextPiece& piece, std::span<const std::byte> frame, const Places& places,
                                    char* out) const noexcept {
  std::array<FrameCheck::Range, TextPiece::most_ranges> ranges;
  for (std::size_t i = 0; i < piece.extents.size(); ++i) {
    const auto& [from, to, plus, less] = piece.extents[i];
    const std::size_t begin = places[from] + plus;
    ranges[i] = {begin, std::max(begin, places[to] - less)};
  }
  const std::uint64_t right = piece.check->of(frame, std::span(ranges).first(piece.extents.size()), {}, true);
  const char* const digits = piece.is_lower ? "0123456789abcdef" : "0123456789ABCDEF";
  const std::size_t size = 2 * piece.check->size();
  for (std::size_t i = 0; i < size; ++i) out[i] = digits[right >> 4 * (size - 1 - i) & 15U];
  return size;
}

TextLayout::Encoded TextLayout::write(const Reading& reading, const State& state, const FrameTestValues* given,
                                      Places& places, std::span<std::byte> frame) const noexcept {
  Encoded encoded;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    const TextPiece& piece = pieces_[i];
    char* const out = reinterpret_cast<char*>(frame.data()) + encoded.size;
    places[i] = static_cast<std::uint16_t>(encoded.size);
    if (piece.kind == Kind::literal)
      encoded.size += piece.text.copy(out, piece.text.size());
    else if (piece.kind == Kind::field)
      encoded.size += write_field(piece, reading, state, given, out, encoded.saturated);
    else if (piece.kind == Kind::check)
      encoded.size += write_check(piece, frame, places, out);
  }
  places[pieces_.size()] = static_cast<std::uint16_t>(encoded.size);
  return encoded;
}

TextLayout::Encoded TextLayout::encode(const Reading& reading, const State& state, std::span<double>,
                                       std::span<std::byte> frame) const noexcept {
  Places places;
  return write(reading, state, nullptr, places, frame);
}

const TextPiece* TextLayout::next(std::size_t index) const noexcept {
  while (++index < pieces_.size())
    if (pieces_[index].kind != Kind::label) return &pieces_[index];
  return nullptr;
}

// Returns the end of the field that begins at `begin`.
std::size_t TextLayout::field_end(std::size_t index, std::string_view held, std::size_t begin) const noexcept {
  const TextFormat& format = pieces_[index].format;
  const std::string_view text = held.substr(begin);
  const TextPiece* after = next(index);
  std::size_t size = 0;
  if (const auto chosen = format.chosen(text)) {
    size = *chosen;
  } else if (after == nullptr || !is_closed_by(pieces_[index], *after)) {
    if (text.empty()) return unfinished;
    size = format.may_be_empty() && !format.may_have(text.front()) ? 0 : pieces_[index].fixed_size();
  } else {
    while (size < text.size() && size <= format.longest() && format.may_have(text[size])) ++size;
    if (size == text.size() && size <= format.longest()) return unfinished;
  }
  if (size > text.size()) return unfinished;
  if (!format.matches(text.substr(0, size))) return size == text.size() && format.chosen(text) ? unfinished : wrong;
  return begin + size;
}

TextLayout::Match TextLayout::find(std::string_view held, Places& places) const noexcept {
  std::size_t at = 0;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    const TextPiece& piece = pieces_[i];
    places[i] = static_cast<std::uint16_t>(at);
    std::size_t size = 0;
    if (piece.kind == Kind::field) {
      const std::size_t end = field_end(i, held, at);
      if (end == unfinished) return Match::unfinished;
      if (end == wrong) return Match::no;
      size = end - at;
    } else if (piece.kind == Kind::literal) {
      size = piece.text.size();
      const std::string_view there = held.substr(at, size);
      if (there != std::string_view(piece.text).substr(0, there.size())) return Match::no;
    } else if (piece.kind == Kind::check) {
      size = 2 * piece.check->size();
    }
    if (held.size() - at < size) return Match::unfinished;
    at += size;
  }
  places[pieces_.size()] = static_cast<std::uint16_t>(at);
  return Match::yes;
}

MessageLayout::Found TextLayout::match(std::span<const std::byte> held) const noexcept {
  held = held.first(std::min(held.size(), longest_));
  Places places;
  const Match found = find(text_of(held), places);
  if (found != Match::yes) return {held.size() == longest_ ? Match::no : found, 0};
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    if (pieces_[i].kind != Kind::check) continue;
    char right[16];
    const std::size_t size = write_check(pieces_[i], held, places, right);
    if (std::memcmp(held.data() + places[i], right, size) != 0) return {Match::wrong_check, 0};
  }
  return {Match::yes, places[pieces_.size()]};
}

bool TextLayout::has_check() const noexcept { return std::ranges::count(pieces_, Kind::check, &TextPiece::kind) > 0; }

bool TextLayout::reseal(std::span<std::byte> frame) const noexcept {
  Places places;
  if (!has_check() || frame.size() > longest_ || find(text_of(frame), places) != Match::yes ||
      places[pieces_.size()] != frame.size())
    return false;
  for (std::size_t i = 0; i < pieces_.size(); ++i)
    if (pieces_[i].kind == Kind::check)
      write_check(pieces_[i], frame, places, reinterpret_cast<char*>(frame.data()) + places[i]);
  return true;
}

MessageLayout::Decoded TextLayout::wrapping() const noexcept {
  const auto of = [this](const std::optional<std::size_t>& index) {
    return index ? std::optional(Wrapping{0, pieces_[*index].period()}) : std::nullopt;
  };
  return {of(clock_), of(counter_), of(alive_counter_), of(frame_counter_)};
}

// Reads a field. Returns false if its number is impossible.
bool TextLayout::read_field(std::size_t index, std::string_view text, ReadBack& read,
                            Decoded& decoded) const noexcept {
  const TextPiece& piece = pieces_[index];
  const FrameSource& source = piece.source;
  Measurement& measurement = read.measurement;
  if (index == clock_ || index == counter_ || index == alive_counter_ || index == frame_counter_) {
    const auto value = piece.format.read_integer(text);
    if (!value) return false;
    (index == clock_           ? decoded.time
     : index == counter_       ? decoded.counter
     : index == alive_counter_ ? decoded.alive_counter
                               : decoded.frame_counter) = Wrapping{*value, piece.period()};
    return true;
  }
  if (source.kind == Source::alive_counter || source.kind == Source::frame_counter) return true;
  if (source.kind == Source::status) {
    const std::uint32_t bits = source.bits & ~FrameSource::starting;
    if (!std::has_single_bit(bits)) return true;
    const auto number = piece.format.read(text);
    const bool is_one = number ? *number != 0 : piece.format.is_above(text);
    measurement.sample.status &= ~bits;
    if (is_one != source.is_inverse) measurement.sample.status |= bits;
    measurement.fields |= Measurement::status;
    return true;
  }
  if (is_status_word(piece)) {
    const auto value = piece.format.read_integer(text);
    if (!value) return false;
    measurement.sample.status = static_cast<std::uint32_t>(*value);
    measurement.fields |= Measurement::status;
    return true;
  }
  const MeasuredQuantity& quantity = *source.in.quantity;
  if (quantity.kind == MeasuredQuantity::Kind::counter) return true;
  const bool is_time = quantity.is_clock();
  if (source.modulus != 0 || (!is_time && quantity.set == nullptr)) return true;
  const auto number = piece.format.read(text);
  if (!number) return piece.format.value() != TextFormat::Value::named;
  const double si = (*number * piece.lsb + piece.offset) * source.in.factor + source.in.offset;
  if (!std::isfinite(si)) return false;
  if (!is_time) {
    quantity.set(si + 0.0, read);
    return true;
  }
  measurement.sample.time.ns = std::llround(std::clamp(1e9 * si, -0x1p62, 0x1p62));
  measurement.fields |= Measurement::time;
  return true;
}

std::optional<MessageLayout::Decoded> TextLayout::decode(std::span<const std::byte> frame,
                                                         ReadBack& read) const noexcept {
  Places places;
  Decoded decoded;
  const std::string_view text = text_of(frame);
  if (find(text, places) != Match::yes) return std::nullopt;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    const std::string_view part = text.substr(places[i], places[i + 1] - places[i]);
    if (pieces_[i].kind == Kind::field && !part.empty() && !read_field(i, part, read, decoded)) return std::nullopt;
  }
  return decoded;
}

// Returns the value of a field that is not left out.
FieldValue TextLayout::field_value(const TextPiece& piece, std::string_view text) noexcept {
  const FrameSource& source = piece.source;
  const TextFormat& format = piece.format;
  const bool is_choice = format.chosen("").has_value();
  if (source.kind == Source::status) {
    const bool is_one = is_choice ? format.is_above(text) : format.read(text).value_or(0) != 0;
    return integer_field(is_one != source.is_inverse);
  }
  if (is_choice) return integer_field(format.choice_value(text));
  const bool is_plain = piece.lsb == 1 && piece.offset == 0;
  const bool is_counter =
      source.kind != Source::quantity || source.in.quantity->kind != MeasuredQuantity::Kind::number;
  if (is_plain && format.is_integer() && is_counter)
    if (const auto whole = format.read_integer(text)) return integer_field(*whole);
  const double factor = std::abs(source.in.factor);
  if (const auto number = format.read_sexagesimal(text))
    return real_field(*number * (format.value() == TextFormat::Value::degrees ? units::degree : 1) / factor, false,
                      0);
  if (const auto number = format.read(text))
    return real_field(*number * piece.lsb + piece.offset, source.in.factor < 0, source.modulus);
  return {};
}

void TextLayout::read_fields(std::span<const std::byte> frame, std::span<FieldValue> values) const noexcept {
  Places places;
  const std::string_view text = text_of(frame);
  if (find(text, places) != Match::yes) return;
  const auto text_at = [&](std::size_t i) { return text.substr(places[i], places[i + 1] - places[i]); };
  for (std::size_t i = 0; i < named_.size(); ++i) {
    const auto& [number, sign] = named_[i];
    values[i] = text_at(number).empty() ? FieldValue() : field_value(pieces_[number], text_at(number));
    if (!sign || text_at(*sign).empty()) continue;
    const bool is_minus = pieces_[*sign].format.is_above(text_at(*sign)) == (pieces_[*sign].source.in.factor < 0);
    if (is_minus) values[i].real = 0.0 - values[i].real;
  }
}

}  // namespace imud
