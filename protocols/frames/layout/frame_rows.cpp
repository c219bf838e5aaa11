// The layout of a message as lines for people.
#include <algorithm>
#include <cmath>

#include "protocols/frames/layout/frame_compiler.hpp"
#include "protocols/wire/byte_text.hpp"
#include "protocols/wire/shortest_text.hpp"

namespace imud {
namespace {

using Kind = FrameElement::Kind;

// Returns the bytes of a range, as " 2-17".
std::string bytes_text(const FrameCheck::Range& range) {
  const auto [begin, end] = range;
  return begin == end ? " none" : " " + std::to_string(begin) + "-" + std::to_string(end - 1);
}

}  // namespace

void FrameLayout::Compiler::make_rows() {
  bool varies = false;  // the length of what precedes
  const auto range_text = [this](const FrameElement::Range& one, std::size_t own) {
    if (out_.conditions_.empty()) return bytes_text(range(one, own));
    return " @" + one.from + ".." + (one.to.empty() && !one.is_to_end ? "" : "@" + one.to);
  };
  for (const Placed& placed : placed_) {
    const FrameElement& element = placed.element;
    Row row{placed.offset, element.number.bytes, element.number.text(), "", "", element.text};
    switch (element.kind) {
      case Kind::label:
        continue;
      case Kind::constant:
        row = {placed.offset, element.bytes.size(), "constant", "", "", short_hex_text(element.bytes)};
        break;
      case Kind::unused:
        row = {placed.offset,
               element.count,
               "unused",
               "",
               "",
               element.bytes.empty() ? "0" : short_hex_text(element.bytes)};
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
          row.remark += (element.offset < 0 ? ", - " : ", + ") + shortest_text(std::abs(element.offset));
        if (element.has_carry) row.remark += ", with its remainder carried";
        if (element.is_floor) row.remark += ", rounded down";
        row.lsb = element.number.is_float() && element.lsb == 1 ? "" : shortest_text(element.lsb);
        break;
      case Kind::check:
        row.name = "check " + element.text.substr(6, element.text.find(':', 6) - 6) + " of";
        for (const FrameElement::Range& text : element.ranges) row.name += range_text(text, placed.offset);
        if (!element.bytes.empty()) row.name += ", then of " + short_hex_text(element.bytes);
        break;
      case Kind::length:
        row.name = "length of" + range_text(element.ranges[0], placed.offset);
        if (element.divisor != 1) row.name += ", divided by " + std::to_string(element.divisor);
        if (element.plus != 0)
          row.name += (element.plus < 0 ? ", - " : ", + ") + std::to_string(std::abs(element.plus));
        break;
      case Kind::bits:
        row.name = element.text;
        break;
    }
    if (varies) row.offset.reset();
    varies |= placed.needs != 0;
    if (placed.needs != 0) row.remark += ", if " + element.condition;
    out_.rows_.push_back(std::move(row));
  }
}

}  // namespace imud
