#include "protocols/frames/text/text_compiler.hpp"

#include <algorithm>
#include <cmath>

#include "protocols/frames/layout/frame_parts.hpp"
#include "protocols/wire/byte_text.hpp"
#include "protocols/wire/shortest_text.hpp"

namespace imud {
namespace {

using Kind = TextPiece::Kind;
using Source = FrameSource::Kind;

}  // namespace

TextLayout::TextLayout(const FrameDescription& description, const FrameDescription::Message& message) {
  std::vector<FrameFault> faults;
  Compiler compiler(*this, description, message);
  try {
    compiler.compile();
    for (const FrameDescription::Test& test : message.tests) compiler.test(test, faults);
  } catch (const std::invalid_argument& error) {
    faults.push_back({message.text->line, where_in(message, "text"), error.what()});
  }
  if (!faults.empty()) throw FrameFaults(description.file, std::move(faults));
}

void TextLayout::Compiler::compile() {
  out_.pieces_ = parse_text_pieces(message_.text->text, description_.checks);
  if (out_.pieces_.empty()) refuse_element("give the line, with numbers in braces: {QUANTITY_UNIT:FORMAT}");
  if (out_.pieces_.size() > most_pieces)
    refuse_element("has more than " + std::to_string(most_pieces) + " numbers and texts between them");
  for (const TextPiece& piece : out_.pieces_) out_.longest_ += piece.longest();
  if (out_.longest_ > FrameDescription::longest_frame)
    refuse_element("may have " + std::to_string(out_.longest_) + " characters; the longest message has " +
                   std::to_string(FrameDescription::longest_frame));
  for (std::size_t i = 0; i < out_.pieces_.size(); ++i) resolve(i);
  check_ends();
  find_read_back();
  name_fields();
  make_rows();
}

// Returns the index of the label.
std::size_t TextLayout::Compiler::place_of(const std::string& label) const {
  const auto found = std::ranges::find(out_.pieces_, label, &TextPiece::label);
  if (found == out_.pieces_.end()) refuse_element("there is no label {@" + label + "}");
  return static_cast<std::size_t>(found - out_.pieces_.begin());
}

// Finds the pieces of a check's ranges. Refuses a label that is given twice.
void TextLayout::Compiler::resolve(std::size_t index) {
  TextPiece& piece = out_.pieces_[index];
  if (piece.kind == Kind::label && place_of(piece.label) != index)
    refuse_element("the label {@" + piece.label + "} is given twice");
  if (piece.kind != Kind::check) return;
  const auto refuse = [&piece](const char* fault) { refuse_element("{" + piece.text + "}: " + fault); };
  if (piece.check->word_size() != 1) refuse("a check of text is of bytes, not of words");
  if (piece.ranges.size() > TextPiece::most_ranges) refuse("a check has at most 8 ranges");
  for (const FrameElement::Range& range : piece.ranges) {
    const std::size_t from = place_of(range.from), to = range.to.empty() ? index : place_of(range.to);
    if (range.is_to_end || to > index) refuse("the range must end before the check");
    if (from > to) refuse("the range begins after its end");
    piece.extents.push_back({from, to, 0, 0});
  }
  if (!piece.ranges.empty()) return;
  const TextPiece* before = index == 0 ? nullptr : &out_.pieces_[index - 1];
  if (before == nullptr || before->kind != Kind::literal || !before->text.ends_with('*'))
    refuse("give the range, as in {check:sum8:@begin..}; without one it is from after the first character to the *");
  piece.extents.push_back({0, index, 1, 1});
}

// Refuses a text in which a decoder cannot find the begin of the line, or the end of a number.
void TextLayout::Compiler::check_ends() const {
  if (std::ranges::none_of(out_.pieces_, [](const TextPiece& one) { return one.kind == Kind::literal; }))
    refuse_element("a decoder cannot find the line: give at least one constant character");
  for (std::size_t i = 0; i < out_.pieces_.size(); ++i) {
    const TextPiece& piece = out_.pieces_[i];
    const TextPiece* next = out_.next(i);
    if (piece.kind != Kind::field || (next != nullptr && out_.is_closed_by(piece, *next))) continue;
    const bool is_choice = piece.format.chosen("").has_value();
    const bool may_be_left_out = piece.format.may_be_empty();
    const bool next_may = next != nullptr && next->kind == Kind::field && next->format.may_be_empty();
    if ((is_choice || piece.fixed_size() > 0) && (!may_be_left_out || next_may)) continue;
    refuse_element("a decoder cannot find the end of {" + piece.text +
                   (next == nullptr ? "}: let a character follow, such as \\n"
                                    : "}: let a character follow that no number has, or fill it up with zeros, as in "
                                      "08.3f"));
  }
}

void TextLayout::Compiler::find_read_back() {
  ReadBack read;
  const auto better = [this](const std::optional<std::size_t>& best, const TextPiece& piece) {
    return !best || out_.pieces_[*best].period() - 1 < piece.period() - 1;  // 0 is the longest
  };
  for (std::size_t i = 0; i < out_.pieces_.size(); ++i) {
    const TextPiece& piece = out_.pieces_[i];
    if (piece.kind != Kind::field) continue;
    const MeasuredQuantity* quantity = piece.source.in.quantity;
    if (piece.source.kind == Source::alive_counter && better(out_.alive_counter_, piece)) out_.alive_counter_ = i;
    if (piece.source.kind == Source::frame_counter && better(out_.frame_counter_, piece)) out_.frame_counter_ = i;
    if (quantity == nullptr) continue;
    out_.has_increments_ |= quantity->is_increment;
    out_.has_time_ |= quantity->is_clock();
    if (quantity->kind == MeasuredQuantity::Kind::counter && better(out_.counter_, piece)) out_.counter_ = i;
    const double lsb_ns = piece.lsb * piece.source.in.factor * 1e9;
    if (quantity->kind == MeasuredQuantity::Kind::time && piece.source.modulus != 0 && piece.format.is_integer()) {
      if (piece.offset != 0 || lsb_ns < 1 || std::abs(lsb_ns - std::round(lsb_ns)) > 1e-6)
        refuse_element("{" + piece.text + "}: a clock with a modulus has an LSB of whole nanoseconds and no offset");
      if (!quantity->is_clock()) continue;
      out_.clock_ = i;
      out_.time_lsb_ns_ = std::llround(lsb_ns);
    }
    if (quantity->set != nullptr && piece.source.modulus == 0 && piece.format.value() == TextFormat::Value::named)
      quantity->set(0, read);
  }
  out_.components_ = read.components;
}

// Lists the numbers by name. A choice such as N/S is the sign of the unsigned angle with the same quantity.
void TextLayout::Compiler::name_fields() {
  const auto is_choice = [](const TextPiece& piece) { return piece.format.chosen("").has_value(); };
  const auto pair_of = [&](const TextPiece& piece, bool of_choice) -> std::optional<std::size_t> {
    for (std::size_t i = 0; i < out_.pieces_.size(); ++i) {
      const TextPiece& other = out_.pieces_[i];
      if (other.kind == Kind::field && other.source.kind == Source::quantity &&
          other.source.in.quantity == piece.source.in.quantity &&
          (of_choice ? other.format.value() == TextFormat::Value::degrees : is_choice(other)))
        return i;
    }
    return std::nullopt;
  };
  for (std::size_t i = 0; i < out_.pieces_.size(); ++i) {
    const TextPiece& piece = out_.pieces_[i];
    if (piece.kind != Kind::field) continue;
    const bool is_quantity = piece.source.kind == Source::quantity;
    if (is_quantity && is_choice(piece) && pair_of(piece, true)) continue;
    const bool has_no_sign = is_quantity && piece.format.value() == TextFormat::Value::degrees;
    out_.named_.push_back({i, has_no_sign ? pair_of(piece, false) : std::nullopt});
    out_.field_names_.push_back(piece.source.name);
  }
}

void TextLayout::Compiler::make_rows() {
  std::optional<std::size_t> offset = 0;
  for (const TextPiece& piece : out_.pieces_) {
    std::size_t size = piece.longest();
    Row row{offset, size, "constant", "", "", visible_text(piece.text)};
    if (piece.kind == Kind::field) {
      const std::size_t colon = piece.text.find(':');
      size = piece.format.may_be_empty() || (piece.format.is_number() && piece.source.kind != Source::status)
                 ? 0
                 : piece.fixed_size();
      row = {offset,
             size,
             piece.text.substr(colon + 1),
             piece.lsb == 1 ? "" : shortest_text(piece.lsb),
             piece.source.unit,
             piece.text.substr(0, colon)};
      if (!row.unit.empty())
        row.name.erase(row.name.starts_with('-') + piece.source.in.quantity->name.size(), row.unit.size() + 1);
      row.type.resize(std::min(row.type.size(), row.type.find('*')));
    }
    if (piece.kind == Kind::check) {
      row.type = "digits";
      row.name = piece.ranges.empty() ? piece.text + " of what is between the first character and *" : piece.text;
    }
    if (piece.kind != Kind::label) out_.rows_.push_back(std::move(row));
    if (offset && size == 0 && piece.kind != Kind::label) offset.reset();
    if (offset) *offset += size;
  }
}

void TextLayout::Compiler::give(const FrameDescription::Value& value, FrameTestValues& given) const {
  const FrameSource source = test_source(value.name);
  std::vector<std::string_view> names;
  for (const TextPiece& piece : out_.pieces_) {
    if (piece.kind != Kind::field) continue;
    names.push_back(piece.text);
    if (piece.source.kind == source.kind && piece.source.in.quantity == source.in.quantity &&
        (source.kind != Source::status || piece.source.bits == source.bits || (piece.source.bits & source.bits) != 0))
      return given.add(source, value.value);
  }
  refuse_test_value(names);
}

void TextLayout::Compiler::test(const FrameDescription::Test& test, std::vector<FrameFault>& faults) const {
  const auto fault = [&](std::uint32_t line, const std::string& key, std::string what) {
    faults.push_back({line, where_in(message_, key), std::move(what)});
  };
  if (!test.settings.empty())
    return fault(test.frame.line, "test_settings", "settings do not change a line; a part may be left out by ?");
  FrameTestValues given;
  if (!give_test_values(
          test.values, [&](const FrameDescription::Value& value) { give(value, given); }, fault))
    return;
  const auto& [wanted, line] = test.frame;
  std::vector<std::byte> frame(out_.longest_);
  Places places;
  const auto [size, saturated] = out_.write({given.sample}, given.state, &given, places, frame);
  const std::string got(reinterpret_cast<const char*>(frame.data()), size);
  if (got == wanted) {
    if (saturated > 0) fault(line, "test_values", "a value exceeds its format");
    return;
  }
  const auto at = static_cast<std::size_t>(std::ranges::mismatch(got, wanted).in1 - got.begin());
  std::size_t piece = 0;
  while (piece + 1 < out_.pieces_.size() && places[piece + 1] <= at) ++piece;
  const std::size_t begin = std::min<std::size_t>(places[piece], wanted.size());
  const std::size_t shown = std::max<std::size_t>(places[piece + 1] - places[piece], 1);
  fault(line, "test_frame",
        "differs at character " + std::to_string(at) + ", in \"" + visible_text(out_.pieces_[piece].text) +
            "\": it has \"" + visible_text(std::string_view(wanted).substr(begin, shown)) +
            "\", test_values give \"" + visible_text(std::string_view(got).substr(begin, shown)) + "\"");
}

}  // namespace imud
