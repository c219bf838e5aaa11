#include "protocols/frames/text/text_piece.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "protocols/frames/layout/frame_parts.hpp"
#include "protocols/quantities/columns.hpp"

namespace imud {
namespace {

using Kind = TextPiece::Kind;

// Reads check:NAME[:RANGES][:x].
TextPiece check_in(std::string_view text, std::span<const FrameDescription::Check> own) {
  TextPiece piece{.kind = Kind::check, .text = std::string(text)};
  text.remove_prefix(std::string_view("check:").size());
  if (text.ends_with(":x")) {
    piece.is_lower = true;
    text.remove_suffix(2);
  }
  const std::size_t colon = text.find(':');
  piece.check = check_named(text.substr(0, colon), own);
  if (colon != text.npos)
    each_part(text.substr(colon + 1), ',',
              [&](std::string_view part) { piece.ranges.push_back(range_in(trim(part))); });
  return piece;
}

TextPiece field_in(std::string_view text) {
  TextPiece piece{.kind = Kind::field, .text = std::string(text)};
  const std::size_t colon = text.find(':');
  if (colon == text.npos)
    refuse_element("a number is given as {QUANTITY_UNIT:FORMAT}, such as {rate_x_deg_per_s:+08.3f}");
  const bool is_inverse = text.starts_with('!');
  piece.source = source_in(text.substr(is_inverse ? 1 : 0, colon - (is_inverse ? 1 : 0)));
  piece.source.is_inverse = is_inverse;
  if (is_inverse && piece.source.kind != FrameSource::Kind::status)
    refuse_element("only a bit of the status has an inverse");
  check_modulus(piece.source);
  std::string_view rest = text.substr(colon + 1);
  piece.format = TextFormat::take(rest);
  std::tie(piece.lsb, piece.offset) = take_scale(rest);
  if (!rest.empty()) refuse_element("what follows the format must be ?, *LSB or +OFFSET, not " + in_quotes(rest));
  if (piece.format.chosen("") && (piece.lsb != 1 || piece.offset != 0))
    refuse_element("a choice of texts has no LSB and no offset");
  const bool is_integer = piece.format.is_integer();
  if (is_counting(piece.source) && (!is_integer || piece.lsb != 1 || piece.offset != 0))
    refuse_element("a counter or the status is written as d or X, without LSB and offset");
  if (piece.format.value() == TextFormat::Value::named) return piece;
  const bool is_seconds = piece.format.value() == TextFormat::Value::seconds;
  const MeasuredQuantity* quantity = piece.source.in.quantity;
  const bool has_unit = quantity != nullptr && !quantity->units.empty() &&
                        quantity->units.front().suffix == (is_seconds ? "_s" : "_rad");
  if (!has_unit || piece.lsb != 1 || piece.offset != 0 || piece.source.modulus != 0)
    refuse_element(is_seconds ? "hhmmss is of a time, such as {time_of_day_s:hhmmss.ss}, without LSB and offset"
                              : "ddmm is of an angle, such as {latitude_deg:ddmm.mmmm}, without LSB and offset");
  return piece;
}

TextPiece braced(std::string_view text, std::span<const FrameDescription::Check> own) {
  try {
    if (text.starts_with('@')) return {.kind = Kind::label, .text = std::string(text), .label = label_in(text)};
    return text.starts_with("check:") ? check_in(text, own) : field_in(text);
  } catch (const std::invalid_argument& error) {
    refuse_element("{" + std::string(text) + "}: " + error.what());
  }
}

}  // namespace

std::size_t TextPiece::longest() const noexcept {
  switch (kind) {
    case Kind::literal:
      return text.size();
    case Kind::label:
      return 0;
    case Kind::field:
      return format.longest();
    case Kind::check:
      return 2 * check->size();
  }
  return 0;
}

std::size_t TextPiece::fixed_size() const noexcept {
  const bool is_digit = source.kind == FrameSource::Kind::status && format.is_integer();
  return is_digit && format.width() <= 1 ? 1 : format.fixed_size();
}

std::uint64_t TextPiece::period() const noexcept {
  if (source.modulus == 0) return format.period();
  const bool is_time =
      source.kind == FrameSource::Kind::quantity && source.in.quantity->kind == MeasuredQuantity::Kind::time;
  return static_cast<std::uint64_t>(std::llround(source.modulus / (is_time ? lsb : 1)));
}

std::vector<TextPiece> parse_text_pieces(std::string_view text, std::span<const FrameDescription::Check> own) {
  std::vector<TextPiece> pieces;
  const auto literal = [&pieces](std::string_view characters) {
    if (pieces.empty() || pieces.back().kind != Kind::literal) pieces.push_back({});
    pieces.back().text += characters;
  };
  while (!text.empty()) {
    const std::size_t brace = std::min(text.find_first_of("{}"), text.size());
    if (brace > 0) literal(text.substr(0, brace));
    text.remove_prefix(brace);
    if (text.empty()) break;
    if (text.starts_with("{{") || text.starts_with("}}")) {
      literal(text.substr(0, 1));
      text.remove_prefix(2);
      continue;
    }
    const std::size_t end = text.find('}');
    if (text.front() == '}' || end == text.npos)
      refuse_element("a number is given in braces, {NAME:FORMAT}; a brace that is sent is written twice, {{ or }}");
    pieces.push_back(braced(text.substr(1, end - 1), own));
    text.remove_prefix(end + 1);
  }
  return pieces;
}

}  // namespace imud
