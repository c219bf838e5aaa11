#include "protocols/frames/layout/frame_element.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "core/numbers/nearest.hpp"
#include "core/numbers/number_text.hpp"
#include "protocols/frames/layout/frame_parts.hpp"
#include "protocols/quantities/columns.hpp"
#include "protocols/wire/byte_text.hpp"

namespace imud {
namespace {

// If the text ends with `suffix`, removes the suffix and returns true.
bool remove_suffix(std::string_view& text, std::string_view suffix) noexcept {
  if (!text.ends_with(suffix)) return false;
  text.remove_suffix(suffix.size());
  return true;
}

FrameNumber number_type(std::string_view name, bool is_big) {
  using enum FrameNumber::Format;
  if (name == "f32") return {float32, 4, is_big};
  if (name == "f64") return {float64, 8, is_big};
  const auto bits = name.empty() ? std::nullopt : number_in<unsigned>(name.substr(1));
  if (!(name.starts_with('u') || name.starts_with('i')) || !bits || *bits == 0 || *bits > 64 || *bits % 8 != 0)
    refuse_element("there is no type " + in_quotes(name) +
                   "; give u8, u16, u24, u32, u64, i8, i16, i24, i32, i64, f32 or f64");
  return {name.front() == 'u' ? unsigned_integer : signed_integer, *bits / 8, is_big};
}

// Returns the type of a number without sign and fraction, such as a length. Refuses other types.
FrameNumber unsigned_type(std::string_view name, bool is_big) {
  const FrameNumber type = number_type(name, is_big);
  if (type.format != FrameNumber::Format::unsigned_integer)
    refuse_element("the type must be unsigned: u8, u16, u24, u32 or u64");
  return type;
}

void parse_field(FrameElement& element, std::string_view text, std::size_t colon, bool is_big) {
  element.kind = FrameElement::Kind::field;
  element.source = source_in(text.substr(0, colon));
  std::string_view rest = text.substr(colon + 1);
  const std::size_t end = rest.find_first_of("*+-");
  element.number = number_type(rest.substr(0, end), is_big);
  rest.remove_prefix(std::min(end, rest.size()));
  std::tie(element.lsb, element.offset) = take_scale(rest);
  if (!rest.empty())
    refuse_element("what follows the type must be *LSB, +OFFSET, \" be\", \" le\" or \" carry\", not " +
                   in_quotes(rest));
  check_modulus(element.source);
  if (element.source.kind == FrameSource::Kind::status)
    refuse_element("one bit of the status is given as bits:u8:0=NAME");
  if (is_counting(element.source) && (element.lsb != 1 || element.offset != 0 || element.number.is_float()))
    refuse_element("a counter or a status is an integer, without LSB and offset");
  if (element.has_carry && (is_counting(element.source) || element.number.is_float() || element.source.modulus != 0 ||
                            element.source.in.quantity->kind != MeasuredQuantity::Kind::number))
    refuse_element("only an integer that is rounded has a remainder to carry");
  if (element.is_floor && (is_counting(element.source) || element.number.is_float() || element.has_carry))
    refuse_element("only an integer that is rounded, and carries no remainder, is rounded down");
}

// Turns the source, a quantity that is a number, into a flag. `limit`: "<NUMBER", or empty.
void make_flag(FrameSource& source, std::string_view limit) {
  if (source.modulus != 0) refuse_element("a bit has no modulus");
  source.kind = FrameSource::Kind::flag;
  if (limit.empty()) return;
  source.limit = finite_number_in(limit.substr(1));
  if (!source.limit)
    refuse_element(in_quotes(limit) + ": the limit of a bit must be a number, as in 4=position_sigma_north_m<10");
  source.name += limit;
}

void parse_bits(FrameElement& element, std::string_view text, bool is_big) {
  element.kind = FrameElement::Kind::bits;
  const std::size_t colon = text.find(':');
  if (colon == text.npos) refuse_element("bits are given as bits:u16:0-1=alive_counter,2=1,9=!not_valid");
  element.number = unsigned_type(text.substr(0, colon), is_big);
  const unsigned width = static_cast<unsigned>(8 * element.number.bytes);
  std::uint64_t used = 0;
  each_part(text.substr(colon + 1), ',', [&](std::string_view part) {
    part = trim(part);
    const std::size_t equals = part.find('=');
    if (equals == part.npos) refuse_element(in_quotes(part) + ": give BIT=SOURCE or FIRST-LAST=SOURCE");
    FrameElement::BitField field;
    const std::string_view place = part.substr(0, equals), name = part.substr(equals + 1);
    const std::size_t dash = place.find('-');
    const auto low = number_in<unsigned>(place.substr(0, dash));
    const auto high = dash == place.npos ? low : number_in<unsigned>(place.substr(dash + 1));
    if (!low || !high || *low > *high || *high >= width)
      refuse_element(in_quotes(part) + ": give bits from 0 to " + std::to_string(width - 1) +
                     ", the lower one first");
    field.low = *low;
    field.high = *high;
    const std::uint64_t mask = low_bits(*high - *low + 1) << *low;
    if ((used & mask) != 0) refuse_element(in_quotes(part) + ": a bit is given twice");
    used |= mask;
    if (const auto constant = number_or_hex_in<std::uint64_t>(name)) {
      field.source.constant = *constant;
      if (*constant > mask >> *low) refuse_element(in_quotes(part) + ": the constant is too large for the bits");
    } else {
      const bool is_inverse = name.starts_with('!');
      const std::size_t below = std::min(name.find('<'), name.size());
      field.source = source_in(name.substr(is_inverse ? 1 : 0, below - (is_inverse ? 1 : 0)));
      field.source.is_inverse = is_inverse;
      check_modulus(field.source);
      const bool is_number = field.source.kind == FrameSource::Kind::quantity &&
                             field.source.in.quantity->kind == MeasuredQuantity::Kind::number;
      if (is_number)
        make_flag(field.source, name.substr(below));
      else if (below != name.size())
        refuse_element(in_quotes(part) + ": only a quantity that is a number has a limit");
      const bool is_bit = is_number || field.source.kind == FrameSource::Kind::status;
      if (!is_bit && !is_counting(field.source))
        refuse_element(in_quotes(part) +
                       ": bits are constants, counters, the status, its bits, or bits of quantities");
      if (is_inverse && !is_bit)
        refuse_element(in_quotes(part) + ": only a bit of the status or of a quantity has an inverse");
      if (is_bit && *high != *low) refuse_element(in_quotes(part) + ": give one bit");
    }
    element.bit_fields.push_back(std::move(field));
  });
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
  element.check = check_named(name, own);
  element.number = {FrameNumber::Format::unsigned_integer, element.check->size(), is_big};
  std::string_view ranges = text.substr(colon + 1);
  if (const std::size_t extra = ranges.find(":+"); extra != ranges.npos) {
    const auto bytes = hex_bytes_in(ranges.substr(extra + 2));
    if (!bytes || bytes->empty()) refuse_element("after :+ come bytes in hexadecimal");
    element.bytes = *bytes;
    ranges = ranges.substr(0, extra);
  }
  each_part(ranges, ',', [&](std::string_view part) { element.ranges.push_back(range_in(trim(part))); });
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
    element.label = label_in(text);
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
  constexpr std::string_view sent = "_=";
  if (text.starts_with(sent)) {
    const auto bytes = hex_bytes_in(text.substr(sent.size()));
    if (!bytes || bytes->empty())
      refuse_element("after _= come the bytes that are sent, in hexadecimal, as in _=12 34");
    element.kind = FrameElement::Kind::unused;
    element.bytes = *bytes;
    element.count = bytes->size();
    return;
  }
  int orders = 0;
  for (;; text = trim(text)) {
    const bool is_be = remove_suffix(text, " be");
    if (is_be || remove_suffix(text, " le")) {
      is_big = is_be;
      ++orders;
    } else if (remove_suffix(text, " carry")) {
      element.has_carry = true;
    } else if (remove_suffix(text, " floor")) {
      element.is_floor = true;
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
  if (element.is_floor && (word == "bits" || word == "length" || word == "check" || word == "pad" || word == "_"))
    refuse_element("only a field is rounded down");
  if (word == "_") {
    element.kind = FrameElement::Kind::unused;
    element.is_variable = rest == "*";
    element.count = element.is_variable ? 1 : count_in(rest, "_: gives bytes that are not used,");
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
  if (text.size() > FrameDescription::longest_element)
    refuse_element("an element has at most " + std::to_string(FrameDescription::longest_element) + " characters");
  text = trim(text);
  element.condition = take_condition(text);
  element.text = text;
  parse(element, text, is_big, own);
  using enum FrameElement::Kind;
  if (!element.condition.empty() && element.kind != constant && element.kind != unused && element.kind != field &&
      element.kind != bits)
    refuse_element("only constants, _:N, numbers and bits are optional");
  return element;
}

}  // namespace imud
