// The layout of a message as lines for people, and the comparison of a test frame with its values.
#include <algorithm>
#include <cmath>

#include "core/numbers/nearest.hpp"
#include "protocols/frames/layout/frame_compiler.hpp"
#include "protocols/wire/byte_text.hpp"
#include "protocols/wire/shortest_text.hpp"

namespace imud {
namespace {

using Kind = FrameElement::Kind;

std::string hex(std::span<const std::byte> bytes) {
  constexpr std::size_t most = 16;
  return hex_text(bytes.first(std::min(bytes.size(), most))) + (bytes.size() > most ? " ..." : "");
}

std::string shortest(double number) {
  char text[longest_shortest_text];
  return {text, write_shortest(text, number)};
}

std::string type_text(const FrameNumber& type) {
  const std::string order = type.bytes == 1 ? "" : type.is_big ? " be" : " le";
  const bool is_signed = type.format == FrameNumber::Format::signed_integer;
  return (type.is_float() ? "f" : is_signed ? "i" : "u") + std::to_string(8 * type.bytes) + order;
}

// Returns the bytes of a range, as " 2-17".
std::string bytes_text(const FrameCheck::Range& range) {
  const auto [begin, end] = range;
  return begin == end ? " none" : " " + std::to_string(begin) + "-" + std::to_string(end - 1);
}

}  // namespace

void FrameLayout::Compiler::make_rows() {
  for (const Placed& placed : placed_) {
    const FrameElement& element = placed.element;
    Row row{placed.offset, element.number.bytes, type_text(element.number), "", "", element.text};
    switch (element.kind) {
      case Kind::label:
        continue;
      case Kind::constant:
        row = {placed.offset, element.bytes.size(), "constant", "", "", hex(element.bytes)};
        break;
      case Kind::unused:
        row = {placed.offset, element.count, "unused", "", "", "0"};
        break;
      case Kind::padding:
        row = {
            placed.offset, (element.count - placed.offset % element.count) % element.count, "padding", "", "", "0"};
        break;
      case Kind::field:
        row.name = element.text.substr(0, element.text.find(':'));
        row.unit = element.source.unit;
        if (!row.unit.empty())
          row.name.erase(row.name.starts_with('-') + element.source.in.quantity->name.size(), row.unit.size() + 1);
        if (element.offset != 0)
          row.remark += (element.offset < 0 ? ", - " : ", + ") + shortest(std::abs(element.offset));
        if (element.has_carry) row.remark += ", with its remainder carried";
        if (element.is_floor) row.remark += ", rounded down";
        row.lsb = element.number.is_float() && element.lsb == 1 ? "" : shortest(element.lsb);
        break;
      case Kind::check:
        row.name = "check " + element.text.substr(6, element.text.find(':', 6) - 6) + " of";
        for (const FrameElement::Range& text : element.ranges) row.name += bytes_text(range(text, placed.offset));
        if (!element.bytes.empty()) row.name += ", then of " + hex(element.bytes);
        break;
      case Kind::length:
        row.name = "length of" + bytes_text(range(element.ranges[0], placed.offset));
        if (element.divisor != 1) row.name += ", divided by " + std::to_string(element.divisor);
        if (element.plus != 0)
          row.name += (element.plus < 0 ? ", - " : ", + ") + std::to_string(std::abs(element.plus));
        break;
      case Kind::bits:
        row.name = element.text;
        break;
    }
    out_.rows_.push_back(std::move(row));
  }
}

void FrameLayout::Compiler::give(const FrameDescription::Value& value, FrameTestValues& given) const {
  const FrameSource source = test_source(value.name);
  const bool is_carried = std::ranges::any_of(out_.fields_, [&source](const Field& field) {
    return field.source == source.kind && field.quantity == source.in.quantity &&
           (source.kind != Source::status || field.status_bits == source.bits ||
            (field.status_bits & source.bits) != 0);
  });
  if (!is_carried) {
    std::vector<std::string_view> names;
    for (const Placed& placed : placed_)
      if (placed.element.kind == Kind::field) names.push_back(placed.element.text);
    refuse_test_value(names);
  }
  given.add(source, value.value);
}

std::string FrameLayout::Compiler::difference(std::span<const std::byte> got,
                                              std::span<const std::byte> wanted) const {
  const auto at = static_cast<std::size_t>(std::ranges::mismatch(got, wanted).in1 - got.begin());
  const auto row = std::ranges::find_if(
      out_.rows_, [at](const Row& one) { return at >= *one.offset && at < *one.offset + one.size; });
  const std::size_t offset = *row->offset;
  std::string text = "differs at byte " + std::to_string(at) + ", in " + row->name +
                     (row->unit.empty() ? "" : "_" + row->unit) + " (" + row->type + " at " + std::to_string(offset) +
                     "): it has " + hex(wanted.subspan(offset, row->size)) + ", test_values give " +
                     hex(got.subspan(offset, row->size));
  const auto field = std::ranges::find_if(out_.fields_, [&](const Field& one) {
    return one.offset == offset && one.quantity != nullptr && one.time_lsb_ns == 0 && one.modulus == 0 &&
           one.quantity->kind == MeasuredQuantity::Kind::number;
  });
  if (field == out_.fields_.end()) return text;
  const auto value = [&](std::span<const std::byte> bytes) {
    return shortest((value_of(*field, load_number(field->number, bytes.data() + offset)) - field->zero) /
                    field->factor);
  };
  return text + ", which mean " + value(wanted) + " and " + value(got);
}

void FrameLayout::Compiler::test() {
  for (const FrameDescription::Test& one : message_.tests) test(one);
  if (!faults_.empty()) throw FrameFaults(description_.file, std::move(faults_));
}

void FrameLayout::Compiler::test(const FrameDescription::Test& test) {
  const auto& [text, line] = test.frame;
  const auto wanted = hex_bytes_in(text);
  if (!wanted) return fault(line, "test_frame", "must be bytes in hexadecimal, such as \"AA 55 01\"");
  FrameTestValues given;
  const std::size_t before = faults_.size();
  for (const FrameDescription::Value& value : test.values) try {
      give(value, given);
    } catch (const std::invalid_argument& error) {
      fault(value.line, "test_values." + value.name, error.what());
    }
  if (faults_.size() > before) return;
  if (wanted->size() != out_.size())
    return fault(line, "test_frame",
                 "has " + std::to_string(wanted->size()) + " bytes, but the layout " + std::to_string(out_.size()));
  std::vector<std::byte> got(out_.size());
  std::vector<double> carried(out_.carries_);
  const unsigned saturated = out_.write({given.sample}, given.state, &given, carried, got);
  // A real unit's bytes that the layout leaves open may have any value; checks include them.
  for (const Placed& placed : placed_)
    if (placed.element.kind == Kind::unused)
      std::copy_n(wanted->begin() + static_cast<std::ptrdiff_t>(placed.offset), placed.element.count,
                  got.begin() + static_cast<std::ptrdiff_t>(placed.offset));
  out_.write_checks(got);
  if (got != *wanted)
    fault(line, "test_frame", difference(got, *wanted));
  else if (saturated > 0)
    fault(line, "test_values", "a value exceeds the range of its field");
}

}  // namespace imud
