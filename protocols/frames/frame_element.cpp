#include "protocols/frames/frame_element.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/numbers/nearest.hpp"
#include "protocols/wire/number_text.hpp"

namespace imud {
namespace {

std::string quoted(std::string_view text) { return "\"" + std::string(text) + "\""; }

// Removes `suffix` from the text, if it ends with it.
bool remove_suffix(std::string_view& text, std::string_view suffix) noexcept {
  if (!text.ends_with(suffix)) return false;
  text.remove_suffix(suffix.size());
  return true;
}

std::string_view without_blanks(std::string_view text) noexcept {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == text.npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

// Calls `take` with each part of the text between separators.
template <class Take>
void each_part(std::string_view text, char separator, Take take) {
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    take(text.substr(begin, end - begin));
    begin = end + 1;
  }
}

FrameNumber number_type(std::string_view name, bool is_big) {
  using enum FrameNumber::Format;
  if (name == "f32") return {float32, 4, is_big};
  if (name == "f64") return {float64, 8, is_big};
  const auto bits = name.empty() ? std::nullopt : number_in<unsigned>(name.substr(1));
  if (!(name.starts_with('u') || name.starts_with('i')) || !bits || *bits == 0 || *bits > 64 || *bits % 8 != 0)
    refuse_element("there is no type " + quoted(name) +
                   "; give u8, u16, u24, u32, u64, i8, i16, i24, i32, i64, f32 or f64");
  return {name.front() == 'u' ? unsigned_integer : signed_integer, *bits / 8, is_big};
}

// The same for a number without sign or fraction, such as a length.
FrameNumber unsigned_type(std::string_view name, bool is_big) {
  const FrameNumber type = number_type(name, is_big);
  if (type.format != FrameNumber::Format::unsigned_integer)
    refuse_element("the type must be unsigned: u8, u16, u24, u32 or u64");
  return type;
}

// Reads a number, a fraction such as 600/2^20, or a power of two from the beginning of the text, and removes it.
double take_fraction(std::string_view& text, std::string_view what) {
  const auto take = [&] {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{})
      refuse_element("the " + std::string(what) + " must be a number, such as 0.01, 1/62500 or 600/2^20");
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    if (!text.starts_with('^')) return value;
    text.remove_prefix(1);
    int exponent = 0;
    const auto [last, fault] = std::from_chars(text.data(), text.data() + text.size(), exponent);
    if (fault != std::errc{} || value != 2 || std::abs(exponent) > 1000)
      refuse_element("a power in the " + std::string(what) + " must be one of two, such as 2^20 or 2^-16");
    text.remove_prefix(static_cast<std::size_t>(last - text.data()));
    return std::ldexp(1.0, exponent);
  };
  double value = take();
  if (text.starts_with('/')) {
    text.remove_prefix(1);
    value /= take();
  }
  if (!std::isfinite(value)) refuse_element("the " + std::string(what) + " must be a finite number");
  return value;
}

// Reads NAME or NAME%MODULUS.
FrameSource source_in(std::string_view text) {
  const std::size_t percent = text.find('%');
  const std::string_view name = text.substr(0, percent);
  auto source = find_frame_source(name);
  if (!source) refuse_element(unknown_frame_source(name));
  if (percent == text.npos) return *source;
  const auto modulus = number_in<double>(text.substr(percent + 1));
  if (!modulus || !std::isfinite(*modulus) || *modulus <= 0)
    refuse_element("the modulus after % must be a positive number, as in yaw_deg%360");
  if (source->kind == FrameSource::Kind::status) refuse_element("a bit of the status has no modulus");
  source->modulus = *modulus;
  return *source;
}

// A counter or a status, whose low bits are sent, has whole moduli and no LSB.
bool is_counting(const FrameSource& source) {
  return source.kind == FrameSource::Kind::alive_counter ||
         (source.kind == FrameSource::Kind::quantity &&
          (source.in.quantity->kind == MeasuredQuantity::Kind::counter ||
           source.in.quantity->kind == MeasuredQuantity::Kind::status));
}

void check_modulus(const FrameSource& source) {
  if (is_counting(source) && (source.modulus != std::floor(source.modulus) || source.modulus > 0x1p53))
    refuse_element("the modulus of a counter must be a whole number");
}

void parse_field(FrameElement& element, std::string_view text, std::size_t colon, bool is_big) {
  element.kind = FrameElement::Kind::field;
  element.source = source_in(text.substr(0, colon));
  std::string_view rest = text.substr(colon + 1);
  const std::size_t end = rest.find_first_of("*+-");
  element.number = number_type(rest.substr(0, end), is_big);
  rest.remove_prefix(std::min(end, rest.size()));
  if (rest.starts_with('*')) {
    rest.remove_prefix(1);
    element.lsb = take_fraction(rest, "LSB after *");
    if (element.lsb == 0) refuse_element("the LSB after * must not be 0");
  }
  if (rest.starts_with('+') || rest.starts_with('-')) {
    const double sign = rest.front() == '-' ? -1 : 1;
    rest.remove_prefix(1);
    element.offset = sign * take_fraction(rest, "offset");
  }
  if (!rest.empty())
    refuse_element("what follows the type must be *LSB, +OFFSET, \" be\", \" le\" or \" carry\", not " +
                   quoted(rest));
  check_modulus(element.source);
  if (element.source.kind == FrameSource::Kind::status)
    refuse_element("one bit of the status is given as bits:u8:0=NAME");
  if (is_counting(element.source) && (element.lsb != 1 || element.offset != 0 || element.number.is_float()))
    refuse_element("a counter or a status is an integer, without LSB and offset");
  if (element.has_carry && (is_counting(element.source) || element.number.is_float() || element.source.modulus != 0 ||
                            element.source.in.quantity->kind != MeasuredQuantity::Kind::number))
    refuse_element("only an integer that is rounded has a remainder to carry");
}

void parse_bits(FrameElement& element, std::string_view text, bool is_big) {
  element.kind = FrameElement::Kind::bits;
  const std::size_t colon = text.find(':');
  if (colon == text.npos) refuse_element("bits are given as bits:u16:0-1=alive_counter,2=1,9=!not_valid");
  element.number = unsigned_type(text.substr(0, colon), is_big);
  const unsigned width = static_cast<unsigned>(8 * element.number.bytes);
  std::uint64_t used = 0;
  each_part(text.substr(colon + 1), ',', [&](std::string_view part) {
    part = without_blanks(part);
    const std::size_t equals = part.find('=');
    if (equals == part.npos) refuse_element(quoted(part) + ": give BIT=SOURCE or FIRST-LAST=SOURCE");
    FrameElement::BitField field;
    const std::string_view place = part.substr(0, equals), name = part.substr(equals + 1);
    const std::size_t dash = place.find('-');
    const auto low = number_in<unsigned>(place.substr(0, dash));
    const auto high = dash == place.npos ? low : number_in<unsigned>(place.substr(dash + 1));
    if (!low || !high || *low > *high || *high >= width)
      refuse_element(quoted(part) + ": give bits from 0 to " + std::to_string(width - 1) + ", the lower one first");
    field.low = *low;
    field.high = *high;
    const std::uint64_t mask = (~std::uint64_t{0} >> (63 - (*high - *low))) << *low;
    if ((used & mask) != 0) refuse_element(quoted(part) + ": a bit is given twice");
    used |= mask;
    if (const auto constant = number_or_hex_in<std::uint64_t>(name)) {
      field.source.constant = *constant;
      if (*constant > mask >> *low) refuse_element(quoted(part) + ": the constant is too large for the bits");
    } else {
      const bool is_inverse = name.starts_with('!');
      field.source = source_in(name.substr(is_inverse ? 1 : 0));
      field.source.is_inverse = is_inverse;
      check_modulus(field.source);
      const bool is_status = field.source.kind == FrameSource::Kind::status;
      if (!is_status && !is_counting(field.source))
        refuse_element(quoted(part) +
                       ": bits are constants, counters, the status, or bits of the status; a quantity is a field");
      if (is_inverse && !is_status) refuse_element(quoted(part) + ": only a bit of the status has an inverse");
      if (is_status && *high != *low) refuse_element(quoted(part) + ": give one bit");
    }
    element.bit_fields.push_back(std::move(field));
  });
}

// Reads "@FROM..", "@FROM..@TO" or "@FROM..@".
FrameElement::Range range_in(std::string_view text) {
  const std::size_t dots = text.find("..");
  const auto label = [&](std::string_view name) {
    if (!name.starts_with('@'))
      refuse_element(quoted(text) + ": a range is @FROM..@TO, of labels, or @FROM..@ up to the end");
    return std::string(name.substr(1));
  };
  if (dots == text.npos)
    refuse_element(quoted(text) + ": a range is @FROM..@TO, of labels, or @FROM..@ up to the end");
  FrameElement::Range range;
  range.from = label(text.substr(0, dots));
  const std::string_view to = text.substr(dots + 2);
  if (!to.empty()) {
    range.to = label(to);
    range.is_to_end = range.to.empty();
  }
  if (range.from.empty()) refuse_element(quoted(text) + ": give the label at which the range begins");
  return range;
}

void parse_length(FrameElement& element, std::string_view text, bool is_big) {
  element.kind = FrameElement::Kind::length;
  const std::size_t colon = text.find(':');
  if (colon == text.npos) refuse_element("a length is given as length:u16:@FROM..@TO, and may end with +NUMBER");
  std::string_view type = text.substr(0, colon), range = text.substr(colon + 1);
  if (const std::size_t slash = type.find('/'); slash != type.npos) {
    const auto divisor = number_in<std::size_t>(type.substr(slash + 1));
    if (!divisor || *divisor == 0 || *divisor > 64)
      refuse_element("a length counts pieces of 1 to 64 bytes: length:u16/2:...");
    element.divisor = *divisor;
    type = type.substr(0, slash);
  }
  if (const std::size_t sign = range.find_first_of("+-"); sign != range.npos) {
    const auto plus = number_in<std::int64_t>(range.substr(range[sign] == '+' ? sign + 1 : sign));
    if (!plus || std::abs(*plus) > 65535)
      refuse_element("after the range of a length comes a whole number, as in +4");
    element.plus = *plus;
    range = range.substr(0, sign);
  }
  element.number = unsigned_type(type, is_big);
  element.ranges.push_back(range_in(range));
  if (element.ranges[0].to.empty() && !element.ranges[0].is_to_end)
    refuse_element("a length ends at a label, or at @, the end of the frame");
}

void parse_check(FrameElement& element, std::string_view text, bool is_big,
                 std::span<const FrameDescription::Check> own) {
  element.kind = FrameElement::Kind::check;
  const std::size_t colon = text.find(':');
  if (colon == text.npos) refuse_element("a check is given as check:crc16/xmodem:@FROM..@TO");
  const std::string_view name = text.substr(0, colon);
  element.check = FrameCheck::find(name, own);
  if (!element.check) {
    const std::string meant = nearest(name, FrameCheck::names(own));
    refuse_element("there is no check " + quoted(name) + "; " +
                   (meant.empty() ? "protocols/frames/README.md lists them" : "did you mean " + quoted(meant) + "?"));
  }
  element.number = {FrameNumber::Format::unsigned_integer, element.check->size(), is_big};
  std::string_view ranges = text.substr(colon + 1);
  if (const std::size_t extra = ranges.find(":+"); extra != ranges.npos) {
    const auto bytes = hex_bytes_in(ranges.substr(extra + 2));
    if (!bytes || bytes->empty()) refuse_element("after :+ come bytes in hexadecimal");
    element.bytes = *bytes;
    ranges = ranges.substr(0, extra);
  }
  each_part(ranges, ',', [&](std::string_view part) { element.ranges.push_back(range_in(without_blanks(part))); });
}

std::size_t count_in(std::string_view text, const char* what) {
  const auto count = number_in<std::size_t>(text);
  if (!count || *count == 0 || *count > FrameDescription::longest_frame)
    refuse_element(std::string(what) + " from 1 to " + std::to_string(FrameDescription::longest_frame));
  return *count;
}

void parse(FrameElement& element, std::string_view text, bool is_big, std::span<const FrameDescription::Check> own) {
  if (text.starts_with('@')) {
    element.kind = FrameElement::Kind::label;
    element.label = text.substr(1);
    constexpr std::string_view letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";
    if (element.label.empty() || element.label.find_first_not_of(letters) != std::string::npos)
      refuse_element("a label is @ and a name of letters, digits and underscores");
    return;
  }
  if (text.starts_with('"')) {
    if (text.size() < 3 || !text.ends_with('"')) refuse_element("a text is in quotes and not empty: '\"snp\"'");
    for (const char c : text.substr(1, text.size() - 2)) element.bytes.push_back(static_cast<std::byte>(c));
    return;
  }
  if (const auto bytes = hex_bytes_in(text); bytes && !bytes->empty()) {
    element.bytes = *bytes;
    return;
  }
  int orders = 0;
  for (;; text = without_blanks(text)) {
    const bool is_be = remove_suffix(text, " be");
    if (is_be || remove_suffix(text, " le")) {
      is_big = is_be;
      ++orders;
    } else if (remove_suffix(text, " carry")) {
      element.has_carry = true;
    } else {
      break;
    }
  }
  const std::size_t colon = text.find(':');
  if (colon == text.npos)
    refuse_element(
        "an element is hexadecimal bytes, a '\"text\"', a @label, or NAME:TYPE, such as rate_x_deg_per_s:i16*0.01");
  const std::string_view word = text.substr(0, colon), rest = text.substr(colon + 1);
  if (orders > 1) refuse_element("give one byte order, \" be\" or \" le\"");
  if (orders > 0 && (word == "pad" || word == "_")) refuse_element("bytes that are 0 have no byte order");
  if (element.has_carry && (word == "bits" || word == "length" || word == "check" || word == "pad" || word == "_"))
    refuse_element("only a field has a remainder to carry");
  if (word == "_") {
    element.kind = FrameElement::Kind::unused;
    element.count = count_in(rest, "_: gives bytes that are not used,");
  } else if (word == "pad") {
    element.kind = FrameElement::Kind::padding;
    element.count = count_in(rest, "pad: gives the bytes of which the frame becomes a multiple,");
  } else if (word == "bits") {
    parse_bits(element, rest, is_big);
  } else if (word == "length") {
    parse_length(element, rest, is_big);
  } else if (word == "check") {
    parse_check(element, rest, is_big, own);
  } else {
    parse_field(element, text, colon, is_big);
  }
}

}  // namespace

void refuse_element(const std::string& fault) { throw std::invalid_argument(fault); }

FrameElement parse_frame_element(std::string_view text, bool is_big, std::span<const FrameDescription::Check> own) {
  FrameElement element;
  element.text = text;
  if (text.size() > FrameDescription::longest_element)
    refuse_element("an element has at most " + std::to_string(FrameDescription::longest_element) + " characters");
  parse(element, without_blanks(text), is_big, own);
  return element;
}

}  // namespace imud
