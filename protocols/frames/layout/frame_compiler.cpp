#include "protocols/frames/layout/frame_compiler.hpp"

#include <algorithm>
#include <bit>
#include <cfloat>
#include <cmath>

#include "core/numbers/nearest.hpp"

namespace imud {
namespace {

using Kind = FrameElement::Kind;

// Returns the bytes of a number in its byte order.
std::vector<std::byte> bytes_of(std::uint64_t bits, const FrameNumber& type) {
  std::vector<std::byte> bytes(type.bytes);
  store_number(bits, type, bytes.data());
  return bytes;
}

bool overlaps(const FrameCheck::Range& a, std::size_t begin, std::size_t end) {
  return a.first < end && begin < a.second;
}

}  // namespace

FrameFaults::FrameFaults(std::string_view file, std::vector<FrameFault> all)
    : std::invalid_argument("frame_file: " + std::string(file) + ": line " + std::to_string(all.front().line) + ": " +
                            all.front().where + ": " + all.front().what),
      faults(std::move(all)) {}

std::string where_in(const FrameDescription::Message& message, const std::string& key) {
  return "message \"" + message.name + "\": " + key;
}

FrameLayout::FrameLayout(const FrameDescription& description, const FrameDescription::Message& message, Use use) {
  Compiler compiler(*this, description, message, use);
  compiler.compile();
  compiler.test();
}

void FrameLayout::Compiler::fault(std::uint32_t line, const std::string& key, std::string what) {
  faults_.push_back({line, where_in(message_, key), std::move(what)});
}

template <class Act>
void FrameLayout::Compiler::attempt(std::uint32_t line, const std::string& text, Act act) {
  try {
    act();
  } catch (const std::invalid_argument& error) {
    fault(line, "\"" + text + "\"", error.what());
  }
}

void FrameLayout::Compiler::compile() {
  if (message_.layout.empty()) fault(message_.line, "layout", "list the elements of the frame, in their order");
  if (message_.layout.size() > FrameDescription::most_elements)
    fault(message_.line, "layout", "has more than " + std::to_string(FrameDescription::most_elements) + " elements");
  for (const FrameDescription::Text& text : message_.layout)
    attempt(text.line, text.text,
            [&] { place(parse_frame_element(text.text, message_.is_big, description_.checks), text.line); });
  if (out_.size() > FrameDescription::longest_frame)
    fault(message_.line, "layout",
          "the frame has " + std::to_string(out_.size()) + " bytes; the longest has " +
              std::to_string(FrameDescription::longest_frame));
  if (!faults_.empty()) throw FrameFaults(description_.file, std::move(faults_));
  for (const Placed& placed : placed_)
    attempt(placed.line, placed.element.text, [&] {
      if (placed.element.kind == Kind::length) resolve_length(placed);
      if (placed.element.kind == Kind::check) resolve_check(placed);
    });
  if (faults_.empty()) order_checks();
  if (faults_.empty()) check_sync();
  if (!faults_.empty()) throw FrameFaults(description_.file, std::move(faults_));
  out_.pattern_ = description_.start.pattern;
  set_increments();
  out_.find_read_back();
  make_rows();
  make_optional();
  make_variable();
}

void FrameLayout::Compiler::set_increments() noexcept {
  for (Field& field : out_.fields_) {
    if (field.quantity == nullptr) continue;
    out_.has_increments_ |= field.quantity->is_increment;
    if (field.quantity->set == nullptr || field.modulus != 0 || field.source == Source::flag) continue;
    ReadBack own;
    field.quantity->set(0, own);
    field.is_inertial = own.components != 0;
  }
}

void FrameLayout::Compiler::constant(std::size_t offset, std::span<const std::byte> bytes) {
  for (const std::byte byte : bytes) {
    out_.template_[offset] = byte;
    out_.constant_[offset++] = std::byte{0xFF};
  }
}

void FrameLayout::Compiler::place(FrameElement element, std::uint32_t line) {
  const std::size_t offset = out_.size();
  const std::uint64_t needs = condition_of(element);
  std::size_t size = 0;
  switch (element.kind) {
    case Kind::label:
      if (!labels_.emplace(element.label, offset).second) refuse_element("the label is given twice");
      break;
    case Kind::constant:
      size = element.bytes.size();
      break;
    case Kind::unused:
      set_variable(element);
      size = element.count;
      break;
    case Kind::padding:
      size = (element.count - offset % element.count) % element.count;
      break;
    default:
      size = element.number.bytes;
  }
  if (element.kind == Kind::padding && !out_.whole_.parts.empty())
    refuse_element("the frame is no multiple: elements before it are optional");
  if (offset + size > 4 * FrameDescription::longest_frame) refuse_element("with this element the frame is too long");
  out_.template_.resize(offset + size);
  out_.constant_.resize(offset + size);
  const Placed placed{std::move(element), line, offset, needs};
  if (needs != 0) out_.whole_.parts.push_back({offset, size, needs});
  if (placed.element.kind == Kind::constant) constant(offset, placed.element.bytes);
  if (placed.element.kind == Kind::padding) constant(offset, std::vector<std::byte>(size));
  if (placed.element.kind == Kind::unused)
    std::ranges::copy(placed.element.bytes, out_.template_.begin() + static_cast<std::ptrdiff_t>(offset));
  if (placed.element.kind == Kind::field) add_field(placed);
  if (placed.element.kind == Kind::bits) add_bits(placed);
  placed_.push_back(placed);
}

// Sets the period of a counter or status, and checks that the field holds it.
void FrameLayout::Compiler::set_counting(Field& field, const FrameSource& source) const {
  field.modulus = source.modulus;
  field.period = source.modulus != 0 ? static_cast<std::uint64_t>(source.modulus)
                 : field.width == 64 ? 0
                                     : std::uint64_t{1} << field.width;
  if (source.modulus != 0 && field.period - 1 > low_bits(field.width))
    refuse_element("the field does not hold numbers up to the modulus");
}

void FrameLayout::Compiler::set_number(Field& field, const FrameElement& element) {
  const FrameSource& source = element.source;
  const MeasuredIn& in = source.in;
  field.lsb = in.factor * element.lsb;
  // SI = factor * (lsb * number + offset) + the unit's offset. If the zero differs from an integer only by the
  // rounding of its decimal factors, it is set to this integer, so that values of both signs are rounded alike.
  const double zero = -(element.offset + in.offset / in.factor) / element.lsb;
  if (!std::isfinite(field.lsb) || field.lsb == 0 || !std::isfinite(zero) || std::abs(zero) > 0x1p62)
    refuse_element("LSB or offset is out of range");
  field.whole = std::round(zero);
  field.fraction = std::abs(zero - field.whole) < 1e-9 ? 0 : zero - field.whole;
  field.modulus = source.modulus;
  field.factor = in.factor;
  field.zero = in.offset;
  field.scale = element.lsb;
  field.bias = element.offset;
  if (in.quantity->kind == MeasuredQuantity::Kind::time && !field.number.is_float()) {
    const double lsb_ns = std::round(field.lsb * 1e9);
    if (lsb_ns < 1 || lsb_ns > 1e15 || std::abs(lsb_ns - field.lsb * 1e9) > 1e-6 || element.offset != 0)
      refuse_element("a clock needs an LSB of whole nanoseconds and no offset");
    field.time_lsb_ns = static_cast<std::int64_t>(lsb_ns);
    field.period = field.width == 64 ? 0 : std::uint64_t{1} << field.width;
    if (source.modulus != 0) {
      const double ticks = source.modulus * in.factor * 1e9 / lsb_ns;
      if (ticks < 1 || ticks > 0x1p53 || std::abs(ticks - std::round(ticks)) > 1e-6 * ticks ||
          std::round(ticks) - 1 > below_power(field.width))
        refuse_element("the modulus must be a whole number of LSBs that the field holds");
      field.period = static_cast<std::uint64_t>(std::llround(ticks));
    }
    return;
  }
  if (in.quantity->kind == MeasuredQuantity::Kind::time && source.modulus != 0)
    refuse_element("a clock with a modulus must be an integer");
  if (source.modulus != 0 && !field.number.is_float() && !(source.modulus > std::abs(element.lsb)))
    refuse_element("the modulus must be more than the LSB");
  if (field.number.is_float()) {
    field.highest = field.number.format == FrameNumber::Format::float32 ? double{FLT_MAX} : DBL_MAX;
    field.lowest = -field.highest;
  } else {
    const bool is_signed = field.number.format == FrameNumber::Format::signed_integer;
    field.lowest = is_signed ? -std::ldexp(1.0, static_cast<int>(field.width) - 1) : 0;
    field.highest = below_power(field.width - (is_signed ? 1 : 0));
  }
  if (element.has_carry) field.carry = out_.carries_++;
}

void FrameLayout::Compiler::add_field(const Placed& placed) {
  const FrameElement& element = placed.element;
  Field field;
  field.offset = placed.offset;
  field.number = element.number;
  field.width = static_cast<unsigned>(8 * element.number.bytes);
  field.source = element.source.kind;
  field.quantity = element.source.in.quantity;
  field.otherwise = element.source.otherwise;
  field.is_floor = element.is_floor;
  field.name = out_.field_names_.size();
  field.needs = placed.needs;
  using enum MeasuredQuantity::Kind;
  if (field.quantity == nullptr || field.quantity->kind == counter || field.quantity->kind == status)
    set_counting(field, element.source);
  else
    set_number(field, element);
  out_.fields_.push_back(field);
  out_.field_names_.push_back(element.source.name);
}

void FrameLayout::Compiler::add_bits(const Placed& placed) {
  const FrameElement& element = placed.element;
  std::uint64_t value = 0, fixed = 0;
  for (const FrameElement::BitField& bits : element.bit_fields) {
    Field field;
    field.offset = placed.offset;
    field.number = element.number;
    field.low = bits.low;
    field.width = bits.high - bits.low + 1;
    field.source = bits.source.kind;
    field.quantity = bits.source.in.quantity;
    field.otherwise = bits.source.otherwise;
    field.status_bits = bits.source.bits;
    field.is_inverse = bits.source.is_inverse;
    field.name = out_.field_names_.size();
    field.needs = placed.needs;
    if (field.source == Source::constant) {
      value |= bits.source.constant << bits.low;
      fixed |= low_bits(field.width) << bits.low;
      continue;
    }
    if (field.source == Source::flag) {
      field.factor = bits.source.in.factor;
      field.zero = bits.source.in.offset;
      field.limit = bits.source.limit;
    } else if (field.source != Source::status) {
      set_counting(field, bits.source);
    }
    out_.fields_.push_back(field);
    out_.field_names_.push_back(bits.source.name);
  }
  constant(placed.offset, bytes_of(value, element.number));
  std::ranges::copy(bytes_of(fixed, element.number),
                    out_.constant_.begin() + static_cast<std::ptrdiff_t>(placed.offset));
}

std::size_t FrameLayout::Compiler::place_of(const std::string& label) const {
  const auto found = labels_.find(label);
  if (found != labels_.end()) return found->second;
  std::vector<std::string> known;
  for (const auto& [name, offset] : labels_) known.push_back(name);
  const std::string meant = nearest(label, known);
  refuse_element("there is no label \"@" + label + "\"; " +
                 (meant.empty() ? "set it by an element \"@" + label + "\" before the first byte that it means"
                                : "did you mean \"@" + meant + "\"?"));
}

FrameCheck::Range FrameLayout::Compiler::range(const FrameElement::Range& range, std::size_t own) const {
  const std::size_t from = place_of(range.from);
  const std::size_t to = range.is_to_end ? out_.size() : range.to.empty() ? own : place_of(range.to);
  if (from <= to) return {from, to};
  const std::string begin = "@" + range.from + "..";
  refuse_element(
      "the range " + begin + " begins after its end" +
      (range.to.empty() ? "; without an end it ends at the check; " + begin + "@ ends with the frame" : ""));
}

void FrameLayout::Compiler::resolve_length(const Placed& placed) {
  const FrameElement& element = placed.element;
  const FrameCheck::Range over = range(element.ranges[0], placed.offset);
  const auto [from, to] = over;
  if ((to - from) % element.divisor != 0)
    refuse_element("the range has " + std::to_string(to - from) + " bytes, which are no whole number of " +
                   std::to_string(element.divisor));
  const Whole::Length placed_length = {placed.offset, element.number, over, element.divisor, element.plus};
  const std::int64_t length = placed_length.of(to - from);
  if (length < 0 || static_cast<std::uint64_t>(length) > low_bits(static_cast<unsigned>(8 * element.number.bytes)))
    refuse_element("the type does not hold the length, " + std::to_string(length));
  require_sizes(placed_length);
  out_.whole_.lengths.push_back(placed_length);
  constant(placed.offset, bytes_of(static_cast<std::uint64_t>(length), element.number));
}

void FrameLayout::Compiler::resolve_check(const Placed& placed) {
  const FrameElement& element = placed.element;
  Check check{*element.check, placed.offset, element.number.is_big, {}, element.bytes, placed.line, element.text};
  std::size_t bytes = element.bytes.size();
  for (const FrameElement::Range& text : element.ranges) {
    check.ranges.push_back(range(text, placed.offset));
    const auto [from, to] = check.ranges.back();
    if (overlaps(check.ranges.back(), placed.offset, placed.offset + element.number.bytes))
      refuse_element("the range contains the check itself; end it at a label before the check, or leave the end out");
    bytes += to - from;
  }
  if (bytes % element.check->word_size() != 0)
    refuse_element("the range has " + std::to_string(bytes) + " bytes, which are no whole number of words of " +
                   std::to_string(8 * element.check->word_size()) + " bits");
  for (const FrameCheck::Range& one : check.ranges)
    require_whole(one, element.check->word_size(), "words of the check");
  out_.checks_.push_back(std::move(check));
}

// Orders the checks: a check in the range of another check is computed before that check.
void FrameLayout::Compiler::order_checks() {
  std::vector<Check> ordered;
  std::vector<Check>& rest = out_.checks_;
  const auto waits_for = [](const Check& one, const Check& other) {
    return std::ranges::any_of(one.ranges, [&](const FrameCheck::Range& range) {
      return overlaps(range, other.offset, other.offset + other.check.size());
    });
  };
  while (!rest.empty()) {
    const auto ready = std::ranges::find_if(rest, [&](const Check& one) {
      return std::ranges::none_of(rest, [&](const Check& other) { return &other != &one && waits_for(one, other); });
    });
    if (ready == rest.end())
      return fault(rest.front().line, "\"" + rest.front().text + "\"",
                   "two checks contain one another; end the range of one before the other");
    ordered.push_back(std::move(*ready));
    rest.erase(ready);
  }
  rest = std::move(ordered);
}

void FrameLayout::Compiler::check_sync() {
  int bits = 0;
  for (const std::byte byte : out_.constant_) bits += std::popcount(std::to_integer<unsigned>(byte));
  if (use_ != Use::item && bits < 8 && out_.checks_.empty() && description_.escape == FrameEscape::none)
    fault(message_.line, "layout",
          "a decoder cannot find the frame: give at least one constant byte, or a check of its bytes");
}

}  // namespace imud
