// The comparison of a test frame with its values. The fault names the first element that differs. If only a check
// differs, the fault names the checks that would be right.
#include <algorithm>
#include <utility>

#include "protocols/frames/layout/frame_compiler.hpp"
#include "protocols/wire/byte_text.hpp"
#include "protocols/wire/shortest_text.hpp"

namespace imud {
namespace {

using Kind = FrameElement::Kind;

std::string place_text(std::size_t at, const MessageLayout::Row& row) {
  return "byte " + std::to_string(at) + ", in " + row.name + (row.unit.empty() ? "" : "_" + row.unit) + " (" +
         row.type + " at " + std::to_string(*row.offset) + ")";
}

}  // namespace

void FrameLayout::Compiler::give(const FrameDescription::Value& value, FrameTestValues& given) const {
  const FrameSource source = test_source(value.name);
  const bool is_carried = std::ranges::any_of(out_.fields_, [&source](const Field& field) {
    const bool is_flag = field.source == Source::flag && source.kind == Source::quantity;
    return (is_flag || field.source == source.kind) && field.quantity == source.in.quantity &&
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

// Copies the elements of one kind from one frame to another, within the shorter of the two frames.
void FrameLayout::Compiler::copy_elements(Kind kind, std::span<const std::byte> from, std::span<std::byte> to) const {
  const std::size_t end = std::min(from.size(), to.size());
  for (const Placed& placed : placed_) {
    if (placed.element.kind != kind || placed.offset >= end) continue;
    const std::size_t size = kind == Kind::unused ? placed.element.count : placed.element.number.bytes;
    std::ranges::copy(from.subspan(placed.offset, std::min(size, end - placed.offset)),
                      to.begin() + static_cast<std::ptrdiff_t>(placed.offset));
  }
}

// Returns the first byte that differs, or the end of the shorter frame, and its row.
std::pair<std::size_t, std::vector<MessageLayout::Row>::const_iterator> FrameLayout::Compiler::first_difference(
    std::span<const std::byte> got, std::span<const std::byte> wanted) const {
  const auto at = static_cast<std::size_t>(std::ranges::mismatch(got, wanted).in1 - got.begin());
  return {at, std::ranges::find_if(std::as_const(out_.rows_), [at](const Row& one) {
            return at >= *one.offset && at < *one.offset + one.size;
          })};
}

std::string FrameLayout::Compiler::difference(std::span<const std::byte> got,
                                              std::span<const std::byte> wanted) const {
  const auto [at, row] = first_difference(got, wanted);
  const std::size_t offset = *row->offset;
  std::string text = "differs at " + place_text(at, *row) + ": it has " +
                     short_hex_text(wanted.subspan(offset, row->size)) + ", test_values give " +
                     short_hex_text(got.subspan(offset, row->size));
  const auto field = std::ranges::find_if(out_.fields_, [&](const Field& one) {
    return one.offset == offset && one.quantity != nullptr && one.time_lsb_ns == 0 && one.modulus == 0 &&
           one.quantity->kind == MeasuredQuantity::Kind::number;
  });
  const auto value = [&](std::span<const std::byte> bytes) {
    constexpr int digits = 15;  // 0.01 times 1000 is 10 in so many
    char number[longest_shortest_text];
    const double si = value_of(*field, load_number(field->number, bytes.data() + offset));
    return std::string(number, write_rounded(number, (si - field->zero) / field->factor, digits));
  };
  if (field != out_.fields_.end()) text += ", which mean " + value(wanted) + " and " + value(got);
  std::string also;
  for (auto other = row + 1; other != out_.rows_.end(); ++other)
    if (!std::ranges::equal(got.subspan(*other->offset, other->size), wanted.subspan(*other->offset, other->size)))
      also += (also.empty() ? "; so do " : ", ") + other->name;
  return text + also;
}

std::string FrameLayout::Compiler::wrong_size(std::span<const std::byte> got,
                                              std::span<const std::byte> wanted) const {
  std::string text = "has " + std::to_string(wanted.size()) + " bytes, but the layout " + std::to_string(got.size());
  const auto [at, row] = first_difference(got, wanted);
  if (row == out_.rows_.end()) return text + "; as far as both reach they agree";
  return text + "; they agree up to " + place_text(at, *row);
}

std::string FrameLayout::Compiler::wrong_check(const Check& check) const {
  std::vector<std::vector<std::byte>> frames;
  for (const FrameDescription::Test& one : message_.tests)
    if (auto bytes = hex_bytes_in(one.frame.text); bytes && bytes->size() == out_.size())
      frames.push_back(std::move(*bytes));
  std::size_t bytes = check.extra.size();
  for (const auto& [begin, end] : check.ranges) bytes += end - begin;
  std::vector<std::string> right;
  for (const std::string& name : FrameCheck::names(description_.checks)) {
    const FrameCheck one = *FrameCheck::find(name, description_.checks);
    if (one.size() != check.check.size() || bytes % one.word_size() != 0) continue;
    for (const bool is_big : {false, true}) {
      const FrameNumber type{FrameNumber::Format::unsigned_integer, one.size(), is_big};
      const auto fits = [&](const std::vector<std::byte>& frame) {
        const std::uint64_t sent = load_number(type, frame.data() + check.offset);
        const auto width = static_cast<unsigned>(8 * one.size());
        return ((one.of(frame, check.ranges, check.extra, is_big) ^ sent) & low_bits(width)) == 0;
      };
      if (std::ranges::all_of(frames, fits)) right.push_back(name + (one.size() == 1 ? "" : is_big ? " be" : " le"));
      if (one.size() == 1) break;
    }
  }
  if (right.empty())
    return "; no check that is known gives it over this range: try another range, or describe a CRC as [check.NAME]";
  std::string text = "; over this range ";
  for (std::size_t i = 0; i < right.size(); ++i) text.append(i == 0 ? "" : " or ").append(right[i]);
  return text + " would be right";
}

void FrameLayout::Compiler::test() {
  for (const FrameDescription::Test& one : message_.tests) test(one);
  if (!faults_.empty()) throw FrameFaults(description_.file, std::move(faults_));
}

void FrameLayout::Compiler::test(const FrameDescription::Test& test) {
  const auto& [text, line] = test.frame;
  if (!out_.conditions_.empty()) return test_selected(test);
  if (!test.settings.empty())
    return fault(line, "test_settings", "no element is optional, so that settings do not change the frame");
  const auto wanted = hex_bytes_in(text);
  if (!wanted) return fault(line, "test_frame", "must be bytes in hexadecimal, such as \"AA 55 01\"");
  FrameTestValues given;
  const auto refuse = [this](std::uint32_t at, const std::string& key, const char* what) { fault(at, key, what); };
  if (!give_test_values(
          test.values, [&](const FrameDescription::Value& value) { give(value, given); }, refuse))
    return;
  std::vector<std::byte> got(out_.size());
  std::vector<double> carried(out_.carries_);
  const unsigned saturated = out_.write({given.sample}, given.state, &given, carried, got);
  // Unused bytes of a real unit may have any value. A check includes these bytes. A check also differs if any other
  // byte does, and a length differs if the size of the frame does.
  copy_elements(Kind::unused, *wanted, got);
  copy_elements(Kind::check, *wanted, got);
  if (wanted->size() != got.size()) {
    copy_elements(Kind::length, *wanted, got);
    return fault(line, "test_frame", wrong_size(got, *wanted));
  }
  if (got != *wanted) return fault(line, "test_frame", difference(got, *wanted));
  for (const Check& check : out_.checks_) {
    out_.write_check(check, got);
    if (got != *wanted) return fault(line, "test_frame", difference(got, *wanted) + wrong_check(check));
  }
  if (saturated > 0) fault(line, "test_values", "a value exceeds the range of its field");
}

}  // namespace imud
